"""One start of a study: from its number to its optimum, with every evaluation told."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import NoFeasibleStart
from ..experiments.notes import strains_of
from ..identification.feasibility import feasible_start
from ..identification.fit import fit_from
from ..identification.methods import FitOptions
from ..identification.problem import FitProblem

#: On which mesh something ran: on that of the project, or on the coarse one that leads to it.
MeshName = Literal["full", "coarse"]


@dataclass(frozen=True)
class Stage:
    """A stage of a fit begins: what is counted in it, and how many there are."""

    what: str
    total: int


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
    mesh: MeshName = "full"


@dataclass(frozen=True)
class StartRecord:
    """How one start ended. `unknowns` are the optimiser's; objective None: there is no fit.

    analyses : in all; external_runs : of them, run by an external solver; cached_runs : of them, by
    an external solver earlier and taken from the cache of runs. failure : why the solver
    failed, where that ended it: it is no finished start, and is run again on going on. reached :
    largest strain (eps1, eps2, gamma12) at the optimum.

    mesh : that the objective is of. Of a start that ran coarse to fine: coarse_objective, what it
    left on the coarse mesh; coarse_analyses, how many of the analyses ran there; same_as, the start
    with the same optimum there, which alone was fitted on the full mesh and whose fit this is.
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
    reached: tuple[float, ...] = ()
    mesh: MeshName = "full"
    coarse_objective: float | None = None
    coarse_analyses: int = 0
    same_as: int | None = None
    cached_runs: int = 0

    def to_json(self) -> dict[str, Any]:
        """Plain values, exact in JSON."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> StartRecord:
        """The inverse of `to_json`; KeyError or TypeError when it is not one."""
        return cls(
            number=int(values["number"]),
            seed=(int(values["seed"][0]), int(values["seed"][1])),
            objective=_number(values["objective"]),
            status=str(values["status"]),
            analyses=int(values["analyses"]),
            unknowns=tuple(map(float, values["unknowns"])),
            coefficients=tuple(map(float, values["coefficients"])),
            wall_s=float(values["wall_s"]),
            external_runs=int(values.get("external_runs", 0)),
            failure=str(values.get("failure", "")),
            reached=tuple(map(float, values.get("reached", ()))),
            mesh="coarse" if values.get("mesh") == "coarse" else "full",
            coarse_objective=_number(values.get("coarse_objective")),
            coarse_analyses=int(values.get("coarse_analyses", 0)),
            cached_runs=int(values.get("cached_runs", 0)),
        )


def run_start(
    problem: FitProblem,
    options: FitOptions,
    seed: int,
    number: int,
    tell: Callable[[EvaluationRecord], None],
    mesh: MeshName = "full",
    coarse: StartRecord | None = None,
) -> StartRecord:
    """Draw feasible start `number` of study `seed` and fit from it; tell every evaluation.

    mesh : of the problem, for the records. coarse : how the start ended on the coarse mesh: the fit
    begins at its optimum, if it has one, and its analyses are counted on.
    """
    begun = time.perf_counter()
    problem.reset()
    size = problem.unknowns.size
    near = coarse is not None and coarse.objective is not None

    runs = 0
    before = analyses = 0 if coarse is None else coarse.analyses

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
                mesh,
            )
        )

    watched = [p for p in (problem, problem.surrogate) if p is not None]
    for p in watched:
        p.watch = watch
    try:
        if coarse is not None and near:
            start = np.array(coarse.unknowns)
        else:
            start = feasible_start(problem, seed, number)
        optimum = fit_from(problem, start, options, near)
        failure = optimum.failure if optimum is not None else _why(watched)
        status = f"{problem.solver.name} failed: {failure}"
    except NoFeasibleStart as error:
        optimum, status, failure = None, str(error), ""
    finally:
        for p in watched:
            p.watch = None
    cached = problem.cached if problem.solver.external else 0
    wall = time.perf_counter() - begun + (0.0 if coarse is None else coarse.wall_s)
    none = StartRecord(
        number, (seed, number), None, status, analyses, (), (), wall, runs - cached, failure,
        mesh=mesh, coarse_objective=None if coarse is None else coarse.objective,
        coarse_analyses=before, cached_runs=cached,
    )  # fmt: skip
    if optimum is None:
        return none
    return replace(
        none,
        objective=optimum.value,
        status=optimum.status,
        unknowns=tuple(optimum.best.unknowns.tolist()),
        coefficients=tuple(optimum.coefficients.tolist()),
        reached=tuple(np.max([strains_of(h) for h in optimum.best.histories], axis=0).tolist()),
    )


def coarse_columns(record: StartRecord) -> dict[str, Any]:
    """What a table says of a start that ran coarse to fine."""
    names = ("coarse_objective", "coarse_analyses", "same_as")
    return {name: getattr(record, name) for name in names}


def _number(value: Any) -> float | None:
    return None if value is None else float(value)


def _why(problems: Sequence[FitProblem]) -> str:
    """Why nothing came of the first that failed: the solver that counts, else what leads it."""
    return next((p.failure for p in problems if p.failure), "the first analysis failed")
