"""Values of load cycles: permanent strain, stiffness and energy lost, cycle by cycle.

Strains count from the first passage upwards of the reference load, so that slack and the mounting
of the extensometer do not matter; work and loss are integrals of load over strain from there (J a
metre of specimen = N). Tangent stiffness is the slope of the least squares line of load over strain
between 40 and 90 % of the cycle's peak.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...errors import InputError
from ...notes import Note
from ...readers.histories import Cycle, Hold, LoadHistory, passage
from ...solvers.base import Array


@dataclass(frozen=True)
class CycleCriteria:
    """Hold the criteria by which the values of a cycle are read."""

    #: Shares of a cycle's peak between which the tangent stiffness is taken.
    tangent_from: float = 0.4
    tangent_to: float = 0.9
    #: Relative difference of peaks that are the same.
    same_peak: float = 0.05
    #: The reference load, unless given, over the highest end of a branch.
    reference_factor: float = 1.5
    #: Least end of a branch that counts for that, over the lowest peak.
    least_lower_end: float = 0.005
    #: Changes of a stable cycle: of stiffness, of permanent strain over the strain at the peak, and
    #: of loss over the work.
    stable_stiffness: float = 0.05
    stable_permanent: float = 0.02
    stable_loss: float = 0.03
    #: Shares of the peak at which the branches of a loop are compared.
    crossing_from: float = 0.2
    crossing_to: float = 0.95
    crossing_levels: int = 16


CRITERIA = CycleCriteria()


@dataclass(frozen=True, eq=False)
class CycleValues:
    """Values of one cycle; NaN where it does not unload, or does not pass the reference load.

    Parameters
    ----------
    cycle : Cycle
        Its rows.
    peak : float
        N.
    before, permanent, top : float
        Strains before the loading and after the unloading at the reference load, and at the peak.
    EA_loading, EA_unloading, secant_loading, secant_unloading : float
        Tangent and secant stiffness, N.
    work, loss : float
        J/m.
    rate : (float, float)
        Of loading and unloading, N/s.
    crossing : float
        Least strain of the unloading less that of the loading at the same load.
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
    """A history with the values of its cycles.

    Parameters
    ----------
    history : LoadHistory
        As it was read.
    reference : float
        Reference load, N, first passed at the recorded strain `zero`.
    zero : float
        Recorded strain from which strains count.
    values : tuple of CycleValues
        Cycle by cycle.
    holds : tuple of Hold
        Where the machine stands still under load.
    stable : int
        Number of the first stable cycle, or 0.
    notes : tuple of Note
        How the history was read, and doubts.
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
        """Return the name of the file without its ending."""
        return self.history.path.stem

    @property
    def words(self) -> str:
        """Return count and peak of the cycles, and how the stiffness changes, in words."""
        peak = max(v.peak for v in self.values)
        stiffness = [f"{v.EA_loading:.4g}" for v in self.values]
        return (
            f"{len(self.values)} cycles to {peak:.4g} N, stiffness on loading "
            f"{', '.join(stiffness)} N, permanent strain {100 * self.permanent_strain:.3g} %"
        )

    @property
    def permanent_strain(self) -> float:
        """Return the permanent strain after the last unloading; NaN without one."""
        strains = [v.permanent for v in self.values if not math.isnan(v.permanent)]
        return strains[-1] if strains else math.nan


def lower_end(load: Array, cycles: Sequence[Cycle]) -> float:
    """Return the highest load (N) at which a branch begins or ends."""
    ends = [load[c.start] for c in cycles] + [load[c.end] for c in cycles if c.unloaded]
    return float(max(ends))


def find_reference_load(
    history: LoadHistory, cycles: Sequence[Cycle], requested: float | None
) -> float:
    """Return the reference load.

    Parameters
    ----------
    history : LoadHistory
    cycles : sequence of Cycle
        All of the history.
    requested : float or None
        N; by the ends of the branches unless given.

    Raises
    ------
    InputError
        If it is not passed on every branch.
    """
    low = lower_end(history.load, cycles)
    lowest_peak = min(float(history.load[c.peak]) for c in cycles)
    reference = requested
    if reference is None:
        smallest = CRITERIA.reference_factor * max(low, CRITERIA.least_lower_end * lowest_peak)
        digit = 10.0 ** (math.floor(math.log10(smallest)) - 1)
        reference = digit * math.ceil(smallest / digit)
    highest = CRITERIA.tangent_to * lowest_peak
    if not low < reference < highest:
        problem = (
            f"{reference:g} N is not passed on every branch: expected between {low:.4g} N, where a "
            f"branch ends, and {highest:.4g} N; say reference_load"
        )
        raise InputError(history.path, "reference load", problem)
    return reference


def tangent_stiffness(load: Array, strain: Array, peak: float) -> float:
    """Return the tangent stiffness (N) of a branch, by the peak of its cycle (N); NaN without."""
    low = CRITERIA.tangent_from * peak
    high = CRITERIA.tangent_to * peak
    is_between = (load >= low) & (load <= high)
    x = strain[is_between]
    y = load[is_between]
    if len(x) < 3 or not np.ptp(x) > 0:
        return math.nan
    return float(((x - x.mean()) * (y - y.mean())).sum() / ((x - x.mean()) ** 2).sum())


def evaluate_cycle(
    history: LoadHistory, cycle: Cycle, reference: float, zero: float
) -> CycleValues:
    """Return the values of a cycle.

    Parameters
    ----------
    history : LoadHistory
    cycle : Cycle
        One of the history.
    reference : float
        Reference load, N.
    zero : float
        Recorded strain from which strains count.
    """
    up = slice(cycle.start, cycle.peak + 1)
    down = slice(cycle.peak, cycle.end + 1)
    strain = history.strain - zero
    load_up = history.load[up]
    strain_up = strain[up]
    load_down = history.load[down]
    strain_down = strain[down]
    peak = float(history.load[cycle.peak])
    top = float(strain[cycle.peak])
    i, before = passage(load_up, strain_up, reference)
    work = np.trapezoid(np.r_[reference, load_up[i + 1 :]], np.r_[before, strain_up[i + 1 :]])
    permanent = loss = EA_unloading = secant_unloading = crossing = math.nan
    if cycle.unloaded:
        j, permanent = passage(load_down, strain_down, reference)
        returned = np.trapezoid(
            np.r_[load_down[: j + 1], reference], np.r_[strain_down[: j + 1], permanent]
        )
        loss = float(work) + float(returned)
        EA_unloading = tangent_stiffness(load_down, strain_down, peak)
        secant_unloading = _secant(peak - reference, top - permanent)
        crossing = _crossing((load_up, strain_up), (load_down, strain_down), peak, reference)
    return CycleValues(
        cycle=cycle,
        peak=peak,
        before=before,
        permanent=permanent,
        top=top,
        EA_loading=tangent_stiffness(load_up, strain_up, peak),
        EA_unloading=EA_unloading,
        secant_loading=_secant(peak - reference, top - before),
        secant_unloading=secant_unloading,
        work=float(work),
        loss=loss,
        rate=(_rate(history, up), _rate(history, down) if cycle.unloaded else math.nan),
        crossing=crossing,
    )


def _secant(load: float, strain: float) -> float:
    return load / strain if strain > 0 else math.nan


def _crossing(
    loading: tuple[Array, Array], unloading: tuple[Array, Array], peak: float, reference: float
) -> float:
    """Return the least strain of the unloading less that of the loading at the same load."""
    shares = np.linspace(CRITERIA.crossing_from, CRITERIA.crossing_to, CRITERIA.crossing_levels)
    levels = [level for level in shares * peak if level >= reference]
    if not levels:
        return math.nan
    strain_up, strain_down = (
        np.array([passage(load, strain, level)[1] for level in levels])
        for load, strain in (loading, unloading)
    )
    return float(np.nanmin(strain_down - strain_up))


def _rate(history: LoadHistory, rows: slice) -> float:
    """Return the median rate of load, N/s, in the upper half of a branch."""
    load = history.load[rows]
    if history.time is None or len(load) < 3:
        return math.nan
    is_upper = load[1:] > 0.5 * load.max()
    rate = np.diff(load)[is_upper] / np.maximum(np.diff(history.time[rows])[is_upper], 1e-9)
    return float(np.median(np.abs(rate))) if len(rate) else math.nan


def has_same_peak(values: CycleValues, previous: CycleValues) -> bool:
    """Return whether two cycles have the same peak."""
    return abs(values.peak / previous.peak - 1) < CRITERIA.same_peak


def first_stable(values: Sequence[CycleValues]) -> int:
    """Return the number of the first cycle that repeats the one before to the same peak, or 0."""
    for previous, v in pairwise(values):
        stiffness_limit = CRITERIA.stable_stiffness * previous.EA_loading
        is_stable = (
            abs(v.EA_loading - previous.EA_loading) <= stiffness_limit
            and abs(v.permanent - previous.permanent) <= CRITERIA.stable_permanent * v.top
            and abs(v.loss - previous.loss) <= CRITERIA.stable_loss * v.work
        )
        if is_stable and has_same_peak(v, previous):
            return v.cycle.number
    return 0


def matched_rows(evaluated: EvaluatedHistory) -> tuple[int, int]:
    """Return first and last row, from the first passage of the reference load to the last."""
    history = evaluated.history
    reference = evaluated.reference
    first = evaluated.values[0].cycle.start
    last = evaluated.values[-1].cycle.peak
    start = first + passage(history.load[first:], history.strain[first:], reference)[0] + 1
    end = last + passage(history.load[last:], history.strain[last:], reference)[0]
    return start, end if end > last else len(history.load) - 1
