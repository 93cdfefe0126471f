"""Profile-likelihood intervals of moduli and parameters: one is held, all else is refitted."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..arguments import checked_arguments
from ..errors import InputError, check_one_of
from ..inference.likelihood import BOUND, FAILED, THRESHOLD, ProfileSide, profile_side
from ..inference.nuisance_fit import verdicts
from ..inference.problem import WeightedProblem
from ..inference.reported import LEVEL
from ..inference.unknowns import Unknowns
from ..lazy_modules import pandas as pd
from ..materials.forms.base import COMPONENTS, Array
from ..materials.forms.symmetry import modulus_labels
from ..notes import Note, NoteKind, State, Verdict
from ..processes import cores
from ..project.project import Project
from ..wording import distinct_numbers
from .executor import executor_of
from .folder import Presented, check_unused, finished
from .in_use import alone_in_folder
from .optimum import NOT_THE_CARD, Card, CardOptimum, find_optimum
from .progress import Listener, listener
from .simulation import check_has_law

NOT_CLOSED = NoteKind("profile not closed")
#: Signs of the two sides of a profile, downwards and upwards, in the order of their tasks.
SIGNS = (-1.0, 1.0)
METHOD = (
    "The modulus or parameter is held at values ever farther from its best and everything else is "
    "fitted anew, within the bounds of the fit; -2 log L is what the fit's own weighted sum of "
    "squares grows by, scaled so that where nothing is curved it passes the threshold 1.96 of the "
    "linear standard deviations away (noise alone, neighbouring values that err as one counted as "
    "one, no bounds, no error of the mesh). Moduli are those of the reported law: where the fit "
    "took the error of the mesh out, it is out by as much as at the optimum."
)


class Target(NamedTuple):
    """A modulus and the strain at which it is profiled; or a parameter, its unit, and no strain."""

    name: str
    strain: float | None = None
    unit: str = "MPa"
    label: str = ""  # of a modulus: "E" for the E1 of an isotropic law

    @property
    def words(self) -> str:
        """Return the modulus with its strain, or the parameter."""
        if self.strain is None:
            return self.name
        return f"{self.label} at {100 * self.strain:.4g} % of strain"

    def number(self, value: float) -> str:
        """Return a value with its unit."""
        return f"{value:.4g} {self.unit}".rstrip()

    def columns(self, value: Any) -> dict[str, Any]:
        """Return what is profiled, and a value or values of it, by column or key."""
        if self.strain is None:
            return {"parameter": self.name, "unit": self.unit, "value": value}
        return {"modulus": self.label, "strain": self.strain, "MPa": value}

    def row(self, unknowns: Unknowns) -> Array:
        """Return the row (count,) whose product with the unknowns is the value."""
        if self.strain is not None:
            return unknowns.modulus_row(self.name, self.strain)
        position = unknowns.size + unknowns.nuisance.names.index(self.name)
        return np.eye(unknowns.count)[position]


@dataclass(frozen=True, eq=False)
class Profile:
    """Hold the profile of one modulus at one strain, or of one parameter.

    Attributes
    ----------
    target : Target
    best, sigma : float
        Value of the fit and its standard deviation, in the unit of the target.
    band : (lower, upper)
        Ends of the 95 % band of the fit.
    lower_side, upper_side : ProfileSide
        The profile downwards and upwards from the value of the fit.
    allowed : (lower, upper)
        Range within the bounds of the fit.
    """

    target: Target
    best: float
    sigma: float
    band: tuple[float, float]
    lower_side: ProfileSide
    upper_side: ProfileSide
    allowed: tuple[float, float]

    @property
    def name(self) -> str:
        """Return the modulus and its strain, or the parameter, in words."""
        return self.target.words

    @property
    def modulus(self) -> str:
        """Return the name of the modulus, or of the parameter."""
        return self.target.name

    @property
    def strain(self) -> float | None:
        """Return the log strain of the modulus; None of a parameter."""
        return self.target.strain

    @property
    def ends(self) -> tuple[float | None, float | None]:
        """Return the ends of the interval; None where the threshold is not passed."""
        return self.lower_side.end, self.upper_side.end

    @property
    def analyses(self) -> int:
        """Return the number of analyses of both sides."""
        return self.lower_side.analyses + self.upper_side.analyses

    @property
    def asymmetry(self) -> float | None:
        """Return the ratio of the distances from the fit to upper and lower end; None if open."""
        low, high = self.ends
        if low is None or high is None or not low < self.best < high:
            return None
        return (high - self.best) / (self.best - low)

    @property
    def curve(self) -> tuple[list[float], list[float]]:
        """Return rising values at which it was held, and -2 log of the likelihood ratio there."""
        # Both sides begin at the fit's value, of which the lower one's, then its last, is left out.
        values = [*self.lower_side.values[:0:-1], *self.upper_side.values]
        return values, [*self.lower_side.ratios[:0:-1], *self.upper_side.ratios]

    @property
    def words(self) -> str:
        """Return the interval in words, beside the band of the fit."""
        low, high = self.ends
        words = (
            f"{self.target.number(self.best)}, {100 * LEVEL:.0f} % from "
            f"{_end_words(low, self.lower_side, self.allowed[0])} to "
            f"{_end_words(high, self.upper_side, self.allowed[1])} "
            f"(the fit's band {self.band[0]:.4g} to {self.band[1]:.4g})"
        )
        if low is None or high is None or self.asymmetry is None:
            return words
        if max(self.asymmetry, 1 / self.asymmetry) > 1.3:
            words += f"; asymmetric: {self.best - low:.3g} below, {high - self.best:.3g} above"
        return words

    @property
    def interval(self) -> str:
        """Return the ends of a closed interval in a few words."""
        ends = f"{self.ends[0]:.4g} to {self.target.number(self.ends[1] or 0.0)}"
        return f"{self.name} is {ends} ({100 * LEVEL:.0f} %)"

    @property
    def open_sides(self) -> dict[str, tuple[ProfileSide, float]]:
        """Return the sides on which the interval has no end, and the bound of the fit there.

        By "below" and "above".
        """
        low, high = self.allowed
        sides = {"below": (self.lower_side, low), "above": (self.upper_side, high)}
        return {word: (side, limit) for word, (side, limit) in sides.items() if side.reason}

    @property
    def open_words(self) -> str:
        """Return why the interval has no end on its open sides; "" if it has both ends."""
        sides = self.open_sides.items()
        return "; ".join(f"{word}: {_reason(self.target, *side)}" for word, side in sides)

    @property
    def notes(self) -> list[Note]:
        """Return notes on sides without an end, or on a better optimum."""
        notes = []
        for word, (side, limit) in self.open_sides.items():
            ratio = f"{round(side.ratios[-1], 3) + 0.0:.2g} of {THRESHOLD:.3g}"
            words = (
                f"not closed {word}: {_reason(self.target, side, limit)}; -2 log L is {ratio} there"
            )
            notes.append(Note(NOT_CLOSED, words, self.name))
        # A smaller gain is the same optimum: its descent ended a little earlier.
        if min(*self.lower_side.ratios, *self.upper_side.ratios) < -0.5:
            words = "another optimum fits the data better than the card's: fit with more starts"
            notes.append(Note(NOT_THE_CARD, words, self.name))
        return notes

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the profile as plain values, as in result.json."""
        values, ratios = self.curve
        lower, upper = self.ends
        unit = "" if self.target.strain is None else "_MPa"
        return {
            **self.target.columns(self.best),
            f"lower{unit}": lower,
            f"upper{unit}": upper,
            f"fit_sigma{unit}": self.sigma,
            f"fit_lower{unit}": self.band[0],
            f"fit_upper{unit}": self.band[1],
            "asymmetry": self.asymmetry,
            "not_closed": {word: side.reason for word, (side, _) in self.open_sides.items()},
            f"curve{unit}": values,
            "curve_minus_2_log_L": ratios,
            "analyses": self.analyses,
        }


def _reason(target: Target, side: ProfileSide, limit: float) -> str:
    """Return why a side has no end; `limit` is the bound of the fit on that side."""
    if side.reason == BOUND:
        return f"it meets the bound of the fit, {target.number(limit)}"
    last_value = target.number(side.values[-1])
    if side.reason == FAILED:
        return f"beyond {last_value} no analysis ends well"
    return f"the last step ends at {last_value}"


def _end_words(end: float | None, side: ProfileSide, limit: float) -> str:
    """Return the end of an interval in words, or why there is none; `limit` as in `_reason`."""
    if end is not None:
        return f"{end:.4g}"
    if side.reason == BOUND:
        return f"the bound, {limit:.4g},"
    return f"beyond {side.values[-1]:.4g}"


@dataclass(frozen=True, eq=False)
class Profiles(Presented):
    """Hold the profiles of moduli and parameters.

    Attributes
    ----------
    project : Project
    card : str
        Name of the card.
    tests : sequence of str
        Names of the tests that are fitted.
    profiles : sequence of Profile
    analyses : int
        Number of analyses of all profiles, and of finding the optimum.
    fit_verdict : Verdict
        The verdict of the fit.
    notes : sequence of Note
    """

    project: Project
    card: str
    tests: Sequence[str]
    profiles: Sequence[Profile]
    analyses: int
    fit_verdict: Verdict
    notes: Sequence[Note] = ()

    def table(self) -> pd.DataFrame:
        """Return the profiles point by point.

        Returns
        -------
        DataFrame
            One row per value at which a modulus is held: `modulus`, `strain`, the value `MPa`,
            `minus_2_log_L` (-2 log of the likelihood relative to the optimum), and `by_sigma`, what
            a normal distribution with the standard deviation of the fit gives for it. Rows of
            parameters have `parameter`, `value` and `unit` instead of the first three.
        """
        tables = []
        for item in self.profiles:
            values, ratios = (np.array(column) for column in item.curve)
            deviation = (values - item.best) / item.sigma
            columns = {"minus_2_log_L": ratios, "by_sigma": deviation**2}
            tables.append(pd.DataFrame({**item.target.columns(values), **columns}))
        return pd.concat(tables, ignore_index=True)

    @property
    def verdict(self) -> Verdict:
        """Return the intervals that have two ends, and what has none."""
        intervals = [item.interval for item in self.profiles if not item.open_sides]
        unclosed = [item.name for item in self.profiles if item.open_sides]
        doubts = tuple(note.line for note in self.notes if note.kind is NOT_THE_CARD)
        unknown = ", ".join(unclosed)
        step = ""
        if unclosed:
            step = (
                "let bubblefit plan rank the tests that would narrow the intervals without an end"
            )
        if doubts:
            step = "fit again with more starts"
        if not intervals:
            words = "no interval has two ends"
            verdict = Verdict("not to be used", words, doubts, unknown, step)
        else:
            state: State = "usable within limits" if step else "usable"
            verdict = Verdict(state, ", ".join(intervals), doubts, unknown, step)
        return verdict.of_study(self.fit_verdict)

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the study."""
        return {
            "command": "profile",
            "title": self.project.title,
            "project": str(self.project.path),
            "card": self.card,
            "tests": self.tests,
            "level": LEVEL,
            "threshold": THRESHOLD,
            "profiles": [item.numbers for item in self.profiles],
            "analyses": self.analyses,
            "method": METHOD,
        }

    def result_lines(self) -> list[str]:
        """Return the results of the study as lines of the terminal."""
        lines = [f"{item.name}: {item.words}" for item in self.profiles]
        return [*lines, f"{self.analyses} analyses"]


@checked_arguments
@alone_in_folder
def profile(
    project: Project,
    moduli: Mapping[str, Sequence[float]] | None = None,
    card: Card = None,
    tests: str | Sequence[str] | None = None,
    *,
    parameters: Sequence[str] = (),
    out: Path | str | None = None,
    overwrite: bool = False,
    progress: Listener = None,
) -> Profiles:
    """Compute profile-likelihood intervals: hold moduli off their optimum and refit all else.

    A modulus at one strain, or a parameter of a deck, is moved in steps, down and up, until -2 log
    of the likelihood ratio passes the threshold of the interval. The profile begins at the optimum
    of the fit that wrote the card; every refit begins at the one before.

    Parameters
    ----------
    project : Project
    moduli : mapping of str to sequence of float, optional
        Logarithmic strains at which to profile, by modulus ("E1", "E2", "G12"). A modulus with
        no strains is profiled at half of the strain that the tests reached; by default all three,
        and all parameters of decks.
    card : MaterialCard, path or str, optional
        The card of the fit, the path of its file or its name in the project; by default the card
        that the project's fit left in its usual folder.
    tests : str or sequence of str, optional
        Names of tests, or a kind of test; by default all that can be fitted.
    parameters : sequence of str
        Names of parameters of decks, or of other unknowns beside the moduli.
    out : path, optional
        Folder of the study.
    overwrite : bool
        Whether a result in that folder is replaced.
    progress : callable or bool, optional
        Receives the number of sides done, the number of all, and the modulus under way; True,
        False and None as in `fit`.

    Returns
    -------
    Profiles

    Raises
    ------
    InputError
        The project or its data have an error, there is no such modulus, a strain is beyond that
        which the tests reached, or the card is not one of this project's fit.
    OutputError
        The folder already holds a result.
    SolverFailure
        The tests cannot be run with the card.
    """
    check_unused(out, False, overwrite)
    requested = _requested_strains(moduli)
    if requested:
        check_has_law(project)
    optimum = find_optimum(project, card, tests)
    takes_usual = not requested and not parameters
    if takes_usual and project.has_law:
        requested = {name: [] for name in modulus_labels(optimum.best.law.form)}
    targets = _targets(optimum, requested) + _parameter_targets(optimum, parameters, takes_usual)
    sides = _run_sides(project, optimum, targets, listener(progress))
    profiles = [
        _profile_of(optimum, target, lower_side, upper_side)
        for target, lower_side, upper_side in zip(targets, sides[::2], sides[1::2], strict=True)
    ]
    # Each process has run the analysis at the optimum once more.
    analyses = optimum.analyses + min(project.fit.jobs or cores(), len(sides))
    analyses += sum(item.analyses for item in profiles)
    notes = [*optimum.notes]
    for item in profiles:
        notes += item.notes
    names = optimum.setup.test_names
    result = Profiles(project, optimum.card, names, profiles, analyses, optimum.fit_verdict, notes)
    return finished(result, out)


def _requested_strains(moduli: Mapping[str, Sequence[float]] | None) -> dict[str, list[float]]:
    """Return the strains by modulus; raise InputError if one is invalid."""
    requested = {name: list(strains) for name, strains in (moduli or {}).items()}
    for name, strains in requested.items():
        check_one_of(name, COMPONENTS, "--modulus")
        for strain in strains:
            if not 0.0 <= strain < np.inf:
                problem = f"expected strains of 0 or more, got {strain:g}"
                raise InputError(None, "--modulus", problem)
    return requested


def _targets(optimum: CardOptimum, requested: Mapping[str, Sequence[float]]) -> list[Target]:
    """Return moduli with strains to profile; raise InputError beyond the strains reached."""
    targets = []
    for modulus, strains in requested.items():
        reached = optimum.best.valid[COMPONENTS[modulus]]
        for strain in strains:
            if strain > reached * (1 + 1e-9):
                end, requested_strain = distinct_numbers(100 * reached, 100 * strain, 4)
                problem = (
                    f"{modulus} is fitted up to {end} % of strain ({reached:.4g}); "
                    f"got {requested_strain} %"
                )
                raise InputError(optimum.setup.project.path, "--modulus", problem)
        label = modulus_labels(optimum.best.law.form).get(modulus, modulus)
        targets += [Target(modulus, s, label=label) for s in strains or (0.5 * reached,)]
    return targets


def _parameter_targets(
    optimum: CardOptimum, parameters: Sequence[str], takes_usual: bool
) -> list[Target]:
    """Return the parameters to profile, or the usual ones, those of decks; InputError."""
    nuisance = optimum.problem.unknowns.nuisance
    units = {name: item.unit for name, item in zip(nuisance.names, nuisance.all, strict=True)}
    if takes_usual:
        parameters = [item.name for item in nuisance.all if item.drawn]
    for name in parameters:
        check_one_of(name, units, "--parameter")
    return [Target(name, None, units[name]) for name in parameters]


def _run_sides(
    project: Project,
    optimum: CardOptimum,
    targets: Sequence[Target],
    on_event: Callable[[int, int, str], None],
) -> list[ProfileSide]:
    """Compute both sides of every profile on the mesh of the fit: lower, upper, lower, ..."""
    numbers = list(range(len(SIGNS) * len(targets)))
    prepare = functools.partial(SideTask, optimum, targets)
    sides: dict[int, ProfileSide] = {}
    for record in executor_of(project).run_tasks(prepare, numbers, "profiles"):
        words = ""
        if isinstance(record, Target):
            words = record.words
        elif record is not None:
            number, side = record
            sides[number] = side
        on_event(len(sides), len(numbers), words)
    return [sides[number] for number in numbers]


def _profile_of(
    optimum: CardOptimum, target: Target, lower_side: ProfileSide, upper_side: ProfileSide
) -> Profile:
    """Return the profile, shifted by the mesh error that the reported law has taken out."""
    unknowns = optimum.problem.unknowns
    row = target.row(unknowns)
    best, sigma, *band = _reported(optimum, target)
    mesh_correction = best - float(row @ optimum.point.unknowns)
    return Profile(
        target,
        best,
        sigma,
        (band[0], band[1]),
        _shifted(lower_side, mesh_correction),
        _shifted(upper_side, mesh_correction),
        (unknowns.extreme(row, -1.0), unknowns.extreme(row, 1.0)),
    )


def _reported(optimum: CardOptimum, target: Target) -> tuple[float, float, float, float]:
    """Return value, standard deviation and ends of the band that the fit reports."""
    certainty = optimum.certainty
    if target.strain is None:
        fitted = verdicts(certainty.posterior, optimum.best.valid)
        verdict = next(item for item in fitted if item.name == target.name)
        return verdict.value, verdict.sigma, *verdict.band
    reported = certainty.at(optimum.best.law, target.name, np.array([target.strain]))
    columns = (reported.value, reported.sigma * reported.value, reported.lower, reported.upper)
    value, sigma, lower, upper = (float(column[0]) for column in columns)
    return value, sigma, lower, upper


def _shifted(side: ProfileSide, shift: float) -> ProfileSide:
    """Return a side of a profile with a shift added to its values."""
    return replace(side, values=tuple(value + shift for value in side.values))


class SideTask:
    """Compute sides of profiles in one process, which has a problem and a solver of its own."""

    def __init__(self, optimum: CardOptimum, targets: Sequence[Target]) -> None:
        self._targets = targets
        self._linear = optimum.linear
        # (n, n), of the n unknowns by the data's noise, without bounds: it scales the first steps.
        self._covariance = optimum.posterior.covariance
        self._problem, self._point = optimum.run_again()

    def __call__(self, number: int, report: Callable[[Any], None]) -> tuple[int, ProfileSide]:
        """Compute the side of this number; `report` receives its target after each value."""
        target = self._targets[number // len(SIGNS)]
        sign = SIGNS[number % len(SIGNS)]
        row = target.row(self._problem.unknowns)
        ratio = self._linear.spread_over_curvature(row)
        weights = self._linear.weights / np.sqrt(ratio if ratio > 0 else 1.0)
        problem = WeightedProblem.of(self._problem, weights)
        sigma = float(np.sqrt(row @ self._covariance @ row))
        on_place = functools.partial(report, target)
        side = profile_side(problem, problem.weighted(self._point), row, sign, sigma, on_place)
        return number, side
