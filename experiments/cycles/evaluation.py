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
from ..kinds import READING, Array

SLIP = NoteKind(
    "extensometer slip",
    weight=11.5,
    against=Against("an extensometer slipped", "leave the cycles with slip out of the fit"),
)
DRIFT = NoteKind("extensometer drift", weight=2.0)
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
        most = {"EA_loading": old.EA_loading, "permanent": new.top, "loss": new.work}
        changes = [
            abs(getattr(new, name) - getattr(old, name)) <= CHANGES[name] * of
            for name, of in most.items()
        ]
        if all(changes) and abs(new.peak / old.peak - 1) < SAME:
            return new.cycle.number
    return 0


def _doubts(
    history: LoadHistory, values: Sequence[CycleValues], stable: int
) -> Iterator[tuple[NoteKind, str]]:
    for v in values:
        k = f"cycle {v.cycle.number}"
        if v.loss < 0:
            yield SLIP, f"{k} is a negative loop ({v.loss:.3g} J/m): the extensometer slipped"
        elif v.crossing < -0.5 * LOST:
            words = (
                f"the branches of {k} cross: {-v.crossing:.2g} less strain on unloading than on "
            )
            yield SLIP, words + "loading at the same load; the extensometer slipped"
    for old, new in pairwise(values):
        lost = old.top - new.top
        if abs(new.peak / old.peak - 1) < SAME and lost > LOST:
            words = f"at the peak of cycle {new.cycle.number} {lost:.2g} less strain than in cycle "
            words += f"{old.cycle.number} at the same load"
            if history.travel is not None:
                way = float(history.travel[new.cycle.peak] - history.travel[old.cycle.peak])
                words += f", the machine's travel {way:+.2g} mm more"
            yield SLIP, f"{words}: slip of the extensometer is suspected"
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
    doubts = _doubts(history, values, stable)
    notes += [Note(kind, words, history.path.name) for kind, words in doubts]
    holds = tuple(find_holds(history, found))
    return EvaluatedHistory(history, level, zero, tuple(values), holds, stable, tuple(notes))


#: Knots of the tangent of a loading curve; its bounds, of the mean stiffness; largest U and R; of
#: the largest strain, least and most slip, and a step; points along a branch that is predicted.
KNOTS, BOUNDS, MOST, SLIPS, STEP, FINE = 8, (1e-4, 1e2), 1.99, (-0.1, 0.3), 1e-7, 400


@dataclass(frozen=True, eq=False)
class FittedCycles:
    """A loading curve with unloading and reloading, fitted to a history (`materials/memory.py`).

    knots (k,) strains and stiffness (k,) N, the tangent of the loading curve there, above the
    reference load; memory (4,) : set, unloading, reloading, saturation, in the order of
    `memory.QUANTITIES`; slip : strain that the extensometer lost before each later cycle; sigma
    (k + 4 + slips,) one standard deviation each, of independent readings. rows : readings that are
    followed, at strains of the law; load : modelled, N. rms : N, of those that were fitted.
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
        """Return strain and load of a loading to a peak (N) and of the unloading after it.

        before : number of the readings that precede it. Only the load is given, as to a machine;
        level : N, at which strains and loads of the law begin.
        """
        path, found = self.strain[:before], list[Array]()
        for end in (self.law.strain_range[0], 0.0):
            way = np.linspace(path[-1], end, FINE)
            load = _stress(self.law, np.r_[path, way[1:]])[len(path) - 1 :] + level
            i, turn = passage(load, way, peak if end else -np.inf)
            if i >= 0:
                way, load = np.r_[way[: i + 1], turn], np.r_[load[: i + 1], peak]
            found += [way, load]
            path = np.r_[path, way[1:]]
        return tuple(found)


def _stress(law: HypoelasticLaw, strain: Array) -> Array:
    return own_stress(law.pieces, law.coupling, 0, strain, *law_slopes(law, [], 1.0))[0]


def matched_rows(one: EvaluatedHistory) -> tuple[int, int]:
    """Return first and last row, from the first passage of the reference load to the last."""
    h, first, last = one.history, one.values[0].cycle.start, one.values[-1].cycle.peak
    start = first + passage(h.load[first:], h.strain[first:], one.reference)[0] + 1
    end = last + passage(h.load[last:], h.strain[last:], one.reference)[0]
    return start, end if end > last else len(h.load) - 1


def fit_cycles(one: EvaluatedHistory, knots: int = KNOTS, leave: int = 0) -> FittedCycles:
    """Fit a loading curve and a memory to all cycles but `leave`; each branch has one weight.

    The readings count from the first passage of the reference load to the last, in strain and load.
    What an extensometer has lost by slip before a later cycle is an unknown; a cycle that is left
    out has that of the next one.
    """
    h, values, level = one.history, one.values, one.reference
    last, (start, end) = len(values), matched_rows(one)
    rows = np.arange(start, end + 1)
    strain, load = h.strain[rows] - one.zero, h.load[rows] - level
    number = np.searchsorted([v.cycle.start for v in values], rows, "right")
    weight, none = np.zeros(len(rows)), [0.0, 1.0]
    for v in values:
        for side in (rows < v.cycle.peak, rows >= v.cycle.peak):
            own = side & (number == v.cycle.number) & (v.cycle.number != leave)
            weight[own] = 1.0 / (v.peak * math.sqrt(max(int(own.sum()), 1)))
    slipped = [k for k in range(2, last + 1) if k != (leave if leave == last else leave + 1)]
    later = (number[:, None] >= slipped).astype(float)
    top = float(strain[weight > 0].max())
    form = Spline.at([np.linspace(0.0, top, knots).tolist(), none, none])
    free = [form.size - knots + k for k in range(knots)]  # E1 comes last
    names = [*(f"beta_{i}" for i in free), *NAMES[: len(QUANTITIES)]]
    mean, shared = float(load.max()) / top, knots + len(QUANTITIES)

    def law_at(x: Array) -> HypoelasticLaw:
        # By the share of U - 1 that R - 1 is, so that R stays below U; strains over the largest.
        kept, up, share, fade = x[knots:shared]
        memory = Memory.of([kept, up, 1.0 + share * (up - 1.0), fade / top, *[0, 1, 1, 0] * 2])
        beta = np.r_[np.full(form.size - knots, mean), mean * x[:knots]]
        return HypoelasticLaw(beta, 0.0, np.array([top, 1, 1]), form=form, memory=memory)

    def strain_at(x: Array) -> Array:
        return np.maximum(strain + top * later @ x[shared:], 0.0)

    def slopes(x: Array) -> Array:
        law, moved = law_at(x), strain_at(x)
        by = own_stress(law.pieces, law.coupling, 0, moved, *law_slopes(law, names, 1.0))[1]
        up, share = x[knots + 1 : knots + 3]
        chain = np.diag([*[mean] * knots, 1.0, 1.0, up - 1.0, 1.0 / top])
        chain[knots + 2, knots + 1] = share
        ends = [[_stress(law, strain_at(x + s * e)) for s in (STEP, -STEP)]
                for e in np.eye(len(x))[shared:]]  # fmt: skip
        of_slip = [(a - b) / (2 * STEP) for a, b in ends]
        return weight[:, None] * np.column_stack([by @ chain, *of_slip])

    many = len(slipped)
    low = [*[BOUNDS[0]] * knots, 0.0, 1.0, 0.0, 0.0, *[SLIPS[0]] * many]
    high = [*[BOUNDS[1]] * knots, 0.99, MOST, 1.0, 100.0, *[SLIPS[1]] * many]
    begin = [*[1.0] * knots, 0.3, 1.4, 0.4, 0.1, *[0.0] * many]
    best = scipy.optimize.least_squares(
        lambda x: weight * (_stress(law_at(x), strain_at(x)) - load), begin, slopes,
        bounds=(low, high), xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=400,
    )  # fmt: skip
    law, moved, fitted = law_at(best.x), strain_at(best.x), weight > 0
    found = _stress(law, moved)
    spread = 2 * best.cost / max(int(fitted.sum()) - len(begin), 1)
    up = best.x[knots + 1]
    scale = np.r_[np.full(knots, mean), 1.0, 1.0, up - 1.0, 1.0 / top, np.full(many, top)]
    sigma = scale * np.sqrt(spread * np.diag(np.linalg.pinv(best.jac.T @ best.jac)))
    rms = float(np.sqrt(np.mean((found - load)[fitted] ** 2)))
    slip = dict(zip(slipped, (top * best.x[shared:]).tolist(), strict=True))
    memory = np.array(law.memory.constants[: len(QUANTITIES)]) if law.memory else np.empty(0)
    return FittedCycles(
        np.array(form.knots[0]), mean * best.x[:knots], memory, slip, sigma, rows, moved,
        found + level, rms, law,
    )  # fmt: skip


def left_out(one: EvaluatedHistory, knots: int = KNOTS) -> pd.DataFrame:
    """Return each cycle beside its prediction by a fit to the others: a row a cycle.

    Predicted are strains at the loads, as a machine that follows loads would find them: stiffness
    and permanent strain, without slip. A cycle that alone reaches its load, and the first, have no
    others that could predict them.
    """
    table = []
    for v in one.values:
        number = v.cycle.number
        others = [w.peak for w in one.values if w is not v]
        if number == 1 or v.peak > (1 + SAME) * max(others) or math.isnan(v.permanent):
            continue
        fitted = fit_cycles(one, knots, leave=number)
        before = int(np.searchsorted(fitted.rows, v.cycle.start))
        up, rising, down, falling = fitted.driven(before, v.peak, one.reference)
        row: dict[str, Any] = {"file": one.history.path.name, "cycle": number}
        for name, way, load in (("EA_loading", up, rising), ("EA_unloading", down, falling)):
            predicted = _slope(load, way, v.peak)
            row |= {f"{name}_N": getattr(v, name), f"{name}_predicted_N": predicted}
            row[f"{name}_off_percent"] = 100 * (predicted / getattr(v, name) - 1)
        kept = passage(falling, down, one.reference)[1]
        row |= {"permanent_strain": v.permanent, "permanent_strain_predicted": kept}
        table.append(row | {"permanent_strain_off": kept - v.permanent})
    return pd.DataFrame(table)


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
    several = [files] if isinstance(files, (Path, str)) else list(files)
    if not several:
        raise InputError(None, "files", "expected the files of load histories, got none")
    found = [evaluate_history(read_history(p, **reading), reference_load) for p in several]
    return Cycles(tuple(found), width)
