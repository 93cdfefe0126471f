"""The record of a run, provenance.json: project, data files, command, date, machine, versions."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from ..experiments.data_files import files_of
from ..reports import Table
from ..writing import checksum, write_text
from .differences import DIGITS
from .numbers import versions
from .store import AS_RUN, PROVENANCE
from .written import project_text

TITLE = "The record"
NO_COMMAND = "none: called from Python"
NO_FILES = "none: computed, or of a kind that names no files"


@dataclass(frozen=True, eq=False)
class Record:
    """What a folder's results came from.

    Parameters
    ----------
    project : its file, in full. text : of that file, None of a project without one. settings : as
        `written.settings_of` has them. data : a row a file, see `data_rows`. runs : when, by which
        command, on which machine, with which versions; those that were gone on with come first.
    """

    project: Path
    text: str | None
    settings: Mapping[str, Any] | None
    data: Sequence[Mapping[str, Any]]
    solver: Mapping[str, str]
    runs: Sequence[Mapping[str, Any]]

    def to_json(self) -> dict[str, Any]:
        """Plain values: what provenance.json holds."""
        text = self.text
        digest = None if text is None else hashlib.sha256(text.encode()).hexdigest()
        as_run = None if self.settings is None else project_text(self.settings)
        return {
            "project": {
                "file": os.path.abspath(self.project),
                "sha256": digest,
                "text": text,
                "as_run": as_run,
            },
            "data": [dict(row) for row in self.data],
            "solver": dict(self.solver),
            "runs": [dict(run) for run in self.runs],
        }

    def after(self, folder: Path) -> Record:
        """The record after the runs that the folder's own has; as it is where that is damaged."""
        try:
            runs = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["runs"]
            before = [dict(run) for run in runs]
        except (OSError, ValueError, KeyError, TypeError):
            return self
        return replace(self, runs=[*before, *self.runs])

    def write(self, folder: Path) -> None:
        """Write provenance.json, and the project as it is run as a file that can be run again.

        Raises
        ------
        OutputError : they cannot be written.
        """
        content = self.to_json()
        if self.settings is not None:
            write_text(folder / AS_RUN, content["project"]["as_run"])
        write_text(folder / PROVENANCE, json.dumps(content, indent=1, ensure_ascii=False) + "\n")

    def tables(self) -> list[Table]:
        """The record for the page: one row a thing, and one a data file."""
        rows: list[list[object]] = [["project file", os.path.abspath(self.project)]]
        for run in self.runs:
            command = run.get("command_line")
            machine = run.get("machine", {})
            rows += [
                ["command", NO_COMMAND if command is None else " ".join(command)],
                ["begun", run.get("date", "")],
                ["machine", ", ".join(f"{value}" for value in machine.values())],
                ["versions", ", ".join(f"{k} {v}" for k, v in run.get("versions", {}).items())],
            ]
        rows.append(["solver", _solver(self.solver)])
        if not self.data:
            rows.append(["data files", NO_FILES])
        note = f"All of it, with the text of the project: {PROVENANCE}."
        if self.settings is not None:
            note += f" The project with the options of the command, to be run again: {AS_RUN}."
        tables = [Table(TITLE, ["", ""], rows, note, text=(1,))]
        if self.data:
            tables.append(_data_table(self.data))
        return tables

    @property
    def files(self) -> list[tuple[str, str]]:
        """What it writes, and what that is."""
        project = [] if self.settings is None else [(AS_RUN, "the project as run, to run again")]
        return [(PROVENANCE, "what these results came from"), *project]


def data_rows(tests: Iterable[tuple[str, object]]) -> list[dict[str, Any]]:
    """Every measured file of tests by name, in order: checksum, what was read, rows and why not.

    Raises
    ------
    InputError : a file is not there any more.
    """
    return [
        {
            "test": name,
            "file": os.path.abspath(file.path),
            "name": file.path.name,
            "sha256": checksum(file.path),
            "format": file.source.format,
            "columns": dict(file.source.columns),
            "units": dict(file.source.units),
            "rows_used": file.used,
            "rows_dropped": dict(file.dropped),
            "notes": list(file.source.notes),
        }
        for name, test in tests
        for file in files_of(test)
    ]


def this_run(command_line: Sequence[str] | None) -> dict[str, Any]:
    """Now, here, with these versions; command_line : None where Python called."""
    return {
        "command_line": None if command_line is None else list(command_line),
        "date": datetime.now().astimezone().isoformat(timespec="seconds"),
        "folder": os.getcwd(),
        "machine": {
            "name": platform.node(),
            "system": platform.platform(),
            "processor": platform.machine(),
        },
        "versions": versions(),
    }


def _solver(facts: Mapping[str, str]) -> str:
    settings = [f"{k} = {v}" for k, v in facts.items() if v and k not in ("name", "version")]
    return "; ".join([facts.get("version") or facts.get("name", ""), *settings])


def _data_table(data: Sequence[Mapping[str, Any]]) -> Table:
    header = ["test", "file", "sha256", "format", "columns", "rows used", "rows dropped"]
    rows: list[list[object]] = [
        [
            row["test"],
            row["name"],
            row["sha256"][:DIGITS],
            row["format"],
            _columns(row["columns"], row["units"]),
            row["rows_used"],
            ", ".join(f"{n} {why}" for why, n in row["rows_dropped"].items()) or "none",
        ]
        for row in data
    ]
    note = f"The first {DIGITS} digits of each sha256; {PROVENANCE} has all, and what was chosen."
    return Table(f"{TITLE}: data files", header, rows, note, text=(1, 2, 3, 4, 6))


def _columns(columns: Mapping[str, str], units: Mapping[str, str]) -> str:
    said = []
    for quantity, name in columns.items():
        unit = f" in {units[quantity]}" if quantity in units else ""
        said.append(f"{quantity}: {name}{unit}")
    return ", ".join(said)
