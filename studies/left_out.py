"""Single parts of tests left out of a fit in turn: frames, specimens, directions.

Every fit without a part begins at random starts of its own. From the optimum of the fit to all of
the data a modulus that the rest does not determine would stay where the part itself had put it,
and the part would be foretold by what was taken from it.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..experiments.divisible import Divisible
from ..experiments.fittable import Masks, PreparedTest
from ..experiments.notes import strains_of
from ..fits.best import LEAST_STRAIN
from ..fits.result import Fit
from ..fits.setup import FitSetup
from .folds import fit_of
from .held_out import HeldOut, held_out_part, not_judged

NO_FIT = "no fit without it ended well"


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a test, by the number of the test in a setup; masks : what is kept without it."""

    test: int
    name: str
    masks: Masks

    @property
    def alone(self) -> Masks:
        """The points of the part itself."""
        return {name: ~mask for name, mask in self.masks.items()}


def sorts_of(tests: Sequence[PreparedTest]) -> list[str]:
    """The sorts of parts that these tests have."""
    found = [sort for test in tests if isinstance(test, Divisible) for sort in test.parts]
    return list(dict.fromkeys(found))


def parts_of(setup: FitSetup, sort: str, option: str = "--leave") -> list[Part]:
    """Every part of a sort, test by test.

    option : that asked for them, for the complaint.

    Raises
    ------
    InputError : no test has two or more of them.
    """
    parts = [
        Part(number, name, masks)
        for number, test in enumerate(setup.tests)
        if isinstance(test, Divisible)
        for name, masks in test.parts.get(sort, {}).items()
    ]
    if not parts:
        there = ", ".join(sorts_of(setup.tests)) or "none"
        problem = (
            f"no test has two or more {sort} of which a fit could do without one; what can be "
            f"left out of the tests chosen: {there}, or whole tests"
        )
        raise InputError(setup.project.path, option, problem)
    return parts


def name_of(setup: FitSetup, part: Part) -> str:
    """What a part is called in tables and notes."""
    return f"{setup.tests[part.test].test.name}: {part.name}"


def judged_with(found: Fit, part: Part) -> HeldOut:
    """The fit to all of the data, at a part of them."""
    setup, problem, y = found.setup, found.problem, found.best.point.unknowns
    nuisance = {c.name: problem.unknowns.nuisance_values(c.name, y) for c in problem.comparisons}
    name, law, test = name_of(setup, part), found.card.law, setup.tests[part.test]
    return held_out_part(test, law, setup.make_solver, part.alone, nuisance, name)


def foretold(
    setup: FitSetup, parts: Sequence[Part], numbers: Sequence[int], starts: int
) -> Iterator[tuple[int, HeldOut] | None]:
    """Fit without each part and judge there: its number and how it did; None now and then.

    Parameters
    ----------
    numbers : of the parts that are left out. starts : random starts of each fit.
    """
    prepare = functools.partial(_task, setup, parts, starts)
    return setup.project.executor.run_tasks(prepare, numbers, "parts")


def _task(
    setup: FitSetup, parts: Sequence[Part], starts: int
) -> Callable[[int, Callable[[Any], None]], tuple[int, HeldOut]]:
    return lambda number, tell: (number, without(setup, parts[number], starts))


def without(setup: FitSetup, part: Part, starts: int) -> HeldOut:
    """The best of some starts of a fit that is not given the part, judged at the part."""
    name, test = name_of(setup, part), setup.tests[part.test]
    units = {c: "" for c in part.masks}
    own, unknowns = fit_of(setup, part.masks, starts)
    if unknowns is None:
        return not_judged(name, NO_FIT, units)
    problem = own.problem(part.masks)
    point = problem.evaluate(unknowns, False, warm=False)
    if point is None:
        return not_judged(name, f"{NO_FIT}: {problem.failure}", units)
    reached = np.maximum(np.max([strains_of(h) for h in point.histories], axis=0), LEAST_STRAIN)
    law = problem.unknowns.law(own.law, unknowns)
    # As of a card: known as far as the rest of the data has strained the fabric.
    law = replace(law, strain_range=np.minimum(reached, law.strain_range))
    nuisance = {
        c.name: problem.unknowns.nuisance_values(c.name, unknowns) for c in problem.comparisons
    }
    return held_out_part(test, law, own.make_solver, part.alone, nuisance, name)
