"""Evaluation of load histories: permanent strain, stiffness and energy lost, cycle by cycle.

Strains count from the first passage upwards of the reference load, so that slack and the mounting
of the extensometer do not matter; work and loss are integrals of load over strain from there (J a
metre of specimen = N). Tangent stiffness is the slope of the least squares line of load over strain
between 40 and 90 % of the cycle's peak.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...errors import InputError, Note, NoteKind
from ...readers.histories import (
    Cycle,
    Hold,
    LoadHistory,
    find_cycles,
    find_holds,
    passage,
    read_history,
)
from ..kinds import READING

Array = NDArray[np.float64]
SLIP, DRIFT = NoteKind("extensometer slip", 3.0), NoteKind("extensometer drift", 2.0)
GRIPS, CHANGING = NoteKind("strain between grips", 1.0), NoteKind("not conditioned", 1.0)
#: Of a cycle's peak: the ends of the tangent stiffness.
RANGE = (0.4, 0.9)
#: Peaks that differ by less are the same; the reference load by the highest lower end.
SAME, ABOVE = 0.05, 1.5
#: A stable cycle: changes of stiffness, permanent strain (of that at the peak), loss (of the work).
CHANGES = {"EA_loading": 0.05, "permanent": 0.02, "loss": 0.03}
#: Strain that an extensometer loses for certain; share of the permanent strain that is drift.
LOST, MOST_DRIFT = 2e-4, 0.1
#: Of the ranges of load and travel: the machine does not move yet.
STILL = (1e-3, 3e-4)
#: Loads, of the peak, at which the branches of a loop are compared.
LEVELS = np.linspace(0.2, 0.95, 16)


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
        changes = {
            "EA_loading": abs(new.EA_loading / old.EA_loading - 1),
            "permanent": abs(new.permanent - old.permanent) / new.top if new.top > 0 else math.inf,
            "loss": abs(new.loss - old.loss) / new.work,
        }
        alike = abs(new.peak / old.peak - 1) < SAME
        if alike and all(changes[name] <= most for name, most in CHANGES.items()):
            return new.cycle.number
    return 0


def _doubts(history: LoadHistory, values: Sequence[CycleValues], stable: int) -> list[Note]:
    name, found = history.path.name, [Note(READING, words) for words in history.notes]
    for v in values:
        k = f"cycle {v.cycle.number}"
        if v.loss < 0:
            words = f"{k} is a negative loop ({v.loss:.3g} J/m): the extensometer slipped"
            found.append(Note(SLIP, words, name))
        elif v.crossing < -0.5 * LOST:
            words = (
                f"the branches of {k} cross: {-v.crossing:.2g} less strain on unloading than on "
                "loading at the same load; the extensometer slipped"
            )
            found.append(Note(SLIP, words, name))
    for old, new in pairwise(values):
        lost = old.top - new.top
        if abs(new.peak / old.peak - 1) < SAME and lost > LOST:
            moved = ""
            if history.travel is not None:
                way = float(history.travel[new.cycle.peak] - history.travel[old.cycle.peak])
                moved = f", the machine's travel {way:+.2g} mm more"
            words = (
                f"at the peak of cycle {new.cycle.number} {lost:.2g} less strain than in cycle "
                f"{old.cycle.number} at the same load{moved}: slip of the extensometer is suspected"
            )
            found.append(Note(SLIP, words, name))
    moved = np.abs(history.load - history.load[0]) > STILL[0] * np.ptp(history.load)
    if history.travel is not None:
        moved |= np.abs(history.travel - history.travel[0]) > STILL[1] * np.ptp(history.travel)
    first = int(np.argmax(moved))
    if history.time is not None and first > 5 and history.time[first] > history.time[0]:
        # Before the first loading the load stands still, and so should the strain.
        rest = slice(0, first)
        slope = np.polyfit(history.time[rest], history.strain[rest], 1)[0]
        whole = abs(float(slope) * np.ptp(history.time))
        kept = np.nanmax([abs(v.permanent) for v in values])
        if whole > MOST_DRIFT * kept:
            words = (
                f"the strain moves by {slope:.2g} a second before the load does, {whole:.2g} over "
                f"the test beside a permanent strain of {kept:.2g}: the extensometer drifts"
            )
            found.append(Note(DRIFT, words, name))
    if history.measured == "grips":
        words = "strains are travel of the machine: permanent strain holds the slip in the grips"
        found.append(Note(GRIPS, words, name))
    if not stable and len(values) > 1:
        words = "no cycle repeats the one before to the same peak: the state is not conditioned"
        found.append(Note(CHANGING, words, name))
    return found


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
    holds, doubts = tuple(find_holds(history, found)), tuple(_doubts(history, values, stable))
    return EvaluatedHistory(history, level, zero, tuple(values), holds, stable, doubts)


@dataclass(frozen=True, eq=False)
class Cycles:
    """Evaluated histories; width : mm, for stiffness per width (N/mm), or None."""

    histories: tuple[EvaluatedHistory, ...]
    width: float | None = None
    notes: list[Note] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "notes", [note for one in self.histories for note in one.notes])

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
    several = [files] if isinstance(files, (Path, str)) else list(files)
    if not several:
        raise InputError(None, "files", "expected the files of load histories, got none")
    found = [evaluate_history(read_history(p, **reading), reference_load) for p in several]
    return Cycles(tuple(found), width)
