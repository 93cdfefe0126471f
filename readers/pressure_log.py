"""Pressures of a camera's frames: in the names of files, in files, by a log with its own clock.

At the right offset of the clocks, heights and pressures are rising functions of each other; at a
wrong one not, wherever the pressure was held, released or raised unevenly. Both functions are found
by isotonic regression, the sheet at rest at the least pressure of the log.

Outline: the log, heights, offset of the clocks, choice of frames, numbers in names and in files.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from ..errors import InputError
from ..files import ends
from . import tables
from .frames import Array, Frame, heading_of
from .histories import Which, branches_of
from .machine_tables import AS_FOUND, Channel, TableOptions, in_unit, read_machine_table
from .text_frames import SEPARATORS, TOP, Lines, cells_of

#: The apex of a frame is what moved most; so large a share of the points moved less, lest a stray
#: point be it.
APEX = 0.98


def read_pressure_log(
    path: Path,
    of_pressure: Channel = AS_FOUND,
    of_time: Channel = AS_FOUND,
    format: str | None = None,
    comment: str = "#",
    decimal: str | None = None,
) -> tuple[Array, Array]:
    """Return times (k,) s, rising, and pressures (k,) MPa of a log: a machine's table, or volts."""
    channels = {"time": of_time, "pressure": of_pressure}
    named = {key: c.column for key, c in channels.items() if c.column is not None}
    asked = TableOptions(named, ("time", "pressure"), comment, decimal)
    found = read_machine_table(path, asked, format)
    column = found.column("time")
    pressure = found.values(found.column("pressure"), tables.PRESSURE_UNITS, of_pressure)
    time = found.values(column, tables.TIME_UNITS, of_time)
    back = np.flatnonzero(np.diff(time) < 0)
    if len(back):
        at = f"line {found.table.lines[back[0] + 1]}, column {column!r}"
        raise InputError(path, at, "times must not go back; is this the log of one test?")
    if len(time) < 2 or not time[-1] > time[0]:
        raise InputError(path, f"column {column!r}", "expected readings at two times or more")
    return time, pressure


def apex_height(frame: Frame) -> float:
    """Return the distance (mm) that the apex of a frame has moved; NaN if unknown."""
    moved = np.linalg.norm(frame.displacement, axis=1)
    moved = moved[np.isfinite(moved)]
    return float(np.quantile(moved, APEX)) if len(moved) else float("nan")


#: So many frames tell something, and so large a share of them lies within the log.
LEAST_FRAMES, WITHIN = 6, 0.8
#: Heights to one of these powers go nearly straight with the pressures, those of a sheet that was
#: taut or flat, so that noise counts alike all along; any rising function of them would do.
POWERS = (1, 2, 3)


def straightest(h: Array, pressures: Sequence[Array]) -> int:
    """Return the power of the heights that correlates best with the pressures at any offset."""
    best = {}
    for power in POWERS:
        raised = h**power
        best[power] = 0.0
        for p in pressures:
            inside = np.isfinite(p)
            x = raised[inside] - raised[inside].mean()
            y = p[inside] - p[inside].mean()
            size = float(np.sqrt((x @ x) * (y @ y)))
            if inside.sum() >= max(LEAST_FRAMES, WITHIN * len(h) - 1) and size > 0:
                best[power] = max(best[power], float(x @ y) / size)
    return max(best, key=lambda power: best[power])


def misfit_of(p: Array, h: Array, rest: float) -> float:
    """Return the share of variance that rising functions leave, 1 without variance."""
    inside = np.isfinite(p)
    if inside.sum() < max(LEAST_FRAMES, WITHIN * len(h) - 1):
        return 1.0
    p = p[inside]
    h = h[inside]
    # The state of rest weighs as much as all frames together, in the functions only.
    anchored = (p, h, rest, 0.0), (h, p, 0.0, rest)
    return sum(_left_over(*one) for one in anchored) / 2


def _left_over(x: Array, y: Array, x_rest: float, y_rest: float) -> float:
    """Return share of the variance of y that no rising function of x through the rest explains."""
    total = float(np.sum((y - y.mean()) ** 2))
    if not total > 0:
        return 1.0
    weight = np.append(np.ones(len(x)), float(len(x)))
    all_x = np.append(x, x_rest)
    all_y = np.append(y, y_rest)
    # A function has one value where x has one: readings of one pressure are put together.
    which = np.unique(all_x, return_inverse=True)[1]
    sums = np.bincount(which, weight)
    means = np.bincount(which, weight * all_y) / sums
    rising = scipy.optimize.isotonic_regression(means, weights=sums).x
    return float(np.sum((y - rising[which[:-1]]) ** 2)) / total


#: Offsets looked at: half a frame apart, no more than so many; then finer about the best.
MOST, FINE = 20_000, 20
#: Frames are at rest within so many standard deviations of the lowest, and below this share of the
#: most; share of the log that is below its least pressure, by noise.
SIGMAS, AT_REST, BELOW = 6.0, 0.02, 0.01


def log_at(offset: float, times: Array, log_times: Array, pressures: Array) -> Array:
    """Return (frames,) MPa, the log's pressures at an offset (s); NaN beyond the log."""
    return np.interp(times + offset, log_times, pressures, left=np.nan, right=np.nan)


def offset_misfits(
    times: Array, heights: Array, log_times: Array, pressures: Array
) -> tuple[Array, Array]:
    """Return offsets (s), rising, closer together about the best; and the misfit at each."""
    order = np.argsort(times, kind="stable")
    t = times[order]
    h = heights[order]
    h = np.where(h > _rest_height(h), h, 0.0)
    rest = float(np.quantile(pressures, BELOW))
    coarse = _offsets(t, log_times)
    h = h ** straightest(h, [log_at(s, t, log_times, pressures) for s in coarse])

    def misfits_at(offsets: Array) -> Array:
        each = [misfit_of(log_at(s, t, log_times, pressures), h, rest) for s in offsets]
        return np.array(each)

    misfits = misfits_at(coarse)
    step = coarse[1] - coarse[0]
    fine = coarse[np.argmin(misfits)] + step * np.linspace(-2, 2, 4 * FINE + 1)
    fine = fine[(fine >= coarse[0]) & (fine <= coarse[-1])]
    offsets = np.concatenate([coarse, fine])
    misfits = np.append(misfits, misfits_at(fine))
    order = np.argsort(offsets, kind="stable")
    return offsets[order], misfits[order]


def _offsets(t: Array, log_times: Array) -> Array:
    """Return the offsets at which enough frames lie within the log, half a frame apart."""
    enough = int(np.ceil(WITHIN * len(t)))
    least = log_times[0] - t[len(t) - enough]
    most = log_times[-1] - t[enough - 1]
    if least > most:
        lasts = f"the log lasts {np.ptp(log_times):g} s, the frames {np.ptp(t):g} s"
        raise InputError(None, "", f"{lasts}; are the units of time and the rate right?")
    gaps = np.diff(t)
    step = float(np.median(gaps[gaps > 0])) / 2 if (gaps > 0).any() else most - least
    return np.linspace(least, most, 2 + int(min((most - least) / step if step else 0, MOST)))


def _rest_height(h: Array) -> float:
    """Return the height up to which a frame is at rest, from the noise between frames."""
    noise = float(np.median(np.abs(np.diff(h, 2)))) / 0.6745 / np.sqrt(6)
    return min(float(h.min()) + SIGMAS * noise, AT_REST * float(h.max()))


#: Noise that no measurement is without, as a share of the variance: 0.1 % of the amplitude. Offsets
#: of a misfit up to so many times the smallest may be the right one.
FLOOR, AS_GOOD = 1e-6, 2.0
#: Misfit above which the heights do not follow the pressures; mean doubt of the frames' pressures,
#: as a share of their range, above which the offset is not known.
WORST_MISFIT, MOST_DOUBT = 0.05, 0.015


@dataclass(frozen=True, eq=False)
class ClockOffset:
    """The log's clock less that of the frames, s; lower, upper : of those that may be right.

    misfit : share of variance unexplained, None where given. pressure, doubt (half its range) :
    (frames,) MPa, NaN beyond the log. times, heights : (frames,) s and mm.
    """

    offset: float
    lower: float
    upper: float
    misfit: float | None
    pressure: Array
    doubt: Array
    times: Array
    heights: Array


def given_offset(
    offset: float, times: Array, heights: Array, log_times: Array, pressures: Array
) -> ClockOffset:
    """Return the pressures of frames by a clock offset (s) that is known; else as `find_offset`."""
    there = log_at(offset, times, log_times, pressures)
    if not np.isfinite(there).any():
        problem = (
            f"no frame lies within the log: frames from {times.min() + offset:.2f} to"
            f" {times.max() + offset:.2f} s by its clock, the log from {log_times[0]:.2f} to"
            f" {log_times[-1]:.2f} s"
        )
        raise InputError(None, "offset", problem)
    none = np.zeros(len(times))
    return ClockOffset(offset, offset, offset, None, there, none, times, heights)


def find_offset(times: Array, heights: Array, log_times: Array, pressures: Array) -> ClockOffset:
    """Return the offset at which heights rise with the pressures; one that is certain."""
    known = np.isfinite(heights)
    if known.sum() < LEAST_FRAMES:
        problem = f"{known.sum()} frames are too few to find it by; give it in s"
        raise InputError(None, "offset", problem)
    offsets, misfits = offset_misfits(times[known], heights[known], log_times, pressures)
    best = int(np.argmin(misfits))
    if misfits[best] > WORST_MISFIT:
        problem = (
            f"at no offset does the sheet rise with the pressure: at best, {offsets[best]:.2f} s,"
            f" {misfits[best]:.0%} of the variance is left; are these the log and the frames of one"
            " test, and their times right? else give the offset in s"
        )
        raise InputError(None, "offset", problem)
    able = misfits <= AS_GOOD * max(misfits[best], FLOOR)
    unable = np.flatnonzero(~able)
    first = unable[unable < best].max(initial=-1) + 1
    last = unable[unable > best].min(initial=len(able)) - 1
    offset = float(offsets[first] + offsets[last]) / 2
    may_be = offsets[able]
    some = np.append(may_be[:: max(1, len(may_be) // 200)], may_be[-1])
    each = np.array([log_at(s, times, log_times, pressures) for s in some])
    there = log_at(offset, times, log_times, pressures)
    inside = np.isfinite(each)
    most = np.where(inside, each, -np.inf)
    least = np.where(inside, each, np.inf)
    some = inside.any(axis=0)
    doubt = np.full(each.shape[1], np.nan)
    doubt[some] = (most.max(axis=0) - least.min(axis=0))[some] / 2
    mean = float(np.nanmean(doubt))
    if mean > MOST_DOUBT * float(np.ptp(there[np.isfinite(there)])):
        problem = (
            f"cannot be found: offsets from {may_be[0]:.2f} to {may_be[-1]:.2f} s do as well, and"
            f" leave the frames' pressures uncertain by {1e3 * mean:.3g} kPa on"
            " average; give it in s. Where the pressure was held, released or began to rise while"
            " frames were taken, it can be found"
        )
        raise InputError(None, "offset", problem)
    lower = float(may_be[0])
    upper = float(may_be[-1])
    return ClockOffset(offset, lower, upper, float(misfits[best]), there, doubt, times, heights)


#: Why frames are not looked at.
BEYOND, AT_REST_FRAME_CHOICE = "without a pressure: beyond the log", "at no pressure"
RELEASED, REPEATED = "after the largest pressure", "at a pressure that another frame has"
OTHER = "of another inflation"
#: Pressures that differ by less than this share of the largest are one; how far from an asked
#: pressure a frame may be, as a share of the largest asked one.
SAME, TOLERANCE = 1e-6, 0.02


def choose_frames(
    pressures: Array,
    asked: Sequence[float] | None = None,
    count: int | None = None,
    tolerance: float | None = None,
    inflation: Which | None = None,
) -> tuple[tuple[int, ...], dict[str, int]]:
    """Choose the frame nearest to each pressure, or `count` evenly spread ones, or all.

    Returns their numbers, by rising pressure, and counts of the others by reason.
    asked, tolerance (2 % of the largest asked unless given) : MPa. inflation : of frames in order
    of time, without releases; "all": every inflation and release, `count` of each.
    """
    known = np.isfinite(pressures)
    left_out = {}
    able = known & (np.nan_to_num(pressures) > 0)
    left_out[BEYOND] = int((~known).sum())
    left_out[AT_REST_FRAME_CHOICE] = int((known & ~able).sum())
    if not able.any():
        raise InputError(None, "", f"none of the {len(pressures)} frames is under pressure")
    found = [np.arange(len(pressures))] if inflation is None else branches_of(pressures)
    branches = [branch[able[branch]] for branch in found]
    if isinstance(inflation, int):
        if 2 * inflation > len(branches) + 1:
            problem = f"{(len(branches) + 1) // 2} are in the frames, number {inflation} is not"
            raise InputError(None, "inflation", problem)
        release = branches[2 * inflation - 1 : 2 * inflation]
        branches = branches[2 * inflation - 2 : 2 * inflation - 1]
        left_out[RELEASED] = sum(map(len, release))
        left_out[OTHER] = int(able.sum()) - len(branches[0]) - left_out[RELEASED]
    frames = list[int]()
    left_out[REPEATED] = 0
    for k, branch in enumerate(branches):
        order = branch[np.argsort(pressures[branch], kind="stable")]
        if asked is not None:
            frames += _nearest(pressures, order, asked, tolerance)
            continue
        last = pressures[frames[-1]] if frames else -np.inf
        apart = np.diff(pressures[order], prepend=-np.inf) > SAME * np.nanmax(pressures)
        apart &= np.abs(pressures[order] - last) > SAME * np.nanmax(pressures)
        left_out[REPEATED], order = left_out[REPEATED] + int((~apart).sum()), order[apart]
        own = order.tolist() if count is None else _spread(pressures, order, count)
        frames += own[::-1] if k % 2 else own
    return tuple(frames), {why: n for why, n in left_out.items() if n}


def _nearest(
    pressures: Array, able: NDArray[np.intp], asked: Sequence[float], tolerance: float | None
) -> list[int]:
    limit = TOLERANCE * max(asked) if tolerance is None else tolerance
    taken: list[int] = []
    for number, wanted in enumerate(asked):
        off = np.abs(pressures[able] - wanted)
        frame = int(able[np.argmin(off)])
        there = f"{1e3 * pressures[frame]:.4g} kPa"
        if off.min() > limit * (1 + 1e-9):
            problem = (
                f"no frame within {1e3 * limit:.3g} kPa of {1e3 * wanted:.4g} kPa; the nearest was"
                f" recorded at {there}: ask for that, or say a larger tolerance"
            )
            raise InputError(None, f"pressures[{number}]", problem)
        if frame in taken:
            first = asked[taken.index(frame)]
            problem = (
                f"the frame at {there} is the nearest to {1e3 * first:.4g} and to"
                f" {1e3 * wanted:.4g} kPa; ask for one of them"
            )
            raise InputError(None, f"pressures[{number}]", problem)
        taken.append(frame)
    return taken


def _spread(pressures: Array, able: NDArray[np.intp], count: int) -> list[int]:
    if len(able) < count:
        problem = f"expected at most the {len(able)} frames at pressures of their own, got {count}"
        raise InputError(None, "frames", problem)
    levels = pressures[able[-1]] * np.arange(1, count + 1) / count
    taken: list[int] = []
    for number, level in enumerate(levels):
        # Each takes a frame above the one before, and leaves one for each that follows.
        first = 1 + int(np.flatnonzero(able == taken[-1])[0]) if taken else 0
        free = able[first : len(able) - (count - 1 - number)]
        taken.append(int(free[np.argmin(np.abs(pressures[free] - level))]))
    return taken


#: One repeat in a pattern ends soon on any name; of several it is seen whether they do (s).
SEARCH_SECONDS = 5.0
_REPEATS = re.compile(r"[*+?{]")
#: Without a sign: in a name it is a dash.
_UNSIGNED = r"\d+(?:[.,]\d+)?"


def _searched(pattern: str, path: Path) -> re.Match[str] | None:
    return re.search(pattern, path.name)


def number_in_name(
    path: Path,
    units: Mapping[str, float],
    pattern: str | None = None,
    unit: str | None = None,
    field: str = "",
) -> float:
    """Return the number in a file's name (by `pattern`, else before a unit) by its unit."""
    if pattern is not None:
        hard = len(_REPEATS.findall(pattern)) > 1
        if hard and not ends(partial(_searched, pattern, path), SEARCH_SECONDS):
            problem = f"the pattern {pattern!r} takes too long; repeat (+, *) less in it"
            raise InputError(path, field, problem)
        found = _searched(pattern, path)
        if found is None:
            raise InputError(path, field, f"the file's name does not fit the pattern {pattern!r}")
        try:
            return _float(found[1] or "") * (1.0 if unit is None else units[unit])
        except ValueError:
            problem = f"expected a number in the group of {pattern!r}, found {found[1]!r}"
            raise InputError(path, field, problem) from None
    known = "|".join(sorted(units, key=len, reverse=True))
    # A letter after the unit makes it a word: "12max" is not 12 m.
    every = re.findall(rf"({_UNSIGNED})[ _]?({known})(?![^\W\d_])", path.stem)
    if len(every) != 1:
        seen = " and ".join(f"{number} {name}" for number, name in every) or "none"
        problem = (
            f"expected one number with its unit ({', '.join(units)}) in the file's name, found "
            f"{seen}; a pattern with one group says where it is"
        )
        raise InputError(path, field, problem)
    number, name = every[0]
    return _float(number) * units[name]


def _float(cell: str) -> float:
    return float(cell.replace(",", "."))


#: A pressure in a file's name, which is no number of a picture.
_PRESSURE = re.compile(rf"{_UNSIGNED}[ _]?({'|'.join(tables.PRESSURE_UNITS)})(?![^\W\d_])")
#: So many missing numbers are named.
FEW_NUMBERS = 5


def picture_numbers(
    files: Sequence[Path], own: Sequence[float | None], by_trigger: bool = False
) -> tuple[Array, list[str]]:
    """Return numbers (frames,) of the pictures from 0, `own` or in the names; doubts of them.
    by_trigger : whether the offset of the clocks is given, so that the first frame's time counts.
    """
    rising = [np.array(own, dtype=float)] if None not in own else []
    if not rising and len(files) == len(own):
        bare = [_PRESSURE.sub("", str(file.with_suffix(""))) for file in files]
        found = [[float(digits) for digits in re.findall(r"\d+", name)] for name in bare]
        every = map(np.array, zip(*found, strict=False))
        rising = [one for one in every if (np.diff(one) >= 0).all() and one[-1] > one[0]]
    if not rising:
        return np.arange(len(own), dtype=float), []
    # Of several, those that rise at every frame, and by least: a counter, no time of the day.
    numbers = min(rising, key=lambda one: ((np.diff(one) <= 0).sum(), one[-1] - one[0]))
    steps = np.diff(numbers)
    said = []
    usual = float(np.median(steps[steps > 0]))
    missing = np.setdiff1d(np.arange(numbers[0], numbers[-1], usual), numbers)
    seen = f"the frames' numbers, {numbers[0]:.10g} to {numbers[-1]:.10g},"
    how = "times are numbers over 'rate'; time_in_name = false counts the frames instead"
    if usual != 1:
        said.append(f"{seen} go up by {usual:g}: {how}")
    if (steps > usual).any():
        few = ", ".join(f"{n:.10g}" for n in missing[:FEW_NUMBERS]) or "unevenly"
        more = ", ..." if len(missing) > FEW_NUMBERS else ""
        said.append(f"{seen} leave out {len(missing)} ({few}{more}): {how}")
    if (steps <= 0).any():
        again = ", ".join(f"{n:.10g}" for n in np.unique(numbers[1:][steps <= 0])[:FEW_NUMBERS])
        said.append(f"{seen} come again ({again}): two frames of one time; {how}")
    if by_trigger and numbers[0] not in (0, 1):
        said.append(f"{seen} are times from the first: the given offset is the log's time of it")
    return numbers - numbers[0], said


def check_pattern(pattern: str) -> str | None:
    """Return the fault of a pattern, None where there is none."""
    try:
        groups = re.compile(pattern).groups
    except re.error as error:
        return f"is no regular expression ({error}): {pattern!r}"
    if groups != 1:
        return f"expected one group, in brackets, around the number; {pattern!r} has {groups}"
    return None


#: Units of readings that a scale makes something of; letters of a line that are looked at.
VOLTS, LONGEST = ("V", "mV"), 1000


def values_in_file(path: Path, channel: Channel, units: Mapping[str, float]) -> Array:
    """Return what `channel.column` names: a column, or a line above the numbers."""
    name = channel.column or ""
    # With comments: a value may stand in one.
    lines = tables.read_lines(path, "", any_encoding=True)
    found = _in_column(path, lines, name) or _above(path, lines, name, (*units, *VOLTS))
    if found is None:
        says = f"neither a column {name!r} nor a line above the numbers that says {name!r}"
        raise InputError(path, "", f"{says} and a value")
    values, unit, at = found
    return in_unit(np.array(values), unit, channel, units, path, at)


def _in_column(path: Path, lines: Lines, name: str) -> tuple[list[float], str, str] | None:
    for separator in SEPARATORS:
        for index, (number, text) in enumerate(lines[:TOP]):
            if name not in text:
                continue
            names = [cell.lstrip("# ") for cell in cells_of(text, separator) or []]
            where = [
                i for i, cell in enumerate(names) if name in (cell, tables.split_unit(cell)[0])
            ]
            below = [cells_of(text, separator) or [] for _, text in lines[index + 1 : index + 3]]
            header = 2 <= len(names) <= tables.MOST_NAMES and not any(map(tables.is_number, names))
            if not header or not any(
                len(row) >= len(names) - 1 and 2 * sum(map(tables.is_number, row)) >= len(names)
                for row in below
            ):
                continue
            if len(where) > 1:
                problem = f"{len(where)} columns are called {name!r}"
                raise InputError(path, f"line {number}", problem)
            if where:
                frame = [i for i, cell in enumerate(names) if heading_of(cell).quantity == "frame"]
                at = where[0], frame[0] if len(frame) == 1 else None
                return _constants(path, lines[index:], separator, names[where[0]], *at)
    return None


def _constants(
    path: Path, lines: Lines, separator: str | None, name: str, column: int, frame: int | None
) -> tuple[list[float], str, str]:
    """Return a column's value in each frame (`frame`: column of its number), its unit and place."""
    unit = tables.split_unit(name)[1]
    head = lines[0][0]
    found: dict[float, tuple[float, int]] = {}
    for number, text in lines[1:]:
        row = cells_of(text, separator) or []
        cell = row[column] if column < len(row) else ""
        at = f"line {number}, column {name!r}"
        key = "0" if frame is None or frame >= len(row) else row[frame]
        first = found.get(_float(key)) if tables.is_number(key) else None
        if not tables.is_number(cell):
            # The row of units stands right below the names.
            if not found and number <= head + 2 and cell:
                unit = cell.strip("()[]<>{} ")
            elif cell.casefold() not in tables.HOLES:
                raise InputError(path, at, f"expected a number, found {cell[:40]!r}")
        elif first is None:
            found[_float(key)] = _float(cell), number
        elif _float(cell) != first[0]:
            problem = f"expected the same number as in line {first[1]}, one a file"
            raise InputError(path, at, problem)
    if not found:
        raise InputError(path, f"line {head}, column {name!r}", "holds no number")
    return [found[key][0] for key in sorted(found)], unit, f"line {head}, column {name!r}"


def _above(
    path: Path, lines: Lines, name: str, units: Sequence[str]
) -> tuple[list[float], str, str] | None:
    """Find a line such as "name [unit] = number", "name_unit=number" or "name: number unit"."""
    known = "|".join(sorted(units, key=len, reverse=True))
    says = re.compile(
        rf"(?<!\w){re.escape(name)}(?:_({known}))?(?!\w)[ _]*(?:[(\[<]([^)\]>]*)[)\]>])?"
        rf"[\s:=;,]*({tables.NUMBER})(?:[\s;,]*({known})(?!\w))?"
    )
    every = [(found, line) for line, text in lines[:TOP] if (found := says.search(text[:LONGEST]))]
    if not every:
        return None
    values = {_float(found[3]) for found, _ in every}
    if len(values) > 1:
        first = every[0][1]
        second = every[1][1]
        raise InputError(path, f"line {second}", f"says another {name!r} than line {first}")
    found, line = every[0]
    own = found[1] or found[2] or found[4] or tables.split_unit(name)[1]
    return [values.pop()], own.strip(), f"line {line}"
