"""experiments/strips/gauge.py: the table of a gauge."""

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.strips.gauge import CORRELATION_LOST, GaugeRecord, GaugeTable
from bubblefit.notes import Note
from bubblefit.readers.curves import LoadCurve

FILES, ENDS = ("a.csv", "b.csv", "c.csv", "d.csv"), ((1.5, -10.0), (1.5, 10.0))
#: Of 20 mm at rest; lost in the third frame, longest in the second.
LENGTH = np.array([20.0, 23.0, np.nan, 22.0])
U = LENGTH - 20.0
GONE = Note(CORRELATION_LOST, "the lower end is lost in c.csv")
RECORD = GaugeRecord(20.0, LENGTH, U, U / 20, np.log(LENGTH / 20), (2,), (GONE,))


def test_table_of_a_gauge_without_loads():
    alone = GaugeTable(FILES, *ENDS, RECORD)
    assert alone.numbers() == {
        "gauge_length_mm": 20.0,
        "longest": {
            "file": "b.csv", "length_mm": 23.0, "elongation_mm": 3.0,
            "strain": pytest.approx(0.15), "log_strain": pytest.approx(np.log(1.15)),
        },
        "frames": 4, "lost": ["c.csv"], "warnings": [GONE],
        "notes": [{"of": "", "kind": "correlation lost", "note": GONE}],
    }  # fmt: skip
    columns = {
        "frame": [0, 1, 2, 3], "file": FILES, "length_mm": LENGTH, "elongation_mm": U,
        "strain": U / 20, "log_strain": np.log(LENGTH / 20),
    }  # fmt: skip
    pd.testing.assert_frame_equal(alone.frame(), pd.DataFrame(columns))
    assert alone.without_load == []


def test_table_of_a_gauge_with_loads_of_a_machine(tmp_path):
    load, frame = np.array([5.0, 410.0]), np.array([0, 1])
    curve = LoadCurve("warp", "w1", U[:2], load, None, None, frame)
    table = GaugeTable(FILES, *ENDS, RECORD, curve, "the frames are out\nof order")
    numbers = table.numbers()
    assert {key: numbers[key] for key in list(numbers)[-5:]} == {
        "direction": "warp", "specimen": "w1", "points": 2, "largest_load_N": 410.0,
        "without_load": ["d.csv"],
    }  # fmt: skip
    assert numbers["warnings"][:2] == [GONE, "the frames are out\nof order"]
    assert numbers["warnings"][2].startswith("1 of 4 frames have a length and no load")
    kinds = [note["kind"] for note in numbers["notes"]]
    assert kinds[::2] == ["correlation lost", "frames without load"]
    table.write(tmp_path / "g.csv")
    head, *notes = (tmp_path / "g.csv").read_text().splitlines()[:4]
    assert "(1.5, -10) and (1.5, 10) mm, 20 mm long" in head
    assert notes == [f"# note: {' '.join(words.split())}" for words in numbers["warnings"]]
    read = pd.read_csv(tmp_path / "g.csv", comment="#")
    assert read["file"].tolist() == ["a.csv", "b.csv"] and read["load_N"].tolist() == [5.0, 410.0]
    assert set(read["specimen"]) == {"w1"} and set(read["direction"]) == {"warp"}
