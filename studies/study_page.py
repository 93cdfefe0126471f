"""The page of a series of analyses or fits: notes, figure, table, and what it comes to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..fits.citation import citation
from ..notes import Note
from ..reports import Charts, Listing, Picture, Report, Section, Table
from .study_folder import FILES

if TYPE_CHECKING:
    import pandas as pd


def study_page(
    title: str,
    said: Sequence[str],
    table: pd.DataFrame,
    table_file: str,
    notes: Sequence[Note],
    figure: str | None = None,
    charts: Sequence[Charts] = (),
) -> Report:
    """The page. said : the lines of the terminal. figure : a picture in the folder, which stands in
    the page unless charts do.
    """
    from pandas.api.types import is_numeric_dtype

    words = tuple(k for k, kind in enumerate(table.dtypes) if not is_numeric_dtype(kind))
    shown = Table("The numbers", list(table.columns), table.to_numpy(object).tolist(), text=words)
    return Report(
        title=title,
        warnings=[note.line for note in notes],
        sections=[
            Section("What it comes to", [Listing("\n".join(said))] if said else []),
            Section("Figure", charts or ([Picture(figure, title)] if figure else [])),
            Section("The numbers", [shown]),
            Section("How to cite", citation()),
        ],
        files=[
            (table_file, "the table"),
            *([(figure, "picture of the charts")] if figure else []),
            *FILES,
        ],
    )
