"""A virtual strain gauge as table and numbers, every one of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.strips.gauge import GaugeRecord, GaugeTable
from bubblefit.notes import Note, NoteKind
from bubblefit.readers.curves import LoadCurve

FILES = ("a.csv", "b.csv", "c.csv", "d.csv")
#: Of 20 mm at rest; lost in the third frame, longest in the second.
LENGTH = np.array([20.0, 23.0, np.nan, 22.0])
ELONGATION = LENGTH - 20.0
RECORD = GaugeRecord(
    20.0, LENGTH, ELONGATION, ELONGATION / 20, np.log(LENGTH / 20), (2,),
    (Note(NoteKind.LOST, "the lower end is lost in c.csv"),),
)  # fmt: skip
ENDS = (1.5, -10.0), (1.5, 10.0)
ALONE = GaugeTable(FILES, *ENDS, RECORD)
LOADED = GaugeTable(
    FILES, *ENDS, RECORD,
    LoadCurve("warp", "w1", ELONGATION[:2], np.array([5.0, 410.0]), None, None, np.array([0, 1])),
    "the frames are out\nof order",
)  # fmt: skip
WITHOUT = "1 of 4 frames have a length and no load; they are left out: d.csv"


def test_a_gauge_alone(tmp_path: Path) -> None:
    assert ALONE.numbers() == {
        "gauge_length_mm": 20.0,
        "longest": {
            "file": "b.csv", "length_mm": 23.0, "elongation_mm": 3.0,
            "strain": pytest.approx(0.15), "log_strain": pytest.approx(np.log(1.15)),
        },
        "frames": 4,
        "lost": ["c.csv"],
        "warnings": ["the lower end is lost in c.csv"],
        "notes": [
            {"of": "", "kind": "correlation lost", "note": "the lower end is lost in c.csv"}
        ],
    }  # fmt: skip
    table = ALONE.frame()
    assert list(table.columns) == [
        "frame", "file", "length_mm", "elongation_mm", "strain", "log_strain"
    ]  # fmt: skip
    assert table["frame"].tolist() == [0, 1, 2, 3] and table["file"].tolist() == list(FILES)
    expected = {
        "length_mm": LENGTH,
        "elongation_mm": ELONGATION,
        "strain": ELONGATION / 20,
        "log_strain": np.log(LENGTH / 20),
    }
    for name, values in expected.items():
        np.testing.assert_array_equal(table[name], values)
    assert ALONE.without_load == []


def test_with_the_loads_of_a_machine(tmp_path: Path) -> None:
    numbers = LOADED.numbers()
    loads = {key: numbers[key] for key in list(numbers)[-5:]}
    assert loads == {
        "direction": "warp", "specimen": "w1", "points": 2, "largest_load_N": 410.0,
        "without_load": ["d.csv"],
    }  # fmt: skip
    assert numbers["warnings"] == [
        "the lower end is lost in c.csv", "the frames are out\nof order", WITHOUT
    ]  # fmt: skip
    assert [note["kind"] for note in numbers["notes"]][::2] == [
        "correlation lost", "frames without load"
    ]  # fmt: skip
    LOADED.write(tmp_path / "g.csv")
    assert (tmp_path / "g.csv").read_text().splitlines()[:4] == [
        "# virtual strain gauge between (1.5, -10) and (1.5, 10) mm, 20 mm long in the reference "
        "state",
        "# note: the lower end is lost in c.csv",
        "# note: the frames are out of order",
        f"# note: {WITHOUT}",
    ]
    table = pd.read_csv(tmp_path / "g.csv", comment="#")
    assert table["file"].tolist() == ["a.csv", "b.csv"]
    assert table["load_N"].tolist() == [5.0, 410.0]
    assert set(table["specimen"]) == {"w1"} and set(table["direction"]) == {"warp"}
