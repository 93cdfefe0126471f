"""Compute profile-likelihood intervals of moduli."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, Note, NoteKind, apart, check_one_of, checked, rows
from ..errors import lines as note_lines
from ..files import pandas as pd
from ..inference.likelihood import (
    BOUND,
    FAILED,
    THRESHOLD,
    Side,
    profile_side,
)
from ..inference.problem import WeightedProblem
from ..inference.reported import LEVEL, ReportedModulus
from ..materials.forms.base import COMPONENTS
from ..project.project import Project
from .best import NOT_THE_CARD, Card, Optimum, find_optimum
from .executor import Task, cores, executor_of
from .folder import Presented, check_unused, finished
from .in_use import alone_in_folder
from .progress import Listener, listener
from .setup import FitSetup

NOT_CLOSED = NoteKind("profile not closed")
#: Ratio of the distances of the ends from the best beyond which an interval is asymmetric.
ASYMMETRIC = 1.3
#: -2 log L below the best from which another optimum is better.
BETTER = -0.5
#: Share of the strain reached at which a modulus is profiled unless strains are given.
SHARE = 0.5
#: Downwards and upwards.
SIGNS = (-1.0, 1.0)
METHOD = (
    "The modulus is held at values ever farther from its best and everything else is fitted anew, "
    "within the bounds of the fit; -2 log L is what the fit's own weighted sum of squares grows "
    "by, scaled so that where nothing is curved it passes the threshold 1.96 of the linear "
    "standard deviations away (noise alone, neighbouring values that err as one counted as one, no "
    "bounds, no error of the mesh). Moduli are those of the reported law: where the fit took the "
    "error of the mesh out, it is out by as much as at the optimum."
)


@dataclass(frozen=True, eq=False)
class Profile:
    """The profile of one modulus at one strain, MPa.

    Attributes
    ----------
    modulus, strain
    reported : ReportedModulus
        What the fit says of it, at this strain.
    below, above : Side
        The profile to either side.
    allowed : pair of float
        Range within the bounds of the fit.
    """

    modulus: str
    strain: float
    reported: ReportedModulus
    below: Side
    above: Side
    allowed: tuple[float, float]

    @property
    def name(self) -> str:
        return f"{self.modulus} at {100 * self.strain:.4g} % of strain"

    @property
    def best(self) -> float:
        """Return the modulus of the fit."""
        return float(self.reported.value[0])

    @property
    def sigma(self) -> float:
        """Return one standard deviation of the fit, MPa."""
        return float(self.reported.sigma[0]) * self.best

    @property
    def band(self) -> tuple[float, float]:
        """Return the band of the fit."""
        return float(self.reported.lower[0]), float(self.reported.upper[0])

    @property
    def ends(self) -> tuple[float | None, float | None]:
        """Return the ends of the interval; None where the threshold is not passed."""
        return self.below.end, self.above.end

    @property
    def analyses(self) -> int:
        return self.below.analyses + self.above.analyses

    @property
    def asymmetry(self) -> float | None:
        """Return the distance of the upper end over that of the lower one, or None without both."""
        low, high = self.ends
        if low is None or high is None or not low < self.best < high:
            return None
        return (high - self.best) / (self.best - low)

    @property
    def curve(self) -> tuple[list[float], list[float]]:
        """Return moduli (MPa), rising, and -2 log L there."""
        values = [*self.below.values[:0:-1], *self.above.values]
        return values, [*self.below.ratios[:0:-1], *self.above.ratios]

    @property
    def words(self) -> str:
        low, high = map(_end, self.ends, (self.below, self.above), self.allowed)
        said = (
            f"{self.best:.4g} MPa, {100 * LEVEL:.0f} % from {low} to {high} "
            f"(the fit's band {self.band[0]:.4g} to {self.band[1]:.4g})"
        )
        skew = self.asymmetry
        if skew is not None and not 1 / ASYMMETRIC <= skew <= ASYMMETRIC:
            low_end, high_end = self.ends
            assert low_end is not None and high_end is not None
            said += (
                f"; asymmetric: {self.best - low_end:.3g} below, {high_end - self.best:.3g} above"
            )
        return said

    @property
    def open_sides(self) -> dict[str, Side]:
        """Return the sides without an end."""
        return {k: one for k, one in (("below", self.below), ("above", self.above)) if one.why}

    @property
    def notes(self) -> list[Note]:
        """Return notes on sides without an end, or on a better optimum."""
        notes = []
        for word, side in self.open_sides.items():
            ratio = f"{round(side.ratios[-1], 3) + 0.0:.2g} of {THRESHOLD:.3g}"
            limit = self.allowed[word == "above"]
            words = f"not closed {word}: {_why(side, limit)}; -2 log L is {ratio} there"
            notes.append(Note(NOT_CLOSED, words, self.name))
        if min(*self.below.ratios, *self.above.ratios) < BETTER:
            words = "another optimum fits the data better than the card's: fit with more starts"
            notes.append(Note(NOT_THE_CARD, words, self.name))
        return notes

    @property
    def numbers(self) -> dict[str, Any]:
        values, ratios = self.curve
        return {
            "modulus": self.modulus,
            "strain": self.strain,
            "MPa": self.best,
            "lower_MPa": self.ends[0],
            "upper_MPa": self.ends[1],
            "fit_sigma_MPa": self.sigma,
            "fit_lower_MPa": self.band[0],
            "fit_upper_MPa": self.band[1],
            "asymmetry": self.asymmetry,
            "not_closed": {word: side.why for word, side in self.open_sides.items()},
            "curve_MPa": values,
            "curve_minus_2_log_L": ratios,
            "analyses": self.analyses,
        }


def _why(side: Side, limit: float) -> str:
    if side.why == BOUND:
        return f"it meets the bound of the fit, {limit:.4g} MPa"
    at = f"{side.values[-1]:.4g} MPa"
    if side.why == FAILED:
        return f"beyond {at} no analysis ends well"
    return f"the last step ends at {at}"


def _end(end: float | None, side: Side, limit: float) -> str:
    if end is not None:
        return f"{end:.4g}"
    if side.why == BOUND:
        return f"the bound, {limit:.4g},"
    return f"beyond {side.values[-1]:.4g}"


@dataclass(frozen=True, eq=False)
class Profiles(Presented):
    """Profiles of moduli. card : its name. analyses : in all, those of the optimum included."""

    project: Project
    card: str
    tests: Sequence[str]
    each: Sequence[Profile]
    analyses: int
    notes: Sequence[Note] = ()

    def table(self) -> pd.DataFrame:
        """Return a row a value held; by_sigma : -2 log L by the 1 sigma of the fit."""
        found = []
        for one in self.each:
            values, ratios = (np.array(v) for v in one.curve)
            found.append(
                pd.DataFrame(
                    {
                        "modulus": one.modulus,
                        "strain": one.strain,
                        "MPa": values,
                        "minus_2_log_L": ratios,
                        "by_sigma": ((values - one.best) / one.sigma) ** 2,
                    }
                )
            )
        return pd.concat(found, ignore_index=True)

    @property
    def result(self) -> dict[str, Any]:
        return {
            "command": "profile",
            "title": self.project.title,
            "project": str(self.project.path),
            "card": self.card,
            "tests": list(self.tests),
            "level": LEVEL,
            "threshold": THRESHOLD,
            "profiles": [one.numbers for one in self.each],
            "analyses": self.analyses,
            "method": METHOD,
            "notes": rows(self.notes),
        }

    def lines(self) -> list[str]:
        lines = [f"{one.name}: {one.words}" for one in self.each]
        return [*lines, f"{self.analyses} analyses", *note_lines(self.notes)]


@checked
@alone_in_folder
def profile(
    project: Project,
    moduli: Mapping[str, Sequence[float]] | None = None,
    card: Card = None,
    tests: str | Sequence[str] | None = None,
    *,
    out: Path | str | None = None,
    overwrite: bool = False,
    progress: Listener = None,
) -> Profiles:
    """Hold moduli away from their best and refit everything else, until the data contradict.
    Begins at the optimum of the fit that wrote the card; every refit begins at its neighbour.
    moduli : strains of each modulus, by name; half of what is reached of all three unless given, or
    where a modulus has no strains. card : itself, its file or its name in the project; the one that
    the project's fit left in its usual folder unless given. tests, progress : as of `fit`. out :
    folder of the study. InputError : in the project or its data; no such modulus, or a strain
    beyond the law's. OutputError : the folder is used. SolverFailure : the tests cannot be run with
    the card."""
    check_unused(out, False, overwrite)
    asked = {name: list(strains) for name, strains in (moduli or {}).items()}
    for name, strains in asked.items():
        check_one_of(name, COMPONENTS, "--modulus")
        for strain in strains:
            if not 0.0 <= strain < np.inf:
                problem = f"expected strains of 0 or more, got {strain:g}"
                raise InputError(None, "--modulus", problem)
    asked = asked or {name: [] for name in COMPONENTS}
    found = find_optimum(project, card, tests)
    places = []
    for modulus, strains in asked.items():
        component = COMPONENTS[modulus]
        reached = float(found.best.valid[component])
        for at in strains:
            if at > reached * (1 + 1e-9):
                end, given = apart(reached, at, 4)
                problem = f"{modulus} is fitted up to a strain of {end}; got {given}"
                raise InputError(found.setup.project.path, "--modulus", problem)
        places += [(modulus, at) for at in strains or (SHARE * reached,)]
    numbers = list(range(len(SIGNS) * len(places)))
    prepare = functools.partial(_task, found, places)
    sides: dict[int, Side] = {}
    tell = listener(progress)
    for record in executor_of(project).run_tasks(prepare, numbers, "profiles"):
        if isinstance(record, tuple):
            sides[record[0]] = record[1]
        now = f"{record[0]} at {record[1]:.3g}" if isinstance(record, list) else ""
        tell(len(sides), len(numbers), now)
    each = [
        _profile_of(found, name, strain, sides[len(SIGNS) * k], sides[len(SIGNS) * k + 1])
        for k, (name, strain) in enumerate(places)
    ]
    # Every process runs the optimum once more.
    analyses = found.analyses + min(project.fit.jobs or cores(), len(numbers))
    analyses += sum(p.analyses for p in each)
    tested = tuple(t.test.name for t in found.setup.tests)
    notes = [*found.notes]
    notes += [note for one in each for note in one.notes]
    done = Profiles(project, found.card, tested, each, analyses, tuple(notes))
    return finished(done, out)


def _profile_of(found: Optimum, name: str, strain: float, below: Side, above: Side) -> Profile:
    """Return a profile of the reported law, of sides on the mesh of the fit."""
    unknowns = found.problem.unknowns
    row = unknowns.modulus_row(name, strain)
    reported = found.sure.at(found.best.law, name, np.array([strain]))
    mesh_correction = float(reported.value[0] - row @ found.point.unknowns)

    def shifted(side: Side) -> Side:
        return replace(side, values=tuple(value + mesh_correction for value in side.values))

    allowed = unknowns.modulus_range(name, strain)
    return Profile(name, strain, reported, shifted(below), shifted(above), allowed)


def _task(found: Optimum, places: Sequence[tuple[str, float]]) -> Task:
    # Of the setup, which every process has anew: solvers are no one else's.
    setup: FitSetup = found.setup
    problem = setup.problem()
    point = problem.evaluate(found.point.unknowns, True, warm=False)
    linear = found.linear

    def side(number: int, tell: Callable[[Any], None]) -> tuple[int, Side]:
        (name, strain), sign = places[number // len(SIGNS)], SIGNS[number % len(SIGNS)]
        row = problem.unknowns.modulus_row(name, strain)
        over = linear.spread_over_curvature(row)
        scaled = linear.weights / np.sqrt(over if over > 0 else 1.0)
        own = WeightedProblem.of(problem, scaled)
        assert point is not None  # it ran a moment ago
        sigma = float(np.sqrt(row @ found.posterior.covariance @ row))
        step = functools.partial(tell, [name, strain])
        return number, profile_side(own, own.seen(point), row, sign, sigma, step)

    return side
