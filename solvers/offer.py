"""One of our own solvers, as its folder offers it: known before it is imported."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .base import Diagnosis, Solver
from .settings import Override, SolverSettings


@dataclass(frozen=True)
class Offer:
    """A solver by name, made when it is called with its options.

    Parameters
    ----------
    name : what a project file or --solver calls it.
    package : its folder, as a package: the class of the solver is in the module `solver`, and the
        module `diagnosis` has `diagnose(named)`, a list of `Diagnosis` of what there is of it on
        this machine (`named`: a program to look at, or None).
    solver : name of the class.
    settings : what its table in a project may say.
    """

    name: str
    package: str
    solver: str
    settings: type[SolverSettings]

    def __call__(self, **options: Any) -> Solver:
        """A new solver."""
        module = importlib.import_module(f"{self.package}.solver")
        solver: Solver = getattr(module, self.solver)(**options)
        return solver

    @property
    def program(self) -> Override | None:
        """The option that names its program, where it has one."""
        return next((one for one in self.settings.overrides if one.look), None)

    def diagnose(self, named: Path | str | None = None) -> list[Diagnosis]:
        """What there is of it on this machine, each tried on bars."""
        module = importlib.import_module(f"{self.package}.diagnosis")
        diagnose: Callable[[Path | str | None], list[Diagnosis]] = module.diagnose
        return diagnose(named)
