"""Profile likelihood of moduli: how far the data let each be from its best, on either side."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..fits.executor import cores
from ..fits.project import Project
from ..fits.setup import FitSetup
from ..fits.workers import Task
from ..identification.bands import bands_of
from ..identification.likelihood import Side, extreme, modulus_row, profile_side
from ..identification.weighted import WeightedProblem
from ..materials.forms.base import COMPONENTS
from .profiled import Profile, Profiles
from .refound import Card, Refound, refound

#: Told how many of how many sides are done, and of the one that takes its next step.
Progress = Callable[[int, int, str], None]
#: Share of the strain reached at which a modulus is profiled unless strains are given.
SHARE = 0.5
#: Downwards and upwards.
SIGNS = (-1.0, 1.0)


def profile(
    project: Project,
    moduli: Mapping[str, Sequence[float]] | None = None,
    card: Card = None,
    tests: str | Sequence[str] | None = None,
    *,
    progress: Progress | None = None,
) -> Profiles:
    """Hold moduli away from their best and fit the others anew, until the data contradict.

    Begins at the optimum of the fit that left the card; every refit begins at its neighbour and
    takes a few analyses.

    Parameters
    ----------
    moduli : strains of each modulus, by name; half of what is reached of all three unless given, or
        where a modulus has no strains. card : the one that the project's fit left in its usual
        folder unless given. tests : as for `fit`. progress : is told of every step.

    Raises
    ------
    InputError : in the project or its data; no such modulus, or a strain beyond the law's.
    SolverFailure : the tests cannot be run with the card.
    """
    asked = _asked(moduli)
    found = refound(project, card, tests)
    places = _places(found, asked)
    numbers = list(range(len(SIGNS) * len(places)))
    prepare = functools.partial(_task, found, places)
    sides: dict[int, Side] = {}
    tell = progress or (lambda done, total, what: None)
    for record in project.executor.run_tasks(prepare, numbers, "profiles"):
        if isinstance(record, tuple):
            sides[record[0]] = record[1]
        now = f"{record[0]} at {record[1]:.3g}" if isinstance(record, list) else ""
        tell(len(sides), len(numbers), now)
    each = tuple(
        _profile(found, name, strain, sides[len(SIGNS) * k], sides[len(SIGNS) * k + 1])
        for k, (name, strain) in enumerate(places)
    )
    # Every process runs the optimum once more.
    analyses = (
        found.analyses
        + min(project.fit.jobs or cores(), len(numbers))
        + sum(p.analyses for p in each)
    )
    return Profiles(
        project.title,
        project.path,
        found.card,
        tuple(t.test.name for t in found.setup.tests),
        each,
        analyses,
        (*found.notes, *(note for one in each for note in one.notes)),
    )


def _asked(moduli: Mapping[str, Sequence[float]] | None) -> dict[str, list[float]]:
    asked = {name: list(strains) for name, strains in (moduli or {}).items()}
    for name, strains in asked.items():
        if name not in COMPONENTS:
            problem = f"expected one of {', '.join(COMPONENTS)}, got {name!r}"
            raise InputError(None, "--modulus", problem)
        for strain in strains:
            if not 0.0 <= strain < np.inf:
                problem = f"expected strains of 0 or more, got {strain:g}"
                raise InputError(None, "--modulus", problem)
    return asked or {name: [] for name in COMPONENTS}


def _places(found: Refound, asked: Mapping[str, Sequence[float]]) -> list[tuple[str, float]]:
    places = []
    for name, strains in asked.items():
        component = COMPONENTS[name]
        reached = float(found.best.valid[component])
        for strain in strains:
            if strain > reached * (1 + 1e-9):
                problem = f"{name} is fitted up to strain {reached:.4g}; got {strain:g}"
                raise InputError(found.setup.project.path, "--modulus", problem)
        places += [(name, strain) for strain in strains or (SHARE * reached,)]
    return places


def _task(found: Refound, places: Sequence[tuple[str, float]]) -> Task:
    # Of the setup, which every process has anew: solvers are no one else's.
    setup: FitSetup = found.setup
    problem = setup.problem()
    point = problem.evaluate(found.point.unknowns, True, warm=False)
    linear = found.linear

    def side(number: int, tell: Callable[[Any], None]) -> tuple[int, Side]:
        (name, strain), sign = places[number // len(SIGNS)], SIGNS[number % len(SIGNS)]
        row = modulus_row(problem.unknowns, name, strain)
        over = linear.spread_over_curvature(row)
        scaled = linear.weights / np.sqrt(over if over > 0 else 1.0)
        own = WeightedProblem.of(problem, scaled)
        assert point is not None  # it ran a moment ago
        sigma = float(np.sqrt(row @ found.posterior.covariance @ row))
        step = functools.partial(tell, [name, strain])
        return number, profile_side(own, own.seen(point), row, sign, sigma, step)

    return side


def _profile(found: Refound, name: str, strain: float, below: Side, above: Side) -> Profile:
    unknowns = found.problem.unknowns
    row = modulus_row(unknowns, name, strain)
    band = bands_of(found.posterior, found.best.law, {name: np.array([strain])})[name][:, 0]
    return Profile(
        name,
        strain,
        float(row @ found.point.unknowns),
        float(np.sqrt(row @ found.posterior.covariance @ row)),
        (float(band[0]), float(band[1])),
        below,
        above,
        (extreme(unknowns, row, -1.0), extreme(unknowns, row, 1.0)),
    )
