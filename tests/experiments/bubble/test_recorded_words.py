"""What is told of recorded frames: every number, cell and word of made-up ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.bubble import findings as recorded_words
from bubblefit.experiments.bubble.findings import (
    clock_pictures,
    recorded_lines,
    recorded_numbers,
    recorded_table,
)
from bubblefit.experiments.bubble.point_files import RecordedFrames
from bubblefit.experiments.kinds import Output
from bubblefit.readers.pressure_log import ClockOffset

from ...drawings import caught

#: Of all five frames of the film, MPa; the first of them is before the log begins.
DOUBT = np.array([np.nan, 0.0002, 0.0004, 0.0006, 0.0008])
CLOCK = ClockOffset(
    offset=41.254, lower=40.996, upper=41.504, misfit=0.00234,
    pressure=np.array([np.nan, 0.01, 0.021, 0.033, 0.06]), doubt=DOUBT,
    times=np.arange(5.0), heights=np.array([0.0, 10.0, 20.0, 30.0, 40.0]),
)  # fmt: skip
TAKEN = RecordedFrames(
    files=(Path("a.csv"), Path("b.csv")),
    frames=None,
    names=("a.csv", "b.csv"),
    pressure=np.array([0.021, 0.06]),
    asked=np.array([0.0215, 0.0598]),
    source="the log valve.csv",
    count=5,
    left_out={"at no pressure": 1, "before the log": 2},
    doubt=DOUBT[[2, 4]],
    clock=CLOCK,
)
#: Without a log, and of what frames there are.
PLAIN = replace(TAKEN, asked=None, doubt=None, clock=None, left_out={}, source="the files' names")
AHEAD = "clock of the log less that of the frames: 41.25 s"
FOUND = (
    f"{AHEAD}, found by the apex heights, which rise with the pressure: between 41.00 and 41.50 s "
    "the misfit (0.0023 of the variance at best) is at most doubled; pressures uncertain by 0.5 "
    "kPa on average"
)


def test_numbers_for_result_json() -> None:
    found = recorded_numbers(TAKEN)
    rows = [
        {"frame": "a.csv", "pressure_kPa": 21.0, "asked_kPa": 21.5, "uncertain_kPa": 0.4},
        {"frame": "b.csv", "pressure_kPa": 60.0, "asked_kPa": 59.8, "uncertain_kPa": 0.8},
    ]
    assert found.pop("taken") == [pytest.approx(row) for row in rows]
    assert found == {
        "from": "the log valve.csv",
        "frames": 5,
        "left_out": {"at no pressure": 1, "before the log": 2},
        "clock": {
            "offset_s": 41.254,
            "between_s": [40.996, 41.504],
            "misfit": 0.00234,
            "how": "found by the apex heights",
        },
    }
    given = recorded_numbers(replace(TAKEN, clock=replace(CLOCK, misfit=None)))["clock"]
    assert (given["misfit"], given["how"]) == (None, "given")
    plain = recorded_numbers(PLAIN)
    assert plain["taken"][1] == pytest.approx({"frame": "b.csv", "pressure_kPa": 60.0})
    assert "clock" not in plain


def test_lines_for_the_terminal() -> None:
    first, second = recorded_lines(TAKEN)
    assert first == (
        "pressures from the log valve.csv: 2 of 5 frames taken, 1 at no pressure, 2 before the "
        "log; farthest from the pressure asked for: 21 in place of 21.5 kPa"
    )
    assert second == FOUND
    (_, given) = recorded_lines(replace(TAKEN, clock=replace(CLOCK, misfit=None)))
    assert given == f"{AHEAD}, given"
    assert recorded_lines(PLAIN) == ["pressures from the files' names: 2 of 5 frames taken"]


def test_the_table_of_frames() -> None:
    table = recorded_table(TAKEN)
    assert table.title == "Frames taken"
    assert table.header == [
        "frame", "pressure, kPa", "asked for, kPa", "farther by, kPa",
        "uncertain by the clocks, +- kPa",
    ]  # fmt: skip
    assert [row[0] for row in table.rows] == ["a.csv", "b.csv"]
    assert table.rows[0][1:] == pytest.approx([21.0, 21.5, -0.5, 0.4])
    assert table.rows[1][1:] == pytest.approx([60.0, 59.8, 0.2, 0.8])
    assert table.note == (
        "pressures from the log valve.csv; 2 of 5 frames; 1 at no pressure; 2 before the log. "
        + FOUND
    )
    # Where the offset was given, the clocks leave nothing open.
    given = recorded_table(replace(TAKEN, asked=None, clock=replace(CLOCK, misfit=None)))
    assert given.header == ["frame", "pressure, kPa"]
    plain = recorded_table(PLAIN)
    assert plain.rows == [["a.csv", pytest.approx(21.0)], ["b.csv", pytest.approx(60.0)]]
    assert plain.note == "pressures from the files' names; 2 of 5 frames"


def test_pressures_and_heights_are_drawn_by_the_clock_of_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = caught(monkeypatch, recorded_words, "clock_charts")
    assert clock_pictures(PLAIN, Output(tmp_path)) == [] == drawn
    clock_pictures(TAKEN, Output(tmp_path))
    ((path, times, pressure, heights, taken),) = drawn
    assert path == tmp_path / "clock.png"
    assert times == pytest.approx([41.254, 42.254, 43.254, 44.254, 45.254])
    assert pressure is CLOCK.pressure and heights is CLOCK.heights and taken is TAKEN.pressure
