"""Doubts about load histories: extensometer slip and drift, conditioning, scatter of specimens."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...notes import Note, NoteKind, Objection
from ...readers.histories import LoadHistory, passage
from .values import CycleValues, EvaluatedHistory, has_same_peak

SLIP = NoteKind(
    "extensometer slip",
    weight=11.5,
    objection=Objection("an extensometer slipped", "leave the cycles with slip out of the fit"),
)
DRIFT = NoteKind("extensometer drift", weight=2.0)
GRIPS = NoteKind("strain between grips", 1.0)
CHANGING = NoteKind("not conditioned", 1.0)
SCATTER = NoteKind("scatter between specimens", weight=1.5)

HistoryDoubt = tuple[NoteKind, str]


@dataclass(frozen=True)
class SlipLimits:
    """Limits beyond which an extensometer has slipped, or is suspected of it.

    The limits are from measurements on sixteen straps and cords. Twelve of them, which were not
    suspected of slip, lose up to 2.7 % of the strain at the peak from one cycle to the next. At
    loads not reached before, when grips settle, their extensometers show up to 22 % less strain
    than the machine's travel. Specimens with slip lose at least 4 % and 27 %.
    """

    negative_loss: float = 1e-3  # energy that a loop may gain by noise, over the work
    crossing: float = 1e-4  # strain by which the branches of a loop may cross
    strain: float = 2e-4  # loss of strain from one peak to the next of the same load that is noise
    peak_share: float = 0.035  # the same as a share of the strain at the peak
    travel_share: float = 0.25  # loss of strain over the strain by the machine's travel
    level: float = 0.2  # load from which travel and strain are compared, over the peak


@dataclass(frozen=True)
class DriftLimits:
    """Limits beyond which an extensometer drifts before the machine moves."""

    permanent_share: float = 0.1  # drift over the test, as a share of the permanent strain
    still_load: float = 1e-3  # change of load before the machine moves, over the range of loads
    still_travel: float = 3e-4  # change of travel before the machine moves, over its range
    min_readings: int = 5  # number of readings before the machine moves that is too few


SLIP_LIMITS, DRIFT_LIMITS = SlipLimits(), DriftLimits()


def history_doubts(
    history: LoadHistory,
    values: Sequence[CycleValues],
    stable: int,
    reference: float,
) -> Iterator[HistoryDoubt]:
    """Yield the doubts about a load history: each a kind of note, and words.

    Parameters
    ----------
    history : LoadHistory
    values : sequence of CycleValues
        Values of each cycle, in order.
    stable : int
        Number of the first stable cycle, or 0 if there is none.
    reference : float
        Reference load, N.
    """
    for v in values:
        yield from _loop_doubts(v)
    for previous, v in pairwise(values):
        yield from _peak_doubts(history, previous, v, reference)
    yield from _drift_doubts(history, values)
    if history.measured == "grips":
        words = "strains are travel of the machine: permanent strain holds the slip in the grips"
        yield GRIPS, words
    if not stable and len(values) > 1:
        words = "no cycle repeats the one before to the same peak: the state is not conditioned"
        yield CHANGING, words


def _loop_doubts(v: CycleValues) -> Iterator[HistoryDoubt]:
    """Yield slip within a cycle: a loop that gains energy, or branches that cross."""
    cycle = f"cycle {v.cycle.number}"
    if v.loss < -SLIP_LIMITS.negative_loss * v.work:
        yield SLIP, f"{cycle} is a negative loop ({v.loss:.3g} J/m): the extensometer slipped"
    elif v.crossing < -SLIP_LIMITS.crossing:
        words = (
            f"the branches of {cycle} cross: {-v.crossing:.2g} less strain on unloading than on "
            "loading at the same load; the extensometer slipped"
        )
        yield SLIP, words


def _peak_doubts(
    history: LoadHistory,
    previous: CycleValues,
    v: CycleValues,
    reference: float,
) -> Iterator[HistoryDoubt]:
    """Yield suspected slip: strain lost from one peak to the next, or beside the travel."""
    number = v.cycle.number
    lost_strain = previous.top - v.top
    noise = max(SLIP_LIMITS.strain, SLIP_LIMITS.peak_share * previous.top)
    if has_same_peak(v, previous) and lost_strain > noise:
        words = f"at the peak of cycle {number} {lost_strain:.2g} less strain than in cycle "
        words += f"{previous.cycle.number} at the same load"
        if history.travel is not None:
            travel = history.travel[v.cycle.peak] - history.travel[previous.cycle.peak]
            words += f", the machine's travel {float(travel):+.2g} mm more"
        yield SLIP, f"{words}: slip of the extensometer is suspected"
        return
    strains = _strains_of_loading(history, v, reference)
    if v.loss < -SLIP_LIMITS.negative_loss * v.work or math.isnan(v.loss) or strains is None:
        return
    by_travel, measured = strains
    if by_travel - measured > SLIP_LIMITS.travel_share * by_travel:
        words = (
            f"over the loading of cycle {number} the machine's travel makes "
            f"{by_travel:.3g} of strain, by the travel over strain of its unloading, and "
            f"the extensometer shows {measured:.3g}: slip of the extensometer is suspected"
        )
        yield SLIP, words


def _strains_of_loading(
    history: LoadHistory, values: CycleValues, reference: float
) -> tuple[float, float] | None:
    """Return the strain of a cycle's loading by the machine's travel, and by the extensometer.

    Travel is divided by the free length, which is travel over strain of the cycle's unloading:
    grips do not settle on it. None is returned without travel or without an unloading.
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


def _drift_doubts(history: LoadHistory, values: Sequence[CycleValues]) -> Iterator[HistoryDoubt]:
    """Yield drift: the strain changes before the first loading, while the load does not."""
    load = history.load
    travel = history.travel
    time = history.time
    is_still = np.abs(load - load[0]) <= DRIFT_LIMITS.still_load * np.ptp(load)
    if travel is not None:
        is_still &= np.abs(travel - travel[0]) <= DRIFT_LIMITS.still_travel * np.ptp(travel)
    count = int(np.argmin(is_still))
    if time is None or count <= DRIFT_LIMITS.min_readings or not time[count] > time[0]:
        return
    slope = np.polyfit(time[:count], history.strain[:count], 1)[0]
    drift = abs(float(slope) * np.ptp(time))
    permanent = np.nanmax([abs(v.permanent) for v in values])
    if drift > DRIFT_LIMITS.permanent_share * permanent:
        words = f"the strain moves by {slope:.2g} a second before the load does, {drift:.2g} "
        words += f"over the test beside a permanent strain of {permanent:.2g}"
        yield DRIFT, f"{words}: the extensometer drifts"


def scatter_notes(by_direction: Mapping[str, Sequence[EvaluatedHistory]]) -> list[Note]:
    """Return notes on the scatter of stiffness between specimens, which a fit's bands leave out.

    Parameters
    ----------
    by_direction : mapping of str to sequence of EvaluatedHistory
        Histories of the specimens of each direction.

    Returns
    -------
    list of Note
        A note for each direction: the largest difference between the stiffness of one specimen and
        the mean of the others, over the cycles that all specimens have.
    """
    notes = []
    for direction, specimens in by_direction.items():
        if len(specimens) == 1:
            words = (
                f"one specimen of the {direction}: how much specimens scatter is not known, and "
                "the bands of a fit do not hold it"
            )
            notes.append(Note(SCATTER, words))
            continue
        differences = _stiffness_differences(specimens)
        if differences:
            largest, deviation, number = max(differences)
            words = (
                f"{len(specimens)} specimens of the {direction} scatter: on loading in cycle "
                f"{number} the stiffness of one differs by {100 * largest:.2g} % from the mean of "
                f"the others (standard deviation {100 * deviation:.2g} %); the bands of a fit are "
                "of the law that all specimens share, and do not hold it"
            )
            notes.append(Note(SCATTER, words))
    return notes


def _stiffness_differences(
    specimens: Sequence[EvaluatedHistory],
) -> list[tuple[float, float, int]]:
    """Return the relative scatter of stiffness in each cycle that all specimens have.

    Each is the largest difference of one specimen from the mean of the others, the standard
    deviation, and the number of the cycle.
    """
    differences = []
    for values in zip(*(specimen.values for specimen in specimens), strict=False):
        stiffness = np.array([v.EA_loading for v in values])
        mean_of_others = (stiffness.sum() - stiffness) / (len(stiffness) - 1)
        deviation = float(stiffness.std(ddof=1) / stiffness.mean())
        largest = float(np.abs(stiffness / mean_of_others - 1.0).max())
        if not math.isnan(largest):
            differences.append((largest, deviation, values[0].cycle.number))
    return differences
