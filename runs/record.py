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
from typing import Any

from ..experiments.kinds import files_of
from ..files import __version__, checksum, write_text
from ..project.project import Project, plain, project_text, settings_of
from ..solvers.base import Solver
from .folder import AS_RUN, PROVENANCE
from .setup import UNCOUNTED, FitSetup

PACKAGES = ("numpy", "scipy", "numba", "nlopt", "quadprog", "meshio")


def versions() -> dict[str, str]:
    """Return the versions of bubblefit, Python and `PACKAGES` by name."""
    of = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"bubblefit": __version__, "python": platform.python_version(), **of}


@dataclass(frozen=True, eq=False)
class Record:
    """The origin of a folder's results.

    project : path of its file. text : of that file. settings : of `settings_of`. data : of
    `data_rows`. runs : of `this_run`, those that were resumed first.
    """

    project: Path
    text: str | None
    settings: Mapping[str, Any] | None
    data: Sequence[Mapping[str, Any]]
    solver: Mapping[str, str]
    runs: Sequence[Mapping[str, Any]]

    def to_json(self) -> dict[str, Any]:
        """Return plain values, as provenance.json holds them."""
        text = self.text
        return {
            "project": {
                "file": os.path.abspath(self.project),
                "sha256": None if text is None else hashlib.sha256(text.encode()).hexdigest(),
                "text": text,
                "as_run": None if self.settings is None else project_text(self.settings),
            },
            "data": [dict(row) for row in self.data],
            "solver": dict(self.solver),
            "runs": [dict(run) for run in self.runs],
        }

    def after(self, folder: Path) -> Record:
        """Return the record after the runs of the folder's own, unless that is damaged."""
        try:
            runs = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))["runs"]
            before = [dict(run) for run in runs]
        except (OSError, ValueError, KeyError, TypeError):
            return self
        return replace(self, runs=[*before, *self.runs])

    def write(self, folder: Path) -> None:
        """Write provenance.json, and the project as run; raises OutputError."""
        content = self.to_json()
        if self.settings is not None:
            write_text(folder / AS_RUN, content["project"]["as_run"])
        write_text(folder / PROVENANCE, json.dumps(content, indent=1, ensure_ascii=False) + "\n")

    @property
    def files(self) -> list[tuple[str, str]]:
        """Return its files and their descriptions."""
        project = [] if self.settings is None else [(AS_RUN, "the project as run, to run again")]
        return [(PROVENANCE, "what these results came from"), *project]


def data_rows(tests: Iterable[tuple[str, object]]) -> list[dict[str, Any]]:
    """Return checksum, format, columns, units and rows of each measured file of tests.

    Raises
    ------
    InputError : a file is gone.
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
    """Return date, machine and versions of now; command_line : None if called from Python."""
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


#: Settings of a test that change no result.
NAMES = ("name", "folder")


def facts_of(setup: FitSetup, solver: Solver, data: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return all that a fit's starts depend on, as `folder.Facts`; data : of `data_rows`."""
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
    """Return a solver's identity in parts: version and element of "ccx 2.20; element=S8R"."""
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
