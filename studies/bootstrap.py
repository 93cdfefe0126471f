"""Bootstrap of a fit: its frames, specimens or tests drawn again and again, and fitted anew."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..errors import InputError
from ..fits.executor import cores
from ..fits.project import Project
from ..fits.store import Store
from ..fits.workers import Task
from ..identification.methods.descent import descend
from ..identification.resampling import Group, Unit, drawn, factors_of, rows_of
from ..identification.weighted import WeightedProblem
from .bootstrap_record import SAMPLES, BootstrapRecord, Sample
from .bootstrapped import Bootstrap
from .left_out import name_of, parts_of
from .refound import Card, Refound, refound
from .validation import TESTS

COUNT = 100
#: Analyses of a refit, at most, beside the optimum's, which none runs again; its first damping.
MOST, DAMPING = 4, 1e-9
#: Predicted decrease of the sum of squares, relative, that is not worth an analysis.
NEGLIGIBLE = 1e-5
#: Told how many of how many samples are done, and of what.
Progress = Callable[[int, int, str], None]


def bootstrap(
    project: Project,
    over: str,
    samples: int = COUNT,
    card: Card = None,
    tests: str | Sequence[str] | None = None,
    *,
    seed: int | None = None,
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Bootstrap:
    """Draw parts of the data with replacement and fit them, again and again.

    Every refit begins at the optimum of the fit that left the card, whose analysis it does not
    repeat, and takes a few of its own. Nothing is read anew: what was drawn twice counts twice.

    Parameters
    ----------
    over : "tests" (among those of their kind), or a sort of parts of the tests: "frames",
        "specimens", "directions", "ratios". samples : how often. card : the one that the project's
        fit left in its usual folder unless given. tests : as for `fit`. seed : of the draws, the
        project's unless given. out : folder in which every sample is kept as it ends; resume :
        go on with what it holds.

    Raises
    ------
    InputError : in the project or its data; nothing of which there are two. OutputError : the
        folder is used or cannot be written. SolverFailure : the tests cannot be run with the card.
    """
    if samples < 2:
        raise InputError(None, "--samples", f"expected two or more, got {samples}")
    project = project.with_fit(seed=seed)
    found = refound(project, card, tests)
    groups = groups_of(found, over)
    folder = None if out is None else Path(out)
    if folder is not None:
        Store(folder).begin({"version": __version__, "over": over}, resume, overwrite, (SAMPLES,))
    record = BootstrapRecord(folder, found, over, resume)
    done = {n: sample for n, sample in record.samples.items() if n < samples}
    tell = progress or (lambda done, total, what: None)
    tell(len(done), samples, "")
    missing = [n for n in range(samples) if n not in done]
    prepare = functools.partial(_task, found, groups, project.fit.seed)
    for sample in project.executor.run_tasks(prepare, missing, "samples"):
        if isinstance(sample, Sample):
            done[sample.number] = sample
            record.write(sample)
        tell(len(done), samples, "")
    # Every process runs the optimum once more.
    before = found.analyses + min(project.fit.jobs or cores(), len(missing))
    return Bootstrap(found, over, groups, [done[n] for n in sorted(done)], before)


def groups_of(found: Refound, over: str) -> list[Group]:
    """The units that are drawn, and among which.

    Raises
    ------
    InputError : there are no two of them.
    """
    return _tests(found) if over == TESTS else _parts(found, over)


def _tests(found: Refound) -> list[Group]:
    """Tests among those of their kind."""
    setup, problem = found.setup, found.problem
    numbers = {c.name: k for k, c in enumerate(problem.comparisons)}
    kinds: dict[str, list[Unit]] = {}
    for test in setup.tests:
        rows = np.zeros(len(problem.blocks.of), dtype=bool)
        for comparison in setup.own(test):
            rows[problem.rows(numbers[comparison.name])] = True
        kinds.setdefault(test.test.kind, []).append(Unit(test.test.name, rows))
    several = [Group(kind, units) for kind, units in kinds.items() if len(units) > 1]
    if not several:
        problem_said = "no kind of which the project has two tests or more"
        raise InputError(setup.project.path, "--over", problem_said)
    return several


def _parts(found: Refound, sort: str) -> list[Group]:
    """Parts of tests: among those of their comparison, whole comparisons among those of the test.

    Specimens are so drawn direction by direction.
    """
    setup, problem = found.setup, found.problem
    grouped: dict[str, list[Unit]] = {}
    for part in parts_of(setup, sort, "--over"):
        alone = {name: mask for name, mask in part.alone.items() if mask.any()}
        shared = [name for name, mask in alone.items() if not mask.all()]
        own = shared[0] if shared else setup.tests[part.test].test.name
        unit = Unit(name_of(setup, part), rows_of(problem, alone))
        grouped.setdefault(own, []).append(unit)
    several = [Group(name, units) for name, units in grouped.items() if len(units) > 1]
    if not several:
        raise InputError(setup.project.path, "--over", f"no test has two {sort} to draw from")
    return several


def _task(found: Refound, groups: Sequence[Group], seed: int) -> Task:
    problem = found.setup.problem()
    # With derivatives, from the unloaded state: every sample starts from here.
    point = problem.evaluate(found.point.unknowns, True, warm=False)
    tolerance = found.setup.project.fit.tolerance

    def sample(number: int, tell: Callable[[Any], None]) -> Sample:
        counts = drawn(groups, np.random.default_rng([seed, number]))
        own = WeightedProblem.of(problem, factors_of(problem, groups, counts))
        assert point is not None  # it ran a moment ago
        best, status = descend(
            own, own.seen(point), tolerance, MOST, norms=True, damping=DAMPING,
            negligible=NEGLIGIBLE,
        )  # fmt: skip
        return Sample(number, counts, best.unknowns.tolist(), own.analyses, status)

    return sample
