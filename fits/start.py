"""One start of a study: from its number to its optimum, with every evaluation told."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import NoFeasibleStart
from ..identification.feasibility import feasible_start
from ..identification.fit import fit_from
from ..identification.methods import FitOptions
from ..identification.problem import FitProblem


@dataclass(frozen=True)
class EvaluationRecord:
    """One analysis by `solver`, a row of history.csv. `objective` is None when it failed."""

    start: int
    analysis: int
    objective: float | None
    status: str
    coefficients: tuple[float, ...]
    nuisance: tuple[float, ...]
    solver: str = "membrane"


@dataclass(frozen=True)
class StartRecord:
    """How one start ended. `unknowns` are the optimiser's; objective None: there is no fit.

    analyses : in all; external_runs : of them, by an external solver. failure : why the solver
    failed, where that ended it: it is no finished start, and is run again on going on.
    """

    number: int
    seed: tuple[int, int]
    objective: float | None
    status: str
    analyses: int
    unknowns: tuple[float, ...]
    coefficients: tuple[float, ...]
    wall_s: float
    external_runs: int = 0
    failure: str = ""

    def to_json(self) -> dict[str, Any]:
        """Plain values, exact in JSON."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> StartRecord:
        """The inverse of `to_json`; KeyError or TypeError when it is not one."""
        return cls(
            number=int(values["number"]),
            seed=(int(values["seed"][0]), int(values["seed"][1])),
            objective=None if values["objective"] is None else float(values["objective"]),
            status=str(values["status"]),
            analyses=int(values["analyses"]),
            unknowns=tuple(map(float, values["unknowns"])),
            coefficients=tuple(map(float, values["coefficients"])),
            wall_s=float(values["wall_s"]),
            external_runs=int(values.get("external_runs", 0)),
            failure=str(values.get("failure", "")),
        )


def run_start(
    problem: FitProblem,
    options: FitOptions,
    seed: int,
    number: int,
    tell: Callable[[EvaluationRecord], None],
) -> StartRecord:
    """Draw feasible start `number` of study `seed` and fit from it; tell every evaluation."""
    begun = time.perf_counter()
    problem.reset()
    size = problem.unknowns.size

    analyses = runs = 0

    def watch(y: NDArray, value: float | None, status: str, solver: str) -> None:
        nonlocal analyses, runs
        analyses += 1
        runs += problem.solver.external and solver == problem.solver.name
        coefficients = problem.unknowns.to_coefficients @ y[:size]
        tell(
            EvaluationRecord(
                number,
                analyses,
                value,
                status,
                tuple(coefficients.tolist()),
                tuple(np.asarray(y[size:]).tolist()),
                solver,
            )
        )

    watched = [p for p in (problem, problem.surrogate) if p is not None]
    for p in watched:
        p.watch = watch
    try:
        start = feasible_start(problem, seed, number)
        optimum = fit_from(problem, start, options)
        failure = optimum.failure if optimum is not None else _why(watched)
        status = f"{problem.solver.name} failed: {failure}"
    except NoFeasibleStart as error:
        optimum, status, failure = None, str(error), ""
    finally:
        for p in watched:
            p.watch = None
    wall = time.perf_counter() - begun
    if optimum is None:
        none = StartRecord(number, (seed, number), None, status, analyses, (), (), wall, runs)
        return replace(none, failure=failure)
    return StartRecord(
        number,
        (seed, number),
        optimum.value,
        optimum.status,
        analyses,
        tuple(optimum.best.unknowns.tolist()),
        tuple(optimum.coefficients.tolist()),
        wall,
        runs,
        failure,
    )


def _why(problems: Sequence[FitProblem]) -> str:
    """Why nothing came of the first that failed: the solver that counts, else what leads it."""
    return next((p.failure for p in problems if p.failure), "the first analysis failed")
