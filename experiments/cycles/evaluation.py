"""Evaluation of load histories: permanent strain, stiffness and energy lost, cycle by cycle.

Strains count from the first passage upwards of the reference load, so that slack and the mounting
of the extensometer do not matter; work and loss are integrals of load over strain from there (J a
metre of specimen = N). Tangent stiffness is the slope of the least squares line of load over strain
between 40 and 90 % of the cycle's peak.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import Against, InputError, Note, NoteKind
from ...files import pandas as pd
from ...materials.forms.spline import Spline
from ...materials.law import HypoelasticLaw, law_slopes
from ...materials.memory import NAMES, QUANTITIES, Memory, own_stress
from ...readers.histories import (
    Cycle,
    Hold,
    LoadHistory,
    find_cycles,
    find_holds,
    passage,
    read_history,
)
from ...readers.unit_plausibility import unit_doubt
from ..kinds import READING, Array

SLIP = NoteKind(
    "extensometer slip",
    weight=11.5,
    against=Against("an extensometer slipped", "leave the cycles with slip out of the fit"),
)
DRIFT = NoteKind("extensometer drift", weight=2.0)
GRIPS, CHANGING = NoteKind("strain between grips", 1.0), NoteKind("not conditioned", 1.0)
SCATTER = NoteKind("scatter between specimens", weight=1.5)
#: Of a cycle's peak: the ends of the tangent stiffness.
RANGE = (0.4, 0.9)
#: Peaks that differ by less are the same; the reference load by the highest lower end.
SAME, ABOVE = 0.05, 1.5
#: A stable cycle: changes of stiffness, permanent strain (of that at the peak), loss (of the work).
CHANGES = {"EA_loading": 0.05, "permanent": 0.02, "loss": 0.03}
#: Share of the permanent strain that is drift.
MOST_DRIFT = 0.1
#: Of the ranges of load and travel: the machine does not move yet.
STILL = (1e-3, 3e-4)
#: Loads, of the peak, at which the branches of a loop are compared.
LEVELS = np.linspace(0.2, 0.95, 16)


@dataclass(frozen=True)
class SlipLimits:
    """Limits beyond which an extensometer has slipped, or is suspected of it.

    Measured on sixteen straps and cords. Twelve that were not suspected lose up to 2.7 % of the
    strain at the peak from one cycle to the next and, at loads not reached before, up to 22 % of
    the strain by the machine's travel, as grips settle; slipped ones lose 4 and 27 % at least.
    """

    negative_loss: float = 1e-3  # of the work: a loop that is negative beyond rounding and noise
    crossing: float = 1e-4  # strain by which the branches of a loop may cross
    strain: float = 2e-4  # less strain at the same peak: least that counts
    peak_share: float = 0.035  # of the strain at the peak, likewise
    travel_share: float = 0.25  # of the strain by the machine's travel over a loading
    level: float = 0.2  # of the peak, from where on travel and strain are compared


SLIP_LIMITS = SlipLimits()


@dataclass(frozen=True, eq=False)
class CycleValues:
    """Values of one cycle; NaN where it does not unload, or does not pass the reference load.

    before, permanent, top : strains before the loading and after the unloading at the reference
    load, and at the peak. EA_*, secant_* : N. work, loss : J/m. rate : N/s, of both branches.
    crossing : least strain of the unloading less that of the loading at the same load.
    """

    cycle: Cycle
    peak: float
    before: float
    permanent: float
    top: float
    EA_loading: float
    EA_unloading: float
    secant_loading: float
    secant_unloading: float
    work: float
    loss: float
    rate: tuple[float, float]
    crossing: float


@dataclass(frozen=True, eq=False)
class EvaluatedHistory:
    """A history with the values of its cycles; stable : number of the first stable one, or 0.

    reference : N, first passed at the recorded strain `zero`.
    """

    history: LoadHistory
    reference: float
    zero: float
    values: tuple[CycleValues, ...]
    holds: tuple[Hold, ...]
    stable: int
    notes: tuple[Note, ...]

    @property
    def name(self) -> str:
        return self.history.path.stem

    @property
    def words(self) -> str:
        """Return count and peak of the cycles, and how the stiffness changes, in words."""
        peak = max(v.peak for v in self.values)
        stiffness = [f"{v.EA_loading:.4g}" for v in self.values]
        return (
            f"{len(self.values)} cycles to {peak:.4g} N, stiffness on loading "
            f"{', '.join(stiffness)} N, permanent strain {100 * self.kept:.3g} %"
        )

    @property
    def kept(self) -> float:
        """Return the permanent strain after the last unloading; NaN without one."""
        known = [v.permanent for v in self.values if not math.isnan(v.permanent)]
        return known[-1] if known else math.nan


def lower_end(load: Array, found: Sequence[Cycle]) -> float:
    """Return the highest load (N) at which a branch begins or ends."""
    ends = [load[c.start] for c in found] + [load[c.end] for c in found if c.unloaded]
    return float(max(ends))


def _reference(history: LoadHistory, found: Sequence[Cycle], given: float | None) -> float:
    low, top = lower_end(history.load, found), min(float(history.load[c.peak]) for c in found)
    if given is None:
        least = ABOVE * max(low, 0.005 * top)
        digit = 10.0 ** (math.floor(math.log10(least)) - 1)
        given = digit * math.ceil(least / digit)
    if not low < given < RANGE[1] * top:
        problem = (
            f"{given:g} N is not passed on every branch: expected between {low:.4g} N, where a "
            f"branch ends, and {RANGE[1] * top:.4g} N; say reference_load"
        )
        raise InputError(history.path, "reference load", problem)
    return given


def _slope(load: Array, strain: Array, peak: float) -> float:
    keep = (load >= RANGE[0] * peak) & (load <= RANGE[1] * peak)
    x, y = strain[keep], load[keep]
    if len(x) < 3 or not np.ptp(x) > 0:
        return math.nan
    return float(((x - x.mean()) * (y - y.mean())).sum() / ((x - x.mean()) ** 2).sum())


def evaluate_cycle(history: LoadHistory, c: Cycle, reference: float, zero: float) -> CycleValues:
    """Return the values of a cycle; zero : recorded strain from which strains count."""
    up, down = slice(c.start, c.peak + 1), slice(c.peak, c.end + 1)
    load, strain = history.load, history.strain - zero
    peak, top, none = float(load[c.peak]), float(strain[c.peak]), math.nan
    i, before = passage(load[up], strain[up], reference)
    on_loading = np.r_[reference, load[up][i + 1 :]], np.r_[before, strain[up][i + 1 :]]
    work = float(np.trapezoid(*on_loading))
    ends, loss, unloading, secant, crossing = (none,) * 5
    if c.unloaded:
        j, ends = passage(load[down], strain[down], reference)
        loss = work + float(
            np.trapezoid(np.r_[load[down][: j + 1], reference], np.r_[strain[down][: j + 1], ends])
        )
        unloading = _slope(load[down], strain[down], peak)
        secant = (peak - reference) / (top - ends) if top > ends else none
        levels = [level for level in LEVELS * peak if level >= reference]
        pairs = [passage(load[s], strain[s], x)[1] for s in (down, up) for x in levels]
        apart = np.array(pairs[: len(levels)]) - pairs[len(levels) :]
        crossing = float(np.nanmin(apart)) if len(levels) else none
    loading = (peak - reference) / (top - before) if top > before else none
    rates = (_rate(history, up), _rate(history, down) if c.unloaded else none)
    return CycleValues(
        c, peak, before, ends, top, _slope(load[up], strain[up], peak), unloading, loading, secant,
        work, loss, rates, crossing,
    )  # fmt: skip


def _rate(history: LoadHistory, rows: slice) -> float:
    """Return the median rate of load, N/s, in the upper half of a branch."""
    load = history.load[rows]
    if history.time is None or len(load) < 3:
        return math.nan
    above = load[1:] > 0.5 * load.max()
    rate = np.diff(load)[above] / np.maximum(np.diff(history.time[rows])[above], 1e-9)
    return float(np.median(np.abs(rate))) if len(rate) else math.nan


def _stable(values: Sequence[CycleValues]) -> int:
    """Return the number of the first cycle that repeats the one before to the same peak, or 0."""
    for old, new in pairwise(values):
        most = {"EA_loading": old.EA_loading, "permanent": new.top, "loss": new.work}
        changes = [
            abs(getattr(new, name) - getattr(old, name)) <= CHANGES[name] * of
            for name, of in most.items()
        ]
        if all(changes) and abs(new.peak / old.peak - 1) < SAME:
            return new.cycle.number
    return 0


def _strains_of_loading(
    history: LoadHistory, values: CycleValues, reference: float
) -> tuple[float, float] | None:
    """Return the strain of a cycle's loading by the machine's travel, and as it was measured.

    The free length is that of the unloading, on which no grip settles. None without travel.
    """
    cycle = values.cycle
    if history.travel is None or history.measured == "grips" or not cycle.unloaded:
        return None
    level = max(reference, SLIP_LIMITS.level * values.peak)
    changes = []
    for rows in (slice(cycle.start, cycle.peak + 1), slice(cycle.peak, cycle.end + 1)):
        for reading in (history.strain, history.travel):
            at_level = passage(history.load[rows], reading[rows], level)[1]
            changes.append(float(reading[cycle.peak] - at_level))
    strain_up, travel_up, strain_down, travel_down = changes
    if not all(np.isfinite(changes)) or min(strain_down, travel_down, travel_up) <= 0:
        return None
    return travel_up * strain_down / travel_down, strain_up


def _doubts(
    history: LoadHistory, values: Sequence[CycleValues], stable: int, reference: float
) -> Iterator[tuple[NoteKind, str]]:
    for v in values:
        k = f"cycle {v.cycle.number}"
        if v.loss < -SLIP_LIMITS.negative_loss * v.work:
            yield SLIP, f"{k} is a negative loop ({v.loss:.3g} J/m): the extensometer slipped"
        elif v.crossing < -SLIP_LIMITS.crossing:
            words = (
                f"the branches of {k} cross: {-v.crossing:.2g} less strain on unloading than on "
            )
            yield SLIP, words + "loading at the same load; the extensometer slipped"
    for old, new in pairwise(values):
        lost = old.top - new.top
        noise = max(SLIP_LIMITS.strain, SLIP_LIMITS.peak_share * old.top)
        strains = _strains_of_loading(history, new, reference)
        if abs(new.peak / old.peak - 1) < SAME and lost > noise:
            words = f"at the peak of cycle {new.cycle.number} {lost:.2g} less strain than in cycle "
            words += f"{old.cycle.number} at the same load"
            if history.travel is not None:
                way = float(history.travel[new.cycle.peak] - history.travel[old.cycle.peak])
                words += f", the machine's travel {way:+.2g} mm more"
            yield SLIP, f"{words}: slip of the extensometer is suspected"
        elif new.loss >= -SLIP_LIMITS.negative_loss * new.work and strains is not None:
            by_travel, shown = strains
            if by_travel - shown > SLIP_LIMITS.travel_share * by_travel:
                words = (
                    f"over the loading of cycle {new.cycle.number} the machine's travel makes "
                    f"{by_travel:.3g} of strain, by the travel over strain of its unloading, and "
                    f"the extensometer shows {shown:.3g}: slip of the extensometer is suspected"
                )
                yield SLIP, words
    still = np.abs(history.load - history.load[0]) <= STILL[0] * np.ptp(history.load)
    if history.travel is not None:
        still &= np.abs(history.travel - history.travel[0]) <= STILL[1] * np.ptp(history.travel)
    first = int(np.argmin(still))
    if history.time is not None and first > 5 and history.time[first] > history.time[0]:
        # Before the first loading the load stands still, and so should the strain.
        slope = np.polyfit(history.time[:first], history.strain[:first], 1)[0]
        whole = abs(float(slope) * np.ptp(history.time))
        kept = np.nanmax([abs(v.permanent) for v in values])
        if whole > MOST_DRIFT * kept:
            words = f"the strain moves by {slope:.2g} a second before the load does, {whole:.2g} "
            words += f"over the test beside a permanent strain of {kept:.2g}"
            yield DRIFT, f"{words}: the extensometer drifts"
    if history.measured == "grips":
        words = "strains are travel of the machine: permanent strain holds the slip in the grips"
        yield GRIPS, words
    if not stable and len(values) > 1:
        words = "no cycle repeats the one before to the same peak: the state is not conditioned"
        yield CHANGING, words


def scatter_notes(by_direction: Mapping[str, Sequence[EvaluatedHistory]]) -> list[Note]:
    """Return how specimens of a direction differ in stiffness, which bands of a fit do not hold.

    The largest difference of a specimen from the mean of the others, over cycles that all have.
    """
    notes = []
    without = "the bands of a fit are of the law that all specimens share, and do not hold it"
    for direction, specimens in by_direction.items():
        if len(specimens) == 1:
            words = (
                f"one specimen of the {direction}: how much specimens scatter is not known, and "
                "the bands of a fit do not hold it"
            )
            notes.append(Note(SCATTER, words))
            continue
        differences = []
        for values in zip(*(specimen.values for specimen in specimens), strict=False):
            stiffness = np.array([value.EA_loading for value in values])
            others = (stiffness.sum() - stiffness) / (len(stiffness) - 1)
            deviation = float(stiffness.std(ddof=1) / stiffness.mean())
            largest = float(np.abs(stiffness / others - 1.0).max())
            differences.append((largest, deviation, values[0].cycle.number))
        known = [row for row in differences if not math.isnan(row[0])]
        if known:
            largest, deviation, number = max(known)
            words = (
                f"{len(specimens)} specimens of the {direction} scatter: on loading in cycle "
                f"{number} the stiffness of one differs by {100 * largest:.2g} % from the mean of "
                f"the others (standard deviation {100 * deviation:.2g} %); {without}"
            )
            notes.append(Note(SCATTER, words))
    return notes


def evaluate_history(history: LoadHistory, reference: float | None = None) -> EvaluatedHistory:
    """Return the values of all cycles of a history; reference : N, passed on every branch."""
    found = find_cycles(history.load)
    if not found:
        raise InputError(history.path, "load", "no loading: the load does not rise anywhere")
    level, first = _reference(history, found, reference), found[0]
    up = slice(first.start, first.peak + 1)
    zero = passage(history.load[up], history.strain[up], level)[1]
    values = [evaluate_cycle(history, c, level, zero) for c in found]
    stable = _stable(values)
    notes = [Note(READING, words) for words in history.notes]
    doubts = _doubts(history, values, stable, level)
    notes += [Note(kind, words, history.path.name) for kind, words in doubts]
    holds = tuple(find_holds(history, found))
    return EvaluatedHistory(history, level, zero, tuple(values), holds, stable, tuple(notes))


@dataclass(frozen=True)
class CycleFitSettings:
    """Settings of a fit of a loading curve and a memory to a history."""

    knots: int = 8  # of the tangent of the loading curve
    tangent_bounds: tuple[float, float] = (1e-4, 1e2)  # of the mean stiffness
    largest_set: float = 0.99
    largest_unloading: float = 1.99  # U, which R stays below
    largest_saturation: float = 100.0
    slip_bounds: tuple[float, float] = (-0.1, 0.3)  # of the largest strain
    slip_step: float = 1e-7  # of central differences by slip, of the largest strain
    initial_memory: tuple[float, ...] = (0.3, 1.4, 0.4, 0.1)  # set, U, share of R, saturation
    tolerance: float = 1e-14
    max_evaluations: int = 400
    driven_points: int = 400  # along a branch that is predicted


CYCLE_FIT = CycleFitSettings()


@dataclass(frozen=True, eq=False)
class FittedCycles:
    """A loading curve with unloading and reloading, fitted to a history (`materials/memory.py`).

    Parameters
    ----------
    knots, stiffness : (k,) arrays
        Strains, and the tangent of the loading curve there, N, above the reference load.
    memory : (4,) array
        Set, unloading, reloading, saturation, in the order of `memory.QUANTITIES`.
    slip : mapping of int to float
        Strain that the extensometer lost before each later cycle.
    sigma : (k + 4 + slips,) array
        One standard deviation each, of independent readings.
    rows : (n,) array of int
        Readings that are followed.
    strain, load : (n,) arrays
        Strains of the law at them, and modelled loads, N.
    rms : float
        Of the readings that were fitted, N.
    law : HypoelasticLaw
        The fitted law.
    """

    knots: Array
    stiffness: Array
    memory: Array
    slip: Mapping[int, float]
    sigma: Array
    rows: NDArray[np.intp]
    strain: Array
    load: Array
    rms: float
    law: HypoelasticLaw

    @property
    def remembered(self) -> list[tuple[str, float, float]]:
        """Return name, value and one sigma of each constant of the memory."""
        sigma = self.sigma[len(self.knots) :].tolist()
        return list(zip(QUANTITIES, self.memory.tolist(), sigma, strict=False))

    def driven(self, before: int, peak: float, level: float) -> tuple[Array, ...]:
        """Return a loading to a peak and the unloading after it, by the load as of a machine.

        Parameters
        ----------
        before : int
            Number of the readings that precede the loading.
        peak : float
            N.
        level : float
            Load at which strains and loads of the law begin, N.

        Returns
        -------
        strain_up, load_up, strain_down, load_down : arrays
            Of loading and unloading, N.
        """
        path = self.strain[:before]
        branches: list[Array] = []
        for end in (self.law.strain_range[0], 0.0):
            strain = np.linspace(path[-1], end, CYCLE_FIT.driven_points)
            load = _stress(self.law, np.r_[path, strain[1:]])[len(path) - 1 :] + level
            i, strain_at_peak = passage(load, strain, peak if end else -np.inf)
            if i >= 0:
                strain = np.r_[strain[: i + 1], strain_at_peak]
                load = np.r_[load[: i + 1], peak]
            branches += [strain, load]
            path = np.r_[path, strain[1:]]
        return tuple(branches)


def _stress(law: HypoelasticLaw, strain: Array) -> Array:
    """Return the stress of a law along a history of strain."""
    return own_stress(law.pieces, law.coupling, 0, strain, *law_slopes(law, [], 1.0))[0]


def matched_rows(one: EvaluatedHistory) -> tuple[int, int]:
    """Return first and last row, from the first passage of the reference load to the last."""
    history = one.history
    first, last = one.values[0].cycle.start, one.values[-1].cycle.peak
    start = first + passage(history.load[first:], history.strain[first:], one.reference)[0] + 1
    end = last + passage(history.load[last:], history.strain[last:], one.reference)[0]
    return start, end if end > last else len(history.load) - 1


class CycleFit:
    """The least squares problem of a loading curve, a memory and slips of an extensometer.

    The unknowns x are the tangent at the knots over the mean stiffness; set, unloading U, the share
    of U - 1 that R - 1 is (so that the reloading R stays below U), saturation; slips over the
    largest strain. Readings count from the first passage of the reference load to the last, in
    strain and load, each branch with the same weight.

    Parameters
    ----------
    evaluated : EvaluatedHistory
        What is fitted.
    knots : int
        Of the tangent of the loading curve.
    leave : int
        Number of a cycle that is not fitted; its slip is that of the next one.
    """

    def __init__(self, evaluated: EvaluatedHistory, knots: int, leave: int) -> None:
        history = evaluated.history
        start, end = matched_rows(evaluated)
        self.rows = np.arange(start, end + 1)
        self.strain = history.strain[self.rows] - evaluated.zero
        self.load = history.load[self.rows] - evaluated.reference
        cycle_starts = [v.cycle.start for v in evaluated.values]
        number = np.searchsorted(cycle_starts, self.rows, "right")
        self.weight = self._branch_weights(evaluated, number, leave)
        last = len(evaluated.values)
        with_next = leave if leave == last else leave + 1
        self.slipped = [k for k in range(2, last + 1) if k != with_next]
        self.has_slipped = (number[:, None] >= self.slipped).astype(float)
        self.top = float(self.strain[self.weight > 0].max())
        no_knots = [0.0, 1.0]
        strains = np.linspace(0.0, self.top, knots).tolist()
        self.form = Spline.at([strains, no_knots, no_knots])
        self.knots = knots
        self.shared = knots + len(QUANTITIES)
        self.mean = float(self.load.max()) / self.top
        tangents = range(self.form.size - knots, self.form.size)  # E1 comes last
        self.names = [*(f"beta_{i}" for i in tangents), *NAMES[: len(QUANTITIES)]]

    def _branch_weights(
        self, evaluated: EvaluatedHistory, number: NDArray[np.intp], leave: int
    ) -> Array:
        """Return the weight (n,) of each reading, by its branch; 0 in the cycle that is left."""
        weight = np.zeros(len(self.rows))
        for v in evaluated.values:
            for side in (self.rows < v.cycle.peak, self.rows >= v.cycle.peak):
                is_branch = side & (number == v.cycle.number) & (v.cycle.number != leave)
                weight[is_branch] = 1.0 / (v.peak * math.sqrt(max(int(is_branch.sum()), 1)))
        return weight

    def law_at(self, x: Array) -> HypoelasticLaw:
        """Return the law of unknowns."""
        permanent, unloading, share, saturation = x[self.knots : self.shared]
        reloading = 1.0 + share * (unloading - 1.0)
        unused = [0, 1, 1, 0] * 2
        memory = Memory.of([permanent, unloading, reloading, saturation / self.top, *unused])
        others = np.full(self.form.size - self.knots, self.mean)
        beta = np.r_[others, self.mean * x[: self.knots]]
        strain_range = np.array([self.top, 1, 1])
        return HypoelasticLaw(beta, 0.0, strain_range, form=self.form, memory=memory)

    def strain_at(self, x: Array) -> Array:
        """Return the strains (n,) of the law, with what the extensometer has lost."""
        return np.maximum(self.strain + self.top * self.has_slipped @ x[self.shared :], 0.0)

    def residual(self, x: Array) -> Array:
        """Return the weighted residuals (n,)."""
        return self.weight * (_stress(self.law_at(x), self.strain_at(x)) - self.load)

    def jacobian(self, x: Array) -> Array:
        """Return the derivatives (n, unknowns) of the residuals; by slip central differences."""
        knots = self.knots
        law, strain = self.law_at(x), self.strain_at(x)
        slopes = law_slopes(law, self.names, 1.0)
        by_constants = own_stress(law.pieces, law.coupling, 0, strain, *slopes)[1]
        unloading, share = x[knots + 1 : knots + 3]
        chain = np.diag([*[self.mean] * knots, 1.0, 1.0, unloading - 1.0, 1.0 / self.top])
        chain[knots + 2, knots + 1] = share
        by_slip = []
        step = CYCLE_FIT.slip_step
        for direction in np.eye(len(x))[self.shared :]:
            above = _stress(law, self.strain_at(x + step * direction))
            below = _stress(law, self.strain_at(x + -step * direction))
            by_slip.append((above - below) / (2 * step))
        return self.weight[:, None] * np.column_stack([by_constants @ chain, *by_slip])

    def solve(self) -> Any:
        """Return the result of `scipy.optimize.least_squares`."""
        settings, count = CYCLE_FIT, len(self.slipped)
        low_tangent, high_tangent = settings.tangent_bounds
        low_slip, high_slip = settings.slip_bounds
        low = [*[low_tangent] * self.knots, 0.0, 1.0, 0.0, 0.0, *[low_slip] * count]
        largest = settings.largest_set, settings.largest_unloading, 1.0, settings.largest_saturation
        high = [*[high_tangent] * self.knots, *largest, *[high_slip] * count]
        begin = [*[1.0] * self.knots, *settings.initial_memory, *[0.0] * count]
        return scipy.optimize.least_squares(
            self.residual,
            begin,
            self.jacobian,
            bounds=(low, high),
            xtol=settings.tolerance,
            ftol=settings.tolerance,
            gtol=settings.tolerance,
            max_nfev=settings.max_evaluations,
        )

    def sigma(self, best: Any) -> Array:
        """Return one standard deviation of each constant, of independent readings."""
        freedom = max(int((self.weight > 0).sum()) - len(best.x), 1)
        variance = 2 * best.cost / freedom
        unloading = best.x[self.knots + 1]
        scale = np.r_[
            np.full(self.knots, self.mean),
            1.0,
            1.0,
            unloading - 1.0,
            1.0 / self.top,
            np.full(len(self.slipped), self.top),
        ]
        covariance = np.linalg.pinv(best.jac.T @ best.jac)
        return scale * np.sqrt(variance * np.diag(covariance))


def fit_cycles(one: EvaluatedHistory, knots: int = CYCLE_FIT.knots, leave: int = 0) -> FittedCycles:
    """Fit a loading curve and a memory to the cycles of a history.

    Parameters
    ----------
    one : EvaluatedHistory
        What is fitted.
    knots : int
        Of the tangent of the loading curve.
    leave : int
        Number of a cycle that is not fitted; 0: all are.

    Returns
    -------
    FittedCycles
        With what an extensometer has lost by slip before each later cycle; a cycle that is left
        out has that of the next one.
    """
    problem = CycleFit(one, knots, leave)
    best = problem.solve()
    law, strain = problem.law_at(best.x), problem.strain_at(best.x)
    load = _stress(law, strain)
    is_fitted = problem.weight > 0
    slips = (problem.top * best.x[problem.shared :]).tolist()
    constants = law.memory.constants[: len(QUANTITIES)] if law.memory else ()
    return FittedCycles(
        knots=np.array(problem.form.knots[0]),
        stiffness=problem.mean * best.x[:knots],
        memory=np.array(constants),
        slip=dict(zip(problem.slipped, slips, strict=True)),
        sigma=problem.sigma(best),
        rows=problem.rows,
        strain=strain,
        load=load + one.reference,
        rms=float(np.sqrt(np.mean((load - problem.load)[is_fitted] ** 2))),
        law=law,
    )


def left_out(one: EvaluatedHistory, knots: int = CYCLE_FIT.knots) -> pd.DataFrame:
    """Return each cycle beside its prediction by a fit to the others.

    Predicted are strains at the loads, as a machine that follows loads would find them: stiffness
    and permanent strain, without slip.

    Parameters
    ----------
    one : EvaluatedHistory
        What is fitted.
    knots : int
        Of the tangent of the loading curve.

    Returns
    -------
    DataFrame
        A row a cycle, but of the first and of one that alone reaches its load: no others could
        predict them.
    """
    rows = []
    for v in one.values:
        number = v.cycle.number
        other_peaks = [w.peak for w in one.values if w is not v]
        if number == 1 or v.peak > (1 + SAME) * max(other_peaks) or math.isnan(v.permanent):
            continue
        fitted = fit_cycles(one, knots, leave=number)
        before = int(np.searchsorted(fitted.rows, v.cycle.start))
        strain_up, load_up, strain_down, load_down = fitted.driven(before, v.peak, one.reference)
        row: dict[str, Any] = {"file": one.history.path.name, "cycle": number}
        branches = {"EA_loading": (load_up, strain_up), "EA_unloading": (load_down, strain_down)}
        for name, (load, strain) in branches.items():
            measured, predicted = getattr(v, name), _slope(load, strain, v.peak)
            row |= {f"{name}_N": measured, f"{name}_predicted_N": predicted}
            row[f"{name}_off_percent"] = 100 * (predicted / measured - 1)
        permanent = passage(load_down, strain_down, one.reference)[1]
        row |= {
            "permanent_strain": v.permanent,
            "permanent_strain_predicted": permanent,
            "permanent_strain_off": permanent - v.permanent,
        }
        rows.append(row)
    return pd.DataFrame(rows)


@dataclass(frozen=True, eq=False)
class Cycles:
    """Evaluated histories; width : mm, for stiffness per width (N/mm), or None."""

    histories: tuple[EvaluatedHistory, ...]
    width: float | None = None

    @property
    def notes(self) -> list[Note]:
        """Return the doubts of all histories."""
        return [note for one in self.histories for note in one.notes]

    @property
    def table(self) -> pd.DataFrame:
        """Return a row a cycle; stiffness in N, or N/mm of width; ratios to the first cycle."""
        scale, unit = (1.0, "N") if self.width is None else (1.0 / self.width, "N_per_mm")
        table = []
        for one in self.histories:
            first = one.values[0]
            for v in one.values:
                stable = v.cycle.number == one.stable
                row: dict[str, Any] = {
                    "file": one.history.path.name, "cycle": v.cycle.number,
                    "state": "first" if v is first else "conditioned" if stable else "",
                    "peak_N": v.peak, "reference_N": one.reference,
                    "strain_before": v.before, "permanent_strain": v.permanent,
                    "strain_at_peak": v.top,
                }  # fmt: skip
                for name in ("EA_loading", "EA_unloading", "secant_loading", "secant_unloading"):
                    row[f"{name}_{unit}"] = scale * getattr(v, name)
                row |= {
                    "work_J_per_m": v.work,
                    "loss_J_per_m": v.loss,
                    "loss_ratio": v.loss / v.work,
                }
                for name in ("EA_loading", "EA_unloading", "loss"):
                    row[f"{name}_of_first"] = getattr(v, name) / getattr(first, name)
                row |= {"loading_N_per_s": v.rate[0], "unloading_N_per_s": v.rate[1]}
                table.append(row)
        return pd.DataFrame(table)

    @property
    def loops(self) -> pd.DataFrame:
        """Return a row a reading of every cycle: strain from the reference load on, and load."""
        tables = []
        for one in self.histories:
            history = one.history
            for v in one.values:
                rows = np.arange(v.cycle.start, v.cycle.end + 1)
                table = pd.DataFrame({"cycle": v.cycle.number}, index=rows)
                table.insert(0, "file", history.path.name)
                table["branch"] = np.where(rows <= v.cycle.peak, "loading", "unloading")
                for name, reading in (("time_s", history.time), ("travel_mm", history.travel)):
                    table[name] = np.nan if reading is None else reading[rows]
                table["strain"] = history.strain[rows] - one.zero
                table["load_N"] = history.load[rows]
                tables.append(table)
        return pd.concat(tables, ignore_index=True)

    @property
    def holds(self) -> pd.DataFrame:
        """Return a row a hold: strain (creep) and load (relaxation) before, after, per decade."""
        table = []
        for one in self.histories:
            h, zero = one.history, one.zero
            for hold in one.holds:
                rows = slice(hold.first, hold.last + 1)
                assert h.time is not None
                since = h.time[rows] - h.time[hold.first]
                row: dict[str, Any] = {"file": h.path.name, "cycle": hold.cycle, "at": hold.at,
                                       "duration_s": float(since[-1])}  # fmt: skip
                for name, values in (("strain", h.strain[rows] - zero), ("load_N", h.load[rows])):
                    # From the second reading on: a decade has no beginning at zero.
                    slope = np.polyfit(np.log10(since[1:]), values[1:], 1)[0]
                    row |= {f"{name}_before": values[0], f"{name}_after": values[-1],
                            f"{name}_after_over_before": values[-1] / values[0],
                            f"{name}_per_decade": float(slope)}  # fmt: skip
                table.append(row)
        return pd.DataFrame(table)

    @cached_property
    def fits(self) -> tuple[FittedCycles, ...]:
        """Return a fit to all cycles of each history."""
        return tuple(fit_cycles(one) for one in self.histories)

    @property
    def memory(self) -> pd.DataFrame:
        """Return a row a history: set, unloading, reloading, saturation, one sigma each, RMS."""
        table = []
        for one, fitted in zip(self.histories, self.fits, strict=True):
            row: dict[str, Any] = {"file": one.history.path.name, "rms_N": fitted.rms}
            for name, value, sigma in fitted.remembered:
                row |= {name: value, f"{name}_sigma": sigma}
            row |= {f"slip_{cycle}": value for cycle, value in fitted.slip.items()}
            for k, knot in enumerate(fitted.knots.tolist(), start=1):
                row |= {f"strain_{k}": knot, f"EA_{k}_N": float(fitted.stiffness[k - 1])}
            table.append(row)
        return pd.DataFrame(table)

    @cached_property
    def left_out(self) -> pd.DataFrame:
        """Return each cycle beside its prediction by a fit to the others, see `left_out`."""
        return pd.concat([left_out(one) for one in self.histories], ignore_index=True)

    def fit_lines(self) -> list[str]:
        """Return the fits, and the cycles that were left out, as lines for the terminal."""
        said = []
        for one, f in zip(self.histories, self.fits, strict=True):
            words = ", ".join(f"{name} {v:.3g} +- {sigma:.2g}" for name, v, sigma in f.remembered)
            slip = ", ".join(f"{100 * v:.2g} % before cycle {k}" for k, v in f.slip.items())
            words += f"; slip of the extensometer: {slip}" if slip else ""
            said.append(f"{one.history.path.name}: memory: {words}; RMS error {f.rms:.3g} N")
        for row in self.left_out.to_dict("records"):
            off = row["EA_loading_off_percent"], row["EA_unloading_off_percent"]
            said.append(
                f"{row['file']}: cycle {row['cycle']} from the others: stiffness off by "
                f"{off[0]:+.2g} and {off[1]:+.2g} % (loading, unloading), permanent strain by "
                f"{100 * row['permanent_strain_off']:+.2g} % of strain"
            )
        return said

    def lines(self) -> list[str]:
        """Return the results as lines for the terminal."""
        scale, per = (1e-3, "kN") if self.width is None else (1.0 / self.width, "N/mm")
        said = []
        for one in self.histories:
            said.append(f"{one.history.path.name}: reference load {one.reference:.4g} N")
            for v in one.values:
                said.append(
                    f"  cycle {v.cycle.number}, to {v.peak:.4g} N: permanent strain "
                    f"{100 * v.permanent:.3g} %, stiffness loading {scale * v.EA_loading:.4g}, "
                    f"unloading {scale * v.EA_unloading:.4g} {per}, loss {v.loss:.3g} J/m "
                    f"({100 * v.loss / v.work:.2g} % of the work)"
                )
            first, last = one.values[0], one.values[one.stable - 1 if one.stable else -1]
            if last is not first:
                state = f"conditioned (cycle {one.stable})" if one.stable else "last cycle"
                ratio = last.EA_loading / first.EA_loading
                said.append(f"  first loading beside {state}: stiffness 1 to {ratio:.3g}")
        return said


def cycles(
    files: Sequence[Path | str] | Path | str,
    *,
    reference_load: float | None = None,
    width: float | None = None,
    **reading: Any,
) -> Cycles:
    """Evaluate the load cycles of files, each of one specimen.

    reference_load : N, of the permanent strain; unless given 1.5 times the load at which the
    highest branch begins or ends. width : mm, for stiffness per width. reading : as
    `read_history` takes it: length (mm) of an elongation, columns, units.
    """
    for name, value in (("reference_load", reference_load), ("width", width)):
        if value is not None and not value > 0:
            raise InputError(None, name, f"expected a number above 0, got {value:g}")
    for name, value in (("width", width), ("length", reading.get("length"))):
        if value is not None and (problem := unit_doubt("size", value, "mm", 1.0)):
            raise InputError(None, name, problem)
    several = [files] if isinstance(files, (Path, str)) else list(files)
    if not several:
        raise InputError(None, "files", "expected the files of load histories, got none")
    found = [evaluate_history(read_history(p, **reading), reference_load) for p in several]
    return Cycles(tuple(found), width)
