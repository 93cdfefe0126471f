"""Evaluate each load cycle of a history: permanent strain, stiffness and energy loss.

Strains count from where the first loading crosses the reference load, so that slack and the
mounting of the extensometer do not matter. Work and loss are integrals of load over strain from
there (J per metre of specimen, that is N). Tangent stiffness is the slope of the least squares line
of load over strain between 40 and 90 % of the cycle's peak.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...errors import InputError
from ...notes import Note
from ...readers.histories import Cycle, Hold, LoadHistory, change_on_branch, passage
from ...solvers.base import Array


@dataclass(frozen=True)
class CycleCriteria:
    """Criteria by which the values of a cycle are evaluated."""

    #: Shares of a cycle's peak between which the tangent stiffness is taken.
    tangent_from: float = 0.4
    tangent_to: float = 0.9
    #: Relative difference up to which two peaks count as the same.
    same_peak: float = 0.05
    #: Reference load, unless given, over the highest load at which a branch begins or ends.
    reference_factor: float = 1.5
    #: Smallest such load that is taken for this, over the lowest peak.
    least_lower_end: float = 0.005
    #: Largest changes from the cycle before in a stable cycle: of stiffness over that before, of
    #: permanent strain over the strain at the peak, and of loss over the work.
    stable_stiffness: float = 0.05
    stable_permanent: float = 0.02
    stable_loss: float = 0.03
    #: Shares of the peak between which the branches of a loop are compared, and at how many loads.
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
        Largest load, N.
    initial, permanent, top : float
        Strain where the loading crosses the reference load, where the unloading crosses it, and at
        the peak.
    EA_loading, EA_unloading, secant_loading, secant_unloading : float
        Tangent and secant stiffness of loading and unloading, N.
    work, loss : float
        Work of the loading, and energy lost over the cycle, J/m.
    rate : (float, float)
        Rate of the load on loading and unloading, N/s.
    crossing : float
        Smallest difference between strains of unloading and loading at the same load; it is
        negative where the branches cross.
    """

    cycle: Cycle
    peak: float
    initial: float
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
    """A load history with the values of its cycles.

    Parameters
    ----------
    history : LoadHistory
        The history as it was read.
    reference : float
        Reference load, N.
    zero : float
        Recorded strain at which the load first crosses the reference load; strains count from it.
    values : tuple of CycleValues
        Values of each cycle, in order.
    holds : tuple of Hold
        Holds, in which the machine stands still.
    stable_cycle : int
        Number of the first stable cycle, or 0 if there is none.
    notes : tuple of Note
        Notes on how the history was read, and doubts about it.
    """

    history: LoadHistory
    reference: float
    zero: float
    values: tuple[CycleValues, ...]
    holds: tuple[Hold, ...]
    stable_cycle: int
    notes: tuple[Note, ...]

    @property
    def name(self) -> str:
        """Return the name of the file without its ending."""
        return self.history.path.stem

    @property
    def words(self) -> str:
        """Return in words how many cycles there are, their peak, stiffness and permanent strain."""
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
    """Return the reference load (N), at which permanent strains are read.

    Parameters
    ----------
    history : LoadHistory
    cycles : sequence of Cycle
        All cycles of the history.
    requested : float or None
        Load that the user asks for, N; otherwise 1.5 times the highest load at which a branch
        begins or ends, rounded up to two digits.

    Raises
    ------
    InputError
        If not every branch crosses it.
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
    """Return the tangent stiffness (N) of a branch between two shares of its cycle's peak.

    NaN is returned for fewer than three readings between these loads.

    Parameters
    ----------
    load, strain : (n,) array
        Readings of the branch; the load in N.
    peak : float, N
        Largest load of the cycle.
    """
    low = CRITERIA.tangent_from * peak
    high = CRITERIA.tangent_to * peak
    is_between = (load >= low) & (load <= high)
    x = strain[is_between]
    y = load[is_between]
    if len(x) < 3 or not np.ptp(x) > 0:
        return math.nan
    x = x - x.mean()
    y = y - y.mean()
    return float((x * y).sum() / (x**2).sum())


def evaluate_cycle(
    history: LoadHistory,
    cycle: Cycle,
    reference: float,
    zero: float,
) -> CycleValues:
    """Evaluate one cycle of a history.

    Parameters
    ----------
    history : LoadHistory
    cycle : Cycle
        One of the cycles of the history.
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
    i, initial = passage(load_up, strain_up, reference)
    work = np.trapezoid(np.r_[reference, load_up[i + 1 :]], np.r_[initial, strain_up[i + 1 :]])
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
        initial=initial,
        permanent=permanent,
        top=top,
        EA_loading=tangent_stiffness(load_up, strain_up, peak),
        EA_unloading=EA_unloading,
        secant_loading=_secant(peak - reference, top - initial),
        secant_unloading=secant_unloading,
        work=float(work),
        loss=loss,
        rate=(_rate(history, up), _rate(history, down) if cycle.unloaded else math.nan),
        crossing=crossing,
    )


def _secant(load: float, strain: float) -> float:
    """Return load over strain (N); NaN where the strain is not positive."""
    return load / strain if strain > 0 else math.nan


def _crossing(
    loading: tuple[Array, Array],
    unloading: tuple[Array, Array],
    peak: float,
    reference: float,
) -> float:
    """Return the smallest difference between strains of unloading and loading at the same load.

    Parameters
    ----------
    loading, unloading : ((n,) array, (n,) array)
        Loads (N) and strains along each branch.
    """
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
    """Return the mean rate of load, N/s, of a branch between `RATE_LEVELS` of its peak."""
    if history.time is None:
        return math.nan
    load = history.load[rows]
    duration = abs(change_on_branch(load, history.time[rows]))
    return change_on_branch(load, load) / duration if duration > 0 else math.nan


def has_same_peak(values: CycleValues, previous: CycleValues) -> bool:
    """Return whether two cycles have the same peak."""
    return abs(values.peak / previous.peak - 1) < CRITERIA.same_peak


def first_stable(values: Sequence[CycleValues]) -> int:
    """Return the number of the first stable cycle, or 0 if there is none.

    A stable cycle has the peak of the one before and nearly its stiffness, permanent strain and
    loss, see `CycleCriteria`.
    """
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
    """Return the first and last row of a history between crossings of the reference load.

    These are its first crossing on loading, and the one on the unloading after the last peak; the
    last row of the history if there is no such unloading.
    """
    history = evaluated.history
    reference = evaluated.reference
    first = evaluated.values[0].cycle.start
    last = evaluated.values[-1].cycle.peak
    start = first + passage(history.load[first:], history.strain[first:], reference)[0] + 1
    end = last + passage(history.load[last:], history.strain[last:], reference)[0]
    return start, end if end > last else len(history.load) - 1
