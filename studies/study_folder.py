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


def write_study(
    folder: Path,
    tables: Mapping[str, pd.DataFrame],
    digits: int,
    draw: Callable[[], object],
    notes: Sequence[Note],
    page: Report,
    result: Mapping[str, Any],
) -> Path:
    """Write everything; the page's path.

    Parameters
    ----------
    tables : by the names of their files. digits : significant ones of their numbers.
    draw : makes the picture.

    Raises
    ------
    OutputError : a file cannot be written.
    """
    (folder / RESULT).unlink(missing_ok=True)
    for name, table in tables.items():
        with replacing(folder / name) as path:
            table.to_csv(path, index=False, float_format=f"%.{digits}g", lineterminator="\n")
    draw()
    write_notes(folder, notes)
    written = write_report(folder, page)
    write_text(folder / RESULT, json.dumps(result, indent=1) + "\n")
    return written
