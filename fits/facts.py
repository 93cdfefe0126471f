"""What the results of a fit depend on, in plain values that can be told apart in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .. import __version__
from ..solvers.base import Solver
from .project import Project
from .setup import UNCOUNTED, FitSetup
from .written import plain, settings_of

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
