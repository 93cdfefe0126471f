"""Complaints quote what a file says only so far: a line for a terminal, whatever stands there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.columns import PRESSURE_UNITS
from bubblefit.readers.curves import direction_named, read_load_curves
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.machine_tables import Channel, in_unit, read_machine_loads
from bubblefit.readers.names import value_in_file
from bubblefit.readers.registry import format_named
from bubblefit.readers.tables import read_table

from ..complaints import complaint

#: Of a hundred different letters.
LONG = "".join(chr(0x4E00 + k) for k in range(100))


def quoted(said: str) -> str:
    """What of LONG is quoted."""
    found = [letter for letter in LONG if letter in said]
    assert "".join(found) in said
    return "".join(found)


def file(folder: Path, text: str) -> Path:
    (folder / "a.csv").write_text(text, encoding="utf-8")
    return folder / "a.csv"


def test_units_and_names(tmp_path: Path) -> None:
    asked = np.ones(2), "", Channel("p", LONG), PRESSURE_UNITS, tmp_path, "column"
    assert quoted(complaint(in_unit, *asked)) == LONG[:20]
    assert quoted(complaint(direction_named, LONG)) == LONG[:40]
    assert quoted(complaint(format_named, "frames", LONG)) == LONG[:40]
    curves = file(tmp_path, f"Extension,Load\nmm,{LONG}\n0,0\n1,2\n")
    assert quoted(complaint(read_load_curves, curves, direction="warp")) == LONG[:20]
    loads = file(tmp_path, f"Time,Load\n{LONG},N\n0,0\n1,2\n")
    assert quoted(complaint(read_machine_loads, loads, timed=True)) == LONG[:20]


def test_cells(tmp_path: Path) -> None:
    channel = Channel("p", "kPa", None, 0.0)
    cell = file(tmp_path, f"x,p\n0,1\n1,1\n2,{LONG}\n")
    assert quoted(complaint(value_in_file, cell, channel, PRESSURE_UNITS)) == LONG[:40]


def names(count: int) -> list[str]:
    return [f"n{k:03d}" for k in range(count)]


@pytest.mark.parametrize("count", [30, 90])
def test_names_that_there_are(tmp_path: Path, count: int) -> None:
    """Three hundred letters of them."""
    every = names(count)
    path = file(tmp_path, ",".join(every) + "\n" + ",".join("1" * count) + "\n")
    there = f"the file has: {', '.join(every)[:300]}"
    assert complaint(read_table(path).text, "other").endswith(there)
    line = ",".join(every)[:100]
    assert complaint(read_frames, [path], FrameOptions()).endswith(f"Line 1 is: {line}")


def test_a_header_row_that_might_have_been(tmp_path: Path) -> None:
    path = file(tmp_path, ",".join(names(90)) + "\n" + ",".join("1" * 90) + "\n")
    said = complaint(read_load_curves, path, direction="warp")
    assert said.endswith(f"has: {', '.join(names(90))[:200]}")
