"""A gauge with a machine's loads, from Python as from the command line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.strips.gauge import (
    GaugeTable,
    PairedLoads,
    loads_at_frames,
    virtual_strain_gauge,
)
from bubblefit.readers.curves import read_load_curves
from bubblefit.readers.frames import Frame

from ..complaints import complaint

LOADS = "time_s,load_N\n0,0\n1,10\n2,30\n"
LOWER, UPPER = (1.0, 1.0), (1.0, 9.0)


@pytest.fixture
def record():
    x, y = (part.ravel() for part in np.meshgrid(np.arange(3.0), np.arange(11.0)))
    points = np.stack([x, y, 0 * x], axis=1)
    frames = [Frame(points, points * [0, stretch, 0]) for stretch in (0.0, 0.1, 0.2)]
    frames[1] = Frame(points[:20], frames[1].displacement[:20])
    return virtual_strain_gauge(frames, LOWER, UPPER)


def test_the_table_of_a_gauge_reads_back_as_a_load_curve(record, tmp_path):
    path = tmp_path / "machine.csv"
    path.write_text(LOADS)
    curve = loads_at_frames(record, PairedLoads(path, "weft", " 3 "))
    np.testing.assert_array_equal(curve.load, [0, 30])
    table = GaugeTable(["a", "b", "c"], LOWER, UPPER, record, curve, "a note")
    table.write(tmp_path / "gauge.csv")
    (back,) = read_load_curves(tmp_path / "gauge.csv")
    assert (back.direction, back.specimen) == ("fill", "3")
    np.testing.assert_array_equal(back.elongation, curve.elongation)
    np.testing.assert_array_equal(back.load, curve.load)
    numbers = table.numbers()
    assert numbers["lost"] == ["b"] and numbers["points"] == 2 and "a note" in table.notes
    assert numbers["longest"] == {
        "file": "c",
        "length_mm": pytest.approx(1.2 * table.record.reference_length),
        "elongation_mm": pytest.approx(0.2 * table.record.reference_length),
        "strain": pytest.approx(0.2),
        "log_strain": pytest.approx(np.log(1.2)),
    }
    assert numbers["gauge_length_mm"] == table.record.reference_length
    assert (numbers["direction"], numbers["specimen"]) == ("fill", "3")
    assert (numbers["largest_load_N"], numbers["frames"]) == (30, 3)
    assert numbers["without_load"] == []


def test_without_loads_every_frame_has_its_row(record):
    table = GaugeTable(["a", "b", "c"], LOWER, UPPER, record).frame()
    assert table.frame.tolist() == [0, 1, 2] and table.file.tolist() == ["a", "b", "c"]
    assert table.length_mm.isna().tolist() == [False, True, False]
    assert isinstance(table, pd.DataFrame) and "load_N" not in table


def test_loads_by_time(record, tmp_path):
    path = tmp_path / "machine.csv"
    path.write_text(LOADS)
    by_interval = PairedLoads(path, "warp", "1", frame_interval=0.5, time_offset=0.5)
    np.testing.assert_allclose(loads_at_frames(record, by_interval).load, [5, 20])
    times = tmp_path / "times.csv"
    times.write_text("time_s\n0.5\n1\n1.5\n")
    by_table = PairedLoads(path, "warp", "1", frame_times=times)
    np.testing.assert_allclose(loads_at_frames(record, by_table).load, [5, 20])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"direction": "90"}, "direction: unknown direction '90'"),
        ({"specimen": " "}, "specimen: expected a name on one line"),
        ({"time_offset": 1.0}, "time_offset: means nothing without frame_times or frame_interval"),
        ({"frame_time_column": "t"}, "frame_time_column: means nothing without frame_times"),
        (
            {"frame_times": Path("t"), "frame_interval": 1.0},
            "frame_times, frame_interval: give one of them, not both",
        ),
        ({"frame_interval": np.inf}, "frame_interval: expected a finite number"),
    ],
)
def test_what_contradicts_itself(options, words):
    asked = {"path": Path("m.csv"), "direction": "warp", "specimen": "1"} | options
    assert words in complaint(PairedLoads, **asked)


def test_columns_are_asked_for_by_their_own_name(record, tmp_path):
    path = tmp_path / "machine.csv"
    path.write_text("F1 (N),F2 (N)\n1,2\n1,2\n1,2\n")
    message = complaint(loads_at_frames, record, PairedLoads(path, "warp", "1"))
    assert "with load_column" in message
