"""The record of a run, provenance.json: project, data files, command, date, machine, versions."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..experiments.kinds import files_of
from ..files import __version__, checksum, write_text
from ..project.project import Project, plain, project_text, settings_of
from ..solvers.base import Solver
from .folder import AS_RUN, PROVENANCE
from .setup import UNCOUNTED, FitSetup

if TYPE_CHECKING:
    pass

PACKAGES = ("numpy", "scipy", "numba", "nlopt", "quadprog", "meshio")


def versions() -> dict[str, str]:
    """Of what computes, by name."""
    of = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"bubblefit": __version__, "python": platform.python_version(), **of}


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


#: What a test is called and where its files lie changes nothing.
NAMES = ("name", "folder")


def facts_of(setup: FitSetup, solver: Solver, data: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Everything that a fit's starts depend on; see `differences.Facts`.

    data : the data files, as `record.data_rows` has them.
    """
    names = [test.test.name for test in setup.tests]
    files = {
        name: [{k: row[k] for k in ("name", "sha256")} for row in data if row["test"] == name]
        for name in names
    }
    return {
        "version": __version__,
        "solver": solver_facts(setup.project.fit.solver, solver.identity),
        **_said(setup.project, names),
        "files": files,
    }


def solver_facts(name: str, identity: str) -> dict[str, str]:
    """A solver's identity taken apart: "ccx 2.20; element=S8R" is its version and its element."""
    itself, *settings = identity.split("; ")
    pairs = [setting.partition("=")[::2] for setting in settings]
    return {"name": name, "version": itself, **dict(pairs)}


def _said(project: Project, names: list[str]) -> dict[str, Any]:
    written = project.written
    if written is None:  # of no file
        return {"settings": {}, "tests": {name: {} for name in names}}
    whole = settings_of(project, names)
    law = {f"law.{key}": value for key, value in whole["law"].items()}
    fit = {f"fit.{k}": v for k, v in whole["fit"].items() if k not in UNCOUNTED}
    fabric = {f"fabric.{k}": v for k, v in whole["fabric"].items() if k not in NAMES}
    units = {f"units.{key}": value for key, value in whole["units"].items()}
    return {
        "settings": {**fabric, **units, **law, **fit},
        "tests": {name: _without(written.whole[name]) for name in names},
    }


def _without(section: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _without(value) if isinstance(value, Mapping) else plain(value)
        for key, value in section.items()
        if key not in NAMES
    }
