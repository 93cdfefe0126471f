"""The page of a series of analyses or fits: notes, figure, table, and what it comes to."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..fits.citation import citation
from ..fits.store import RESULT
from ..notes import NOTES, NOTES_ARE, Note
from ..reports import Charts, Listing, Picture, Report, Section, Table, write_report

if TYPE_CHECKING:
    import pandas as pd


def write_study_page(
    folder: Path,
    title: str,
    said: Sequence[str],
    table: pd.DataFrame,
    table_file: str,
    notes: Sequence[Note],
    figure: str | None = None,
    charts: Sequence[Charts] = (),
) -> Path:
    """Write page.json and report.html; figure : a picture in the folder, which
    stands in the page unless charts do.

    said : the lines of the terminal.

    Raises
    ------
    OutputError : they cannot be written.
    """
    from pandas.api.types import is_numeric_dtype

    words = tuple(k for k, kind in enumerate(table.dtypes) if not is_numeric_dtype(kind))
    shown = Table("The numbers", list(table.columns), table.to_numpy(object).tolist(), text=words)
    report = Report(
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
            (NOTES, NOTES_ARE),
            (RESULT, "all numbers of this page, for programs"),
        ],
    )
    return write_report(folder, report)
