"""All starts of a fit: each on its mesh, or all on a coarse one and what differs on the full one.

A start takes most of its analyses to come near an optimum, and an optimum of a coarse mesh is near
one of the full mesh. So all starts can run on quads of twice the edge; one start of each distinct
optimum there goes on to the full mesh, from where it ended, and the others take its fit.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from ..identification.problem import FitProblem
from .coarse import coarse_problem
from .distinct import distinct
from .setup import FitSetup
from .start import EvaluationRecord, Stage, StartRecord, run_start
from .workers import Task

Event = EvaluationRecord | StartRecord
Records = Iterator[Event | None]


def every_start(
    setup: FitSetup,
    done: Sequence[StartRecord],
    ran: Callable[[Event | None], None],
    told: Callable[[StartRecord | Stage], None],
) -> list[StartRecord]:
    """How every start of a fit ended, by number.

    Parameters
    ----------
    done : starts that have ended before. ran : is given every record as it ends, None now and then.
    told : is given a stage as it begins, and the records of it that were there before.
    """
    fit, executor = setup.project.fit, setup.project.executor
    full, coarse = (
        {r.number: r for r in done if r.mesh == mesh and r.number < fit.starts}
        for mesh in ("full", "coarse")
    )
    if not fit.coarse_to_fine or coarse_problem(setup) is None:
        for record in full.values():
            told(record)
        missing = [n for n in range(fit.starts) if n not in full]
        full |= _ended(executor.run_starts(setup.problem, setup.options, fit.seed, missing), ran)
        return [full[n] for n in sorted(full)]

    told(Stage("starts on the coarse mesh", fit.starts))
    for record in coarse.values():
        told(record)
    missing = [n for n in range(fit.starts) if n not in coarse]
    build = functools.partial(_coarse_problem, setup)
    coarse |= _ended(executor.run_starts(build, setup.options, fit.seed, missing, "coarse"), ran)

    groups = distinct(setup.problem(), list(coarse.values()), fit.tolerance)
    told(Stage("distinct optima on the full mesh", len(groups)))
    for group in groups:
        if (fitted := _fit_of(group, full)) is not None:
            told(fitted)
    open_groups = [g for g in groups if _fit_of(g, full) is None]
    prepare = functools.partial(_going_on, setup, open_groups)

    def lost(number: int, why: str) -> StartRecord:
        coarse = open_groups[number][-1]
        return replace(coarse, objective=None, status=why, failure=why, mesh="full")

    numbers = range(len(open_groups))
    full |= _ended(executor.run_tasks(prepare, numbers, "optima", lost), ran)
    ended = [record for group in groups for record in one_fit(group, full)]
    return sorted(ended, key=lambda record: record.number)


def _ended(
    records: Iterable[Event | None], ran: Callable[[Event | None], None]
) -> dict[int, StartRecord]:
    ended = {}
    for record in records:
        ran(record)
        if isinstance(record, StartRecord):
            ended[record.number] = record
    return ended


def _coarse_problem(setup: FitSetup) -> FitProblem:
    problem = coarse_problem(setup)
    assert problem is not None  # it was there before
    return problem


def _going_on(setup: FitSetup, groups: Sequence[Sequence[StartRecord]]) -> Task:
    """Fits a group on the full mesh: from its first start's optimum, or the next where that fails.

    A start without an optimum on the coarse mesh begins where it was drawn.
    """
    problem, seed = setup.problem(), setup.project.fit.seed

    def fit(number: int, tell: Callable[[Event], None]) -> StartRecord:
        *others, last = groups[number]
        for coarse in others:
            record = run_start(problem, setup.options, seed, coarse.number, tell, coarse=coarse)
            if record.objective is not None:
                return record
            tell(record)
        return run_start(problem, setup.options, seed, last.number, tell, coarse=last)

    return fit


def _fit_of(group: Sequence[StartRecord], full: Mapping[int, StartRecord]) -> StartRecord | None:
    """The fit on the full mesh that a group has."""
    own = (full[record.number] for record in group if record.number in full)
    return next((record for record in own if record.objective is not None), None)


def one_fit(group: Sequence[StartRecord], full: Mapping[int, StartRecord]) -> Iterator[StartRecord]:
    """Every start of a group, with its fit on the full mesh: its own, or that of the group."""
    fit = _fit_of(group, full)
    for coarse in group:
        own = full.get(coarse.number)
        if own is not None:
            yield own
            continue
        assert fit is not None  # where none has a fit, each was tried
        yield replace(
            fit,
            number=coarse.number,
            seed=coarse.seed,
            status=f"as start {fit.number}",
            analyses=coarse.analyses,
            wall_s=coarse.wall_s,
            external_runs=coarse.external_runs,
            cached_runs=coarse.cached_runs,
            failure="",
            coarse_objective=coarse.objective,
            coarse_analyses=coarse.analyses,
            same_as=fit.number,
        )
