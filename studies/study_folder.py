"""The folder of a study: its tables and picture, notes.csv, report.html, and last result.json."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from ..fits.store import RESULT
from ..notes import NOTES, NOTES_ARE, Note, write_notes
from ..reports import Report, write_report
from ..writing import replacing, write_text

#: Of every study's page, after what is its own.
FILES = ((NOTES, NOTES_ARE), (RESULT, "all numbers of this page, for programs"))


def write_folder(
    folder: Path,
    tables: Mapping[str, pd.DataFrame],
    figures: Mapping[str, Callable[[Path], object]],
    notes: Sequence[Note],
    page: Report,
    result: Mapping[str, Any],
    digits: int | None = None,
) -> Path:
    """Write everything; the page's path.

    Parameters
    ----------
    tables : by the names of their files. figures : what draws each, by the name of its file.
    digits : significant ones of the tables' numbers, all unless given.

    Raises
    ------
    OutputError : a file cannot be written.
    """
    if (folder / RESULT).exists():  # what is half written has none
        (folder / RESULT).unlink()
    form = None if digits is None else f"%.{digits}g"
    for name, table in tables.items():
        with replacing(folder / name) as path:
            table.to_csv(path, index=False, float_format=form, lineterminator="\n")
    for name, draw in figures.items():
        draw(folder / name)
    write_notes(folder, notes)
    written = write_report(folder, page)
    write_text(folder / RESULT, json.dumps(result, indent=1) + "\n")
    return written
