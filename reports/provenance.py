"""Provenance on report pages: date and fabric, the record of runs and data files, the citation."""

import os
import shlex
from collections.abc import Mapping
from datetime import date

from ..notes import NOTES, NOTES_ARE
from ..project.project import Project
from ..runs.folder import AS_RUN, DIGITS, PROVENANCE, RESULT, Provenance
from ..storage.templates import render
from ..version import __version__
from .content import Listing, Part, Table, Words

#: Files that every output folder of a finished run has, with their descriptions.
NOTES_FILE = (NOTES, NOTES_ARE)
RESULT_FILE = (RESULT, "all numbers of this page, for programs")
FILES_OF_ALL = (NOTES_FILE, RESULT_FILE)


def about_of(project: Project, record: Provenance | None) -> list[tuple[str, object]]:
    """Return labels and values of date, fabric and laboratory, for the head of a page.

    Parameters
    ----------
    project : Project
        The project.
    record : Provenance or None
        Record whose last run gives the date; None for today's date.
    """
    date_of_run = record.runs[-1].get("date", "") if record is not None and record.runs else ""
    fabric = project.fabric
    return [
        ("date", date_of_run[:10] or str(date.today())),
        ("fabric", f"{project.title}, {fabric.thickness:.4g} mm"),
        *([("laboratory", fabric.lab)] if fabric.lab else []),
    ]


def citation() -> list[Part]:
    """Return the section on how to cite: a sentence and the entries of BibTeX."""
    words = f"Please cite bubblefit {__version__} and the thesis whose method it follows:"
    return [Words([words]), Listing(render("report/citation.bib.j2", version=__version__).strip())]


RECORD_TITLE = "The record"


def record_tables(record: Provenance) -> list[Table]:
    """Return the tables of a record: one of runs and solver, and one of the data files if any."""
    tables = [_record_table(record)]
    if record.data:
        tables.append(_data_table(record))
    return tables


def _record_table(record: Provenance) -> Table:
    """Return a table of the project file, the runs and the solver of a record."""
    rows = [["project file", os.path.abspath(record.project)]]
    for run in record.runs:
        command = run.get("command_line")
        machine = run.get("machine", {})
        rows += [
            ["command", "none: called from Python" if command is None else shlex.join(command)],
            ["begun", run.get("date", "")],
            ["machine", ", ".join(f"{value}" for value in machine.values())],
            ["versions", ", ".join(f"{k} {v}" for k, v in run.get("versions", {}).items())],
        ]
    if facts := record.solver:
        settings = [f"{k} = {v}" for k, v in facts.items() if v and k not in ("name", "version")]
        program = facts.get("version") or facts.get("name", "")
        rows.append(["solver", "; ".join([program, *settings])])
    if not record.data:
        rows.append(["data files", "none: computed, or of a kind that names no files"])
    note = f"All of it, with the text of the project: {PROVENANCE}."
    if record.settings is not None:
        note += f" The project with the options of the command, to be run again: {AS_RUN}."
    return Table(RECORD_TITLE, ["", ""], rows, note, text=(1,))


def _data_table(record: Provenance) -> Table:
    """Return a table of the data files of a record with their checksums."""
    header = ["test", "file", "sha256", "format", "columns", "rows used", "rows dropped"]
    files = [
        [
            row["test"],
            row["name"],
            row["sha256"][:DIGITS],
            row["format"],
            _columns(row["columns"], row["units"]),
            row["rows_used"],
            ", ".join(f"{n} {cause}" for cause, n in row["rows_dropped"].items()) or "none",
        ]
        for row in record.data
    ]
    note = f"The first {DIGITS} digits of each sha256; {PROVENANCE} has all, and what was chosen."
    title = f"{RECORD_TITLE}: data files"
    return Table(title, header, files, note, text=(1, 2, 3, 4, 6))


def _columns(columns: Mapping[str, str], units: Mapping[str, str]) -> str:
    """Return in words which column of a file gave which quantity, in which unit."""
    unit_words = {quantity: f" in {unit}" for quantity, unit in units.items()}
    return ", ".join(f"{key}: {name}{unit_words.get(key, '')}" for key, name in columns.items())
