"""Loads and times of a machine's export, whatever else it holds."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.readers.machine_tables import read_machine_loads, read_times


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t_sek;Prüfzeit\n;s\n0;1,5\n0;2\n", [1.5, 2.0]),
        ("Time (min)\n1\n2\n", [60.0, 120.0]),
        ("frame,time_ms\n0,1500\n1,1600.5\n", [1.5, 1.6005]),
        ("Running Time,Cycle time\n3,4\n", [3.0]),
    ],
)
def test_units_of_time(tmp_path, text, expected):
    path = tmp_path / "t.csv"
    path.write_text(text)
    np.testing.assert_allclose(read_times(path), expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("Time (d)\n1\n", "line 1, column 'Time (d)': unit 'd' is not one of s, sec, ms, min, h"),
        ("Time,Running time\n1,2\n", "the column of time may be 'Time' or 'Running time'"),
        ("frame\n1\n", "no header row with the columns one of time"),
        ("time\n1\nx\n", "line 3, column 'time': expected a number, found 'x'"),
    ],
)
def test_times_that_cannot_be_read(tmp_path, text, words):
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_times(path)
    assert words in str(caught.value) and str(path) in str(caught.value)


def test_loads_need_no_elongation(tmp_path):
    path = tmp_path / "l.csv"
    path.write_text("Time (min),Load (kN),Load rate (kN/s)\n0,1,7\n0.5,2,7\n")
    plain, timed = read_machine_loads(path), read_machine_loads(path, timed=True)
    np.testing.assert_array_equal(plain.load, [1000, 2000])
    assert plain.time is None and timed.time is not None
    np.testing.assert_array_equal(timed.time, [0, 30])
    with pytest.raises(InputError, match="no header row with the columns one of load and one of t"):
        path.write_text("Load (kN)\n1\n")
        read_machine_loads(path, timed=True)
