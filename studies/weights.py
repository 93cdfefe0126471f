"""What the weight between kinds of test does to a fit: one kind counts a quarter to four times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from .. import __version__
from ..errors import InputError
from ..fits.fit import Event
from ..fits.project import Project
from ..fits.result import Fit
from ..fits.setup import FitSetup
from ..identification.fit import fit_from
from ..identification.problem import FitProblem
from ..materials.forms.base import COMPONENTS
from .folds import errors
from .marked import begin_study
from .stored_fit import stored_fit
from .weighted_fit import PLACES, WeightedFit
from .weights_record import RUNS, WeightsRecord
from .weights_result import WeightStudy

STARTS = 5
#: How many times as much the tests of the kind count, in steps of the square root of two.
COUNTS = tuple(2.0 ** (k / 2) for k in range(-4, 5))
FITTED = "fit"
#: Told the words of what is fitted, then the records of its starts; None now and then.
Progress = Callable[[str | Event | None], None]


def weight_study(
    project: Project,
    counted: str,
    tests: str | Sequence[str] | None = None,
    *,
    starts: int = STARTS,
    counts: Sequence[float] = COUNTS,
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    command_line: Sequence[str] | None = None,
) -> WeightStudy:
    """Fit the tests together, then with other weights of one kind, each from its neighbour.

    Parameters
    ----------
    counted : kind of test whose weight is changed, or the name of a test. tests : as for `fit`.
    starts : of the fit at the project's weights; the others begin at the optimum beside them.
    counts : how many times their weight in the project the tests count.
    out : folder in which every fit is written as it ends.

    Raises
    ------
    InputError : in the project or its data; no test of that kind or name, or no other one.
    OutputError, NoFeasibleStart, SolverFailure : as `bubblefit.fit`.
    """
    tell = progress or (lambda event: None)
    project = project.with_fit(starts=starts)
    chosen = project.chosen(tests, fitted=True)
    names = [test.name for test in chosen if counted in (test.kind, test.name)]
    if not names or len(names) == len(chosen):
        there = ", ".join(dict.fromkeys(name for t in chosen for name in (t.kind, t.name)))
        problem = (
            f"expected a kind or a name of some of the tests that are fitted, not of all: {there}; "
            f"got {counted!r}"
        )
        raise InputError(project.path, "--weights", problem)
    folder = None if out is None else Path(out)
    if folder is not None:
        of = {"version": __version__, "counted": ", ".join(names)}
        begin_study(folder, of, resume, overwrite, [FITTED], [RUNS])
    tell("the fit at the project's weights")
    found = stored_fit(
        project,
        [test.name for test in chosen],
        None if folder is None else folder / FITTED,
        resume=resume,
        overwrite=overwrite,
        progress=tell,
        command_line=command_line,
    )
    record = WeightsRecord(folder, found, names, resume)
    runs = sorted(_runs(found, names, sorted(counts), record, tell), key=lambda run: run.count)
    return WeightStudy(project.title, counted, tuple(names), found, tuple(runs))


def _runs(
    found: Fit,
    names: Sequence[str],
    counts: Sequence[float],
    record: WeightsRecord,
    tell: Progress,
) -> Iterator[WeightedFit]:
    """At the project's weights, then upwards from there, then downwards."""
    own = found.best.point
    yield _weighted(found.setup, found, 1.0, found.problem, own.residual, own.unknowns, 0)
    above = [c for c in counts if c > 1]
    below = [c for c in reversed(counts) if c < 1]
    for way in (above, below):
        y = np.array(own.unknowns)
        for count in way:
            run = record.read(count)
            if run is None:
                tell(f"weight times {count:.3g}")
                run = refitted(found, names, count, y)
                record.write(run)
            yield run
            if not run.failure:
                y = np.array(run.unknowns)


def refitted(found: Fit, names: Sequence[str], count: float, y: np.ndarray) -> WeightedFit:
    """The fit with tests that count so many times, from the unknowns y of a neighbour."""
    setup = replace(found.setup, counts=dict.fromkeys(names, count))
    problem = setup.problem()
    optimum = fit_from(problem, y, setup.options, near=True)
    if optimum is None:
        return WeightedFit(count, {}, {}, {}, (), problem.analyses, problem.failure or "no fit")
    best = optimum.best
    return _weighted(setup, found, count, problem, best.residual, best.unknowns, optimum.analyses)


def _weighted(
    setup: FitSetup,
    found: Fit,
    count: float,
    problem: FitProblem,
    residual: np.ndarray,
    unknowns: np.ndarray,
    analyses: int,
) -> WeightedFit:
    law = problem.unknowns.law(found.law, unknowns)
    moduli = {
        name: law.modulus(name, np.array(PLACES) * found.best.valid[component]).tolist()
        for name, component in COMPONENTS.items()
    }
    relative = {}
    norms, block = problem.blocks.norms(residual), 0
    number = {c.name: len(c.objective.sizes) for c in problem.comparisons}
    for test, weighting in zip(setup.tests, setup.weightings, strict=True):
        blocks = sum(number[c.name] for c in setup.own(test))
        relative[test.test.name] = float(norms[block : block + blocks].sum() / weighting.weight)
        block += blocks
    rms = errors(problem, residual)
    return WeightedFit(count, relative, rms, moduli, unknowns.tolist(), analyses)
