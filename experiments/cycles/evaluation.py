"""Evaluate load histories: tables of cycles, loops and holds, doubts, and fits of a law's memory.

Doubts are about slip and drift of the extensometer, conditioning, and scatter of specimens.
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

from ...errors import InputError
from ...lazy_modules import pandas as pd
from ...notes import Note, NoteKind, Objection, Verdict
from ...readers.histories import (
    Hold,
    LoadHistory,
    find_cycles,
    find_holds,
    passage,
    read_history,
)
from ...readers.units import unit_doubt
from ..data_files import READING
from .memory_fit import FittedCycles, fit_cycles, left_out
from .values import (
    CycleValues,
    EvaluatedHistory,
    evaluate_cycle,
    find_reference_load,
    first_stable,
    has_same_peak,
)

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


def _history_doubts(
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


def evaluate_history(history: LoadHistory, reference: float | None = None) -> EvaluatedHistory:
    """Evaluate all cycles of a load history: permanent strain, stiffness, energy loss, doubts.

    Parameters
    ----------
    history : LoadHistory
    reference : float, optional
        Reference load, N, which every branch has to cross; chosen above the ends of the branches
        unless given.

    Raises
    ------
    InputError
        If the load does not rise anywhere, or not every branch crosses the reference load.
    """
    found_cycles = find_cycles(history.load)
    if not found_cycles:
        raise InputError(history.path, "load", "no loading: the load does not rise anywhere")
    level = find_reference_load(history, found_cycles, reference)
    up = slice(found_cycles[0].start, found_cycles[0].peak + 1)
    zero = passage(history.load[up], history.strain[up], level)[1]
    values = [evaluate_cycle(history, cycle, level, zero) for cycle in found_cycles]
    stable = first_stable(values)
    notes = [Note(READING, words) for words in history.notes]
    for kind, words in _history_doubts(history, values, stable, level):
        notes.append(Note(kind, words, history.path.name))
    return EvaluatedHistory(
        history=history,
        reference=level,
        zero=zero,
        values=tuple(values),
        holds=tuple(find_holds(history, found_cycles)),
        stable_cycle=stable,
        notes=tuple(notes),
    )


@dataclass(frozen=True, eq=False)
class Cycles:
    """Load histories of several specimens with their evaluation, as tables and lines.

    Parameters
    ----------
    histories : tuple of EvaluatedHistory
        One history for each specimen.
    width : float or None
        Width of the specimens, mm; with it stiffness is given per width (N/mm).
    """

    histories: tuple[EvaluatedHistory, ...]
    width: float | None = None

    @property
    def notes(self) -> list[Note]:
        """Return the doubts of all histories."""
        return [note for evaluated in self.histories for note in evaluated.notes]

    @property
    def stiffness_unit(self) -> tuple[float, str]:
        """Return the factor and the unit with which stiffnesses (N) are shown."""
        return (1e-3, "kN") if self.width is None else (1.0 / self.width, "N/mm")

    @property
    def verdict(self) -> Verdict:
        """Return strain and stiffness of each specimen's conditioned, else last, cycle."""
        scale, unit = self.stiffness_unit
        words = []
        for evaluated in self.histories:
            v = evaluated.values[evaluated.stable_cycle - 1 if evaluated.stable_cycle else -1]
            words.append(
                f"in cycle {v.cycle.number} {evaluated.name} keeps {100 * v.permanent:.3g} % "
                f"strain and has a stiffness of {scale * v.EA_loading:.4g} {unit} on loading"
            )
        doubts = tuple(note.line for note in self.notes if note.kind != READING)
        is_conditioned = all(evaluated.stable_cycle for evaluated in self.histories)
        step = "load more cycles to the same peak: none yet repeats the one before"
        return Verdict(
            "usable within limits" if doubts else "usable",
            "; ".join(words),
            doubts,
            "" if is_conditioned else "the conditioned state",
            "" if is_conditioned else step,
        )

    @property
    def table(self) -> pd.DataFrame:
        """Return a row for each cycle: strains, stiffness (N, or N/mm with a width), energies.

        Columns that end in "_of_first" are ratios to the first cycle.
        """
        rows = [
            self._cycle_row(evaluated, v) for evaluated in self.histories for v in evaluated.values
        ]
        return pd.DataFrame(rows)

    def _cycle_row(self, evaluated: EvaluatedHistory, v: CycleValues) -> dict[str, Any]:
        """Return the columns of a cycle."""
        scale, unit = (1.0, "N") if self.width is None else (1.0 / self.width, "N_per_mm")
        first = evaluated.values[0]
        state = "conditioned" if v.cycle.number == evaluated.stable_cycle else ""
        row: dict[str, Any] = {
            "file": evaluated.history.path.name,
            "cycle": v.cycle.number,
            "state": "first" if v is first else state,
            "peak_N": v.peak,
            "reference_N": evaluated.reference,
            "strain_before": v.initial,
            "permanent_strain": v.permanent,
            "strain_at_peak": v.top,
        }
        for name in ("EA_loading", "EA_unloading", "secant_loading", "secant_unloading"):
            row[f"{name}_{unit}"] = scale * getattr(v, name)
        row["work_J_per_m"] = v.work
        row["loss_J_per_m"] = v.loss
        row["loss_ratio"] = v.loss / v.work
        for name in ("EA_loading", "EA_unloading", "loss"):
            row[f"{name}_of_first"] = getattr(v, name) / getattr(first, name)
        row["loading_N_per_s"], row["unloading_N_per_s"] = v.rate
        return row

    @property
    def loops(self) -> pd.DataFrame:
        """Return a row for each reading of every cycle; strain counts from the reference load."""
        tables = []
        for evaluated in self.histories:
            history = evaluated.history
            for v in evaluated.values:
                rows = np.arange(v.cycle.start, v.cycle.end + 1)
                table = pd.DataFrame({"cycle": v.cycle.number}, index=rows)
                table.insert(0, "file", history.path.name)
                table["branch"] = np.where(rows <= v.cycle.peak, "loading", "unloading")
                for name, reading in (("time_s", history.time), ("travel_mm", history.travel)):
                    table[name] = np.nan if reading is None else reading[rows]
                table["strain"] = history.strain[rows] - evaluated.zero
                table["load_N"] = history.load[rows]
                tables.append(table)
        return pd.concat(tables, ignore_index=True)

    @property
    def holds(self) -> pd.DataFrame:
        """Return a row for each hold: strain (creep) and load (relaxation).

        Each is given before and after the hold, and as its change per decade of time.
        """
        rows = [
            _hold_row(evaluated, hold) for evaluated in self.histories for hold in evaluated.holds
        ]
        return pd.DataFrame(rows)

    @cached_property
    def fits(self) -> tuple[FittedCycles, ...]:
        """Return for each history the loading curve and memory fitted to all its cycles."""
        return tuple(fit_cycles(evaluated) for evaluated in self.histories)

    @property
    def memory(self) -> pd.DataFrame:
        """Return a row for each history: the constants of its fitted memory and their sigma.

        Further columns are the RMS error, slips of the extensometer, and the tangent stiffness of
        the loading curve at its knots.
        """
        rows = []
        for evaluated, fitted in zip(self.histories, self.fits, strict=True):
            row: dict[str, Any] = {"file": evaluated.history.path.name, "rms_N": fitted.rms}
            for name, value, sigma in fitted.remembered:
                row |= {name: value, f"{name}_sigma": sigma}
            row |= {f"slip_{cycle}": value for cycle, value in fitted.slip.items()}
            for k, knot in enumerate(fitted.knots.tolist(), start=1):
                row |= {f"strain_{k}": knot, f"EA_{k}_N": float(fitted.stiffness[k - 1])}
            rows.append(row)
        return pd.DataFrame(rows)

    @cached_property
    def left_out(self) -> pd.DataFrame:
        """Return each cycle beside its prediction by a fit to the others, see `memory_fit`."""
        tables = [left_out(evaluated) for evaluated in self.histories]
        return pd.concat(tables, ignore_index=True)

    def fit_lines(self) -> list[str]:
        """Return the fits, and the cycles that were left out, as lines for the terminal."""
        lines = []
        for evaluated, fitted in zip(self.histories, self.fits, strict=True):
            constants = [f"{n} {v:.3g} +- {sigma:.2g}" for n, v, sigma in fitted.remembered]
            words = ", ".join(constants)
            slips = [f"{100 * slip:.2g} % before cycle {k}" for k, slip in fitted.slip.items()]
            if slips:
                words += f"; slip of the extensometer: {', '.join(slips)}"
            name = evaluated.history.path.name
            lines.append(f"{name}: memory: {words}; RMS error {fitted.rms:.3g} N")
        for row in self.left_out.to_dict("records"):
            loading = row["EA_loading_off_percent"]
            unloading = row["EA_unloading_off_percent"]
            lines.append(
                f"{row['file']}: cycle {row['cycle']} from the others: stiffness off by "
                f"{loading:+.2g} and {unloading:+.2g} % (loading, unloading), permanent strain by "
                f"{100 * row['permanent_strain_off']:+.2g} % of strain"
            )
        return lines

    def lines(self) -> list[str]:
        """Return the results as lines for the terminal."""
        scale, unit = self.stiffness_unit
        lines = []
        for evaluated in self.histories:
            name = evaluated.history.path.name
            lines.append(f"{name}: reference load {evaluated.reference:.4g} N")
            for v in evaluated.values:
                lines.append(
                    f"  cycle {v.cycle.number}, to {v.peak:.4g} N: permanent strain "
                    f"{100 * v.permanent:.3g} %, stiffness loading {scale * v.EA_loading:.4g}, "
                    f"unloading {scale * v.EA_unloading:.4g} {unit}, loss {v.loss:.3g} J/m "
                    f"({100 * v.loss / v.work:.2g} % of the work)"
                )
            stable = evaluated.stable_cycle
            first = evaluated.values[0]
            last = evaluated.values[stable - 1 if stable else -1]
            if last is not first:
                state = f"conditioned (cycle {stable})" if stable else "last cycle"
                ratio = last.EA_loading / first.EA_loading
                lines.append(f"  first loading beside {state}: stiffness 1 to {ratio:.3g}")
        return lines


def _hold_row(evaluated: EvaluatedHistory, hold: Hold) -> dict[str, Any]:
    """Return the columns of a hold."""
    history = evaluated.history
    rows = slice(hold.first, hold.last + 1)
    assert history.time is not None
    duration = history.time[rows] - history.time[hold.first]
    row: dict[str, Any] = {
        "file": history.path.name,
        "cycle": hold.cycle,
        "at": hold.position,
        "duration_s": float(duration[-1]),
    }
    readings = {"strain": history.strain[rows] - evaluated.zero, "load_N": history.load[rows]}
    for name, values in readings.items():
        # Readings at the time at which the hold begins have no place on a logarithmic scale.
        is_later = duration > 0
        slope = math.nan
        if len(np.unique(duration[is_later])) > 1:
            slope = np.polyfit(np.log10(duration[is_later]), values[is_later], 1)[0]
        row |= {
            f"{name}_before": values[0],
            f"{name}_after": values[-1],
            f"{name}_after_over_before": values[-1] / values[0],
            f"{name}_per_decade": float(slope),
        }
    return row


def cycles(
    files: Sequence[Path | str] | Path | str,
    *,
    reference_load: float | None = None,
    width: float | None = None,
    **reading: Any,
) -> Cycles:
    """Evaluate the load cycles in files.

    Parameters
    ----------
    files : path, or sequence of paths
        One file for each specimen.
    reference_load : float, optional
        Load, N, at which the permanent strain is read; unless given 1.5 times the highest load at
        which a branch begins or ends.
    width : float, optional
        Width of the specimens, mm; with it stiffness is given per width.
    **reading
        Options of `read_history`, such as `length` (mm), `columns` and units.

    Raises
    ------
    InputError
        If a number is not above 0 or is in another unit, or a file cannot be evaluated.
    """
    for name, value in (("reference_load", reference_load), ("width", width)):
        if value is not None and not value > 0:
            raise InputError(None, name, f"expected a number above 0, got {value:g}")
    for name, value in (("width", width), ("length", reading.get("length"))):
        if value is not None and (problem := unit_doubt("size", value, "mm", 1.0)):
            raise InputError(None, name, problem)
    paths = [files] if isinstance(files, (Path, str)) else list(files)
    if not paths:
        raise InputError(None, "files", "expected the files of load histories, got none")
    histories = [evaluate_history(read_history(p, **reading), reference_load) for p in paths]
    return Cycles(tuple(histories), width)
