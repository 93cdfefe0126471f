"""What is told of the frames that a test takes: numbers, a table, lines."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...data.clock_offset import ClockOffset
from ...reports import Table, plot_clock
from ..exhibit import Output, Shown
from .recorded import RecordedFrames

PICTURE = "clock.png"


def recorded_numbers(taken: RecordedFrames) -> dict[str, Any]:
    """For result.json: pressures in kPa, the clocks' offset in s."""
    asked, doubt = taken.asked, taken.doubt
    numbers: dict[str, Any] = {
        "from": taken.source,
        "frames": taken.count,
        "left_out": dict(taken.left_out),
        "taken": [
            {
                "frame": name,
                "pressure_kPa": 1e3 * float(taken.pressure[i]),
                **({} if asked is None else {"asked_kPa": 1e3 * float(asked[i])}),
                **({} if doubt is None else {"uncertain_kPa": 1e3 * float(doubt[i])}),
            }
            for i, name in enumerate(taken.names)
        ],
    }
    clock = taken.clock
    if clock is not None:
        numbers["clock"] = {
            "offset_s": clock.offset,
            "between_s": [clock.lower, clock.upper],
            "misfit": clock.misfit,
            "how": "given" if clock.misfit is None else "found by the apex heights",
        }
    return numbers


def recorded_lines(taken: RecordedFrames) -> list[str]:
    """For the terminal."""
    left_out = "".join(f", {count} {why}" for why, count in taken.left_out.items())
    lines = [
        f"pressures from {taken.source}: {len(taken.names)} of {taken.count} frames taken{left_out}"
    ]
    if taken.asked is not None:
        off = np.abs(taken.pressure - taken.asked)
        worst = int(np.argmax(off))
        lines[0] += (
            f"; farthest from the pressure asked for: {1e3 * taken.pressure[worst]:.4g} in place of"
            f" {1e3 * taken.asked[worst]:.4g} kPa"
        )
    if taken.clock is not None:
        lines.append(_clock_words(taken.clock))
    return lines


def recorded_table(taken: RecordedFrames) -> Table:
    """The frames taken, and at which pressures they were recorded."""
    columns = ["frame", "pressure, kPa"]
    cells: list[list[object]] = [
        [n, 1e3 * p] for n, p in zip(taken.names, taken.pressure.tolist(), strict=True)
    ]
    if taken.asked is not None:
        columns += ["asked for, kPa", "farther by, kPa"]
        for row, p, a in zip(cells, taken.pressure, taken.asked, strict=True):
            row += [1e3 * float(a), 1e3 * float(p - a)]
    if taken.doubt is not None and taken.clock is not None and taken.clock.misfit is not None:
        columns.append("uncertain by the clocks, +- kPa")
        for row, d in zip(cells, taken.doubt, strict=True):
            row.append(1e3 * float(d))
    left_out = "".join(f"; {count} {why}" for why, count in taken.left_out.items())
    note = f"pressures from {taken.source}; {len(cells)} of {taken.count} frames{left_out}"
    if taken.clock is not None:
        note += ". " + _clock_words(taken.clock)
    return Table("Frames taken", columns, cells, note)


def clock_pictures(taken: RecordedFrames, out: Output) -> list[Shown]:
    """Pressures of the log beside the heights of all frames; none without a log."""
    clock = taken.clock
    if clock is None:
        return []
    times = clock.times + clock.offset
    plot_clock(out.path(PICTURE), times, clock.pressure, clock.heights, taken.pressure)
    return [(out.name(PICTURE), "pressures of the log and heights of the frames, by one clock")]


def _clock_words(clock: ClockOffset) -> str:
    ahead = f"clock of the log less that of the frames: {clock.offset:.2f} s"
    if clock.misfit is None:
        return f"{ahead}, given"
    return (
        f"{ahead}, found by the apex heights, which rise with the pressure: between"
        f" {clock.lower:.2f} and {clock.upper:.2f} s the misfit ({clock.misfit:.2g} of the variance"
        f" at best) is at most doubled; pressures uncertain by {1e3 * np.nanmean(clock.doubt):.2g}"
        " kPa on average"
    )
