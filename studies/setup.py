"""From the project of any fit to its solver, law and unknowns."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..errors import InputError, SolverFailure
from ..identification.parameters import ModuliParameters
from ..identification.problem import FitProblem
from ..materials.law import HypoelasticLaw
from ..projects.fit import FitProject
from ..solvers.base import DifferentiatingSolver, Solver
from ..solvers.registry import SOLVERS, checked, solver_named, solver_names

#: Leads the fit where the solver that counts gives no derivatives.
SURROGATE = "membrane"


class Settings(Protocol):
    """The part of a project that says what runs it."""

    @property
    def path(self) -> Path:
        """The project's file."""

    @property
    def solver(self) -> str:
        """The solver's name."""

    @property
    def solver_options(self) -> Mapping[str, Mapping[str, Any]]:
        """By name of a solver, what its constructor is given."""


def project_solver(project: Settings, key: str = "fit.solver") -> Solver:
    """A new solver, as the project file or the command line names it, with its options.

    key : where the file names it.

    Raises
    ------
    InputError : there is no such solver (says in which file), or an option is wrong.
    SolverFailure : it is not installed, or does not carry the law.
    """
    return project_solvers(project, 1, key)[0]


def project_solvers(project: Settings, count: int, key: str = "fit.solver") -> list[Solver]:
    """`count` of them, so that each can keep what it prepares for its model; checked once."""
    name = project.solver
    for table in sorted(project.solver_options.keys() - {name}):
        if table not in SOLVERS and table not in (known := solver_names()):
            problem = f"no solver of this name is installed; there are: {', '.join(known)}"
            raise InputError(project.path, f"solver.{table}", problem)
    try:
        solvers = [solver_named(name, **project.solver_options.get(name, {})) for _ in range(count)]
    except InputError as error:
        if error.field == "solver":
            raise InputError(project.path, f"{key} (or --solver)", error.problem) from None
        # Ours may also have their options from the command line.
        if name not in SOLVERS and error.path is None and error.field.startswith(f"solver.{name}"):
            raise InputError(project.path, error.field, error.problem) from None
        raise
    # Once here, in one line, rather than as the failure of every analysis.
    if solvers and solvers[0].external:
        found = checked(name, solvers[0])
        if not (found.available and found.carries_law):
            raise SolverFailure(found.advice or "is not usable", name)
    return solvers


def law_of(project: FitProject) -> HypoelasticLaw:
    """The law that carries all but the coefficients, which are zero."""
    return HypoelasticLaw(
        np.zeros(12),
        project.nu12,
        np.array(project.strain_range),
        project.thickness_change,
        project.breaks,
    )


def parameters_of(project: FitProject, **nuisance: Any) -> ModuliParameters:
    """The unknowns of a fit."""
    return ModuliParameters(
        project.degree,
        project.lower,
        project.upper,
        project.strain_range,
        project.margin_E,
        project.margin_G,
        breaks=project.breaks,
        least=project.least,
        largest=project.largest,
        **nuisance,
    )


def lead(problem: FitProblem) -> None:
    """Give the problem a surrogate where its solver does not differentiate."""
    if not isinstance(problem.solver, DifferentiatingSolver):
        problem.surrogate = problem.led_by([solver_named(SURROGATE) for _ in problem.experiments])
