"""Measured load-deflection curves: units, sensors, repetitions, zero; scatter and error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.bending import BendingCurve, model_error, read_bending_curves, scatter
from bubblefit.readers.machine_tables import Channel

from ..complaints import complaint_with
from ..cylinder_cases import write_readings

KG = Channel("mass_kg", "kg")


def written(folder: Path, text: str) -> Path:
    path = folder / "test.csv"
    path.write_text(text)
    return path


def curve(deflection: list[float], load: list[float], name: str = "a") -> BendingCurve:
    return BendingCurve(name, np.array(deflection), np.array(load))


def test_repetitions_in_a_column_and_weights_in_kilograms(tmp_path: Path) -> None:
    curves = read_bending_curves(write_readings(tmp_path / "made-up.csv"), load=KG)
    assert [c.repetition for c in curves] == ["made-up 1", "made-up 2"]
    for c in curves:
        # What came after the largest deflection was unloading.
        assert len(c.load) == 7 and c.load[-1] == pytest.approx(30 * 9.80665)
        assert c.load == pytest.approx(3.5 * c.deflection)


def test_sensors_in_volts(tmp_path: Path) -> None:
    path = written(tmp_path, "wire (V);cell (V)\n0,5;0,1\n0,6;0,2\n0,75;0,35\n")
    (found,) = read_bending_curves(
        path, deflection=Channel("wire", "cm", 20.0, -10.0), load=Channel("cell", "kN", 2.0)
    )
    assert found.deflection == pytest.approx([0.0, 20.0, 50.0])
    assert found.load == pytest.approx([200.0, 400.0, 700.0])
    assert found.repetition == "test"


def test_units_of_the_file_and_of_other_lengths(tmp_path: Path) -> None:
    path = written(tmp_path, "Deflection [m],Load [kN]\n0,0\n0.1,0.3\n")
    (found,) = read_bending_curves(path)
    assert found.deflection == pytest.approx([0.0, 100.0])
    assert found.load == pytest.approx([0.0, 300.0])


@pytest.mark.parametrize(
    ("zero", "deflection"),
    [("none", [7.0, 17.0, 27.0, 37.0]), ("first", [0, 10, 20, 30]), ("line", [5, 15, 25, 35])],
)
def test_zero_of_the_deflection_and_what_hangs_on_the_beam(
    tmp_path: Path, zero: str, deflection: list[float]
) -> None:
    """2 N/mm; the collar's 10 N are on the beam before the first reading."""
    path = written(tmp_path, "deflection (mm),load (N)\n7,0\n17,20\n27,40\n37,60\n")
    (found,) = read_bending_curves(path, preload=10.0, zero=zero)
    assert found.deflection == pytest.approx(deflection)
    assert found.load == pytest.approx([10.0, 30.0, 50.0, 70.0])


def test_a_soft_beam_has_a_zero_too(tmp_path: Path) -> None:
    """0.02 N/mm."""
    path = written(tmp_path, "deflection (mm),load (N)\n7,0.1\n17,0.3\n27,0.5\n37,0.7\n")
    (found,) = read_bending_curves(path, zero="line")
    assert found.deflection == pytest.approx([5.0, 15.0, 25.0, 35.0])


@pytest.mark.parametrize(
    ("text", "how", "words"),
    [
        ("deflection (mm),load (N)\n0,0\n1,x\n2,2\n", {}, ["line 3", "load", "expected a number"]),
        ("deflection (mm),mass_kg\n0,0\n1,1\n", {}, ["deflection", "load", "columns"]),
        ("deflection,load (N)\n0,0\n1,1\n", {}, ["line 1", "deflection", "say the unit", "mm"]),
        ("wire (V),load (N)\n0,0\n1,1\n", {"deflection": Channel("wire")}, ["'V'", "volts"]),
        (
            "wire (V),load (N)\n0,0\n1,1\n",
            {"deflection": Channel("wire", scale=200.0)},
            ["line 1", "after scaling"],
        ),
        (
            "wire (mm),load (N)\n0,0\n1,1\n",
            {"deflection": Channel("wire", "mm", 200.0)},
            ["mm already", "scale 200"],
        ),
        (
            "deflection (mm),load (N)\n0,0\n1,1\n",
            {"load": Channel(unit="kg")},
            ["says 'N'", "'kg'"],
        ),
        ("deflection (mm),load (N),run\n0,0,a\n1,1,a\n0,0,b\n", {}, ["line 4", "'b'", "one read"]),
        ("deflection (mm),load (N)\n0,5\n1,4\n", {"zero": "line"}, ["line 2", "do not rise"]),
        ("deflection (mm),load (N)\n", {}, ["line 1", "no rows"]),
    ],
)
def test_mistakes_name_file_and_line(
    tmp_path: Path, text: str, how: dict, words: list[str]
) -> None:
    words = ["test.csv", *words]
    complaint_with(words, read_bending_curves, written(tmp_path, text), **how)


def test_mean_and_scatter_of_repetitions_that_end_apart() -> None:
    found = scatter([curve([0, 10, 20], [0, 20, 40]), curve([0, 10], [0, 24], "b")], places=5)
    assert found.deflection == pytest.approx([0, 5, 10, 15, 20])
    assert found.mean == pytest.approx([0, 11, 22, 30, 40])
    assert found.deviation[:3] == pytest.approx([0, np.sqrt(2), np.sqrt(8)])
    assert np.isnan(found.deviation[3:]).all()
    assert found.count.tolist() == [2, 2, 2, 1, 1]


def test_two_readings_at_one_deflection_count_as_their_mean() -> None:
    found = scatter([curve([0, 10, 10, 20], [0, 10, 14, 20])], places=3)
    assert found.mean == pytest.approx([0, 12, 20])


def test_error_of_a_model_by_hand() -> None:
    readings = [curve([0, 10, 20, 60], [0, 20, 40, 100]), curve([0, 30], [0, 60], "b")]
    error = model_error(readings, [0.0, 40.0], [0.0, 100.0])  # 2.5 N/mm against 2
    off = np.array([0, 5, 10, 0, 15])
    assert error is not None
    assert error.rms == pytest.approx(np.sqrt(np.mean(off**2)))
    assert error.mean == pytest.approx(6.0)
    assert error.relative == pytest.approx(error.rms / 60)
    assert (error.compared, error.beyond) == (5, 1)
    assert model_error(readings[:1], [70.0, 80.0], [0.0, 1.0]) is None
    assert model_error([], [0.0, 1.0], [0.0, 1.0]) is None
    assert model_error([curve([0, 1], [0, 0])], [0.0, 1.0], [0.0, 1.0]) is None
