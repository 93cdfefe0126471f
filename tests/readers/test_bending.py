"""readers/bending.py: readings of bent cylinders, their repetitions and model errors."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.bending import BendingCurve, model_error, read_bending_curves, scatter
from bubblefit.readers.machine_tables import Channel

from ..builders.bent_cylinders import write_cylinder_readings
from ..support.refusals import complaint, complaint_with

KG = Channel("mass_kg", "kg")


def written_readings(folder: Path, text: str) -> Path:
    path = folder / "test.csv"
    path.write_text(text)
    return path


def bending_curve(deflection: list[float], load: list[float], name: str = "a") -> BendingCurve:
    return BendingCurve(name, np.array(deflection), np.array(load))


def test_repetitions_in_a_column_and_weights_in_kilograms(tmp_path):
    curves = read_bending_curves(write_cylinder_readings(tmp_path / "made-up.csv"), load=KG)
    assert [c.repetition for c in curves] == ["made-up 1", "made-up 2"]
    for c in curves:
        # What came after the largest deflection was unloading.
        assert len(c.load) == 7 and c.load[-1] == pytest.approx(30 * 9.80665)
        assert c.load == pytest.approx(3.5 * c.deflection)
    path = written_readings(tmp_path, "wire (V);cell (V)\n0,5;0,1\n0,6;0,2\n0,75;0,35\n")
    (found,) = read_bending_curves(
        path, deflection=Channel("wire", "cm", 20.0, -10.0), load=Channel("cell", "kN", 2.0)
    )
    assert found.deflection == pytest.approx([0.0, 20.0, 50.0])
    assert found.load == pytest.approx([200.0, 400.0, 700.0])
    assert found.repetition == "test"
    (found,) = read_bending_curves(
        written_readings(tmp_path, "Deflection [m],Load [kN]\n0,0\n0.1,0.3\n")
    )
    assert found.deflection == pytest.approx([0.0, 100.0])
    assert found.load == pytest.approx([0.0, 300.0])


@pytest.mark.parametrize(
    ("zero", "deflection"),
    [("none", [7.0, 17.0, 27.0, 37.0]), ("first", [0, 10, 20, 30]), ("line", [5, 15, 25, 35])],
)
def test_zero_of_deflection_and_load_on_the_beam(tmp_path, zero, deflection):
    """2 and 0.02 N/mm; the collar's 10 N are on the beam before the first reading."""
    for scale in (1.0, 0.01):
        readings = "".join(f"{7 + 10 * k},{scale * 20 * k}\n" for k in range(4))
        path = written_readings(tmp_path, f"deflection (mm),load (N)\n{readings}")
        (found,) = read_bending_curves(path, preload=10.0 * scale, zero=zero)
        assert found.deflection == pytest.approx(deflection)
        assert found.load == pytest.approx(scale * np.array([10.0, 30.0, 50.0, 70.0]))


@pytest.mark.parametrize(
    ("text", "how", "words"),
    [
        ("deflection (mm),load (N)\n0,0\n1,x\n2,2\n", {}, ["line 3", "load", "expected a number"]),
        ("deflection (mm),mass_kg\n0,0\n1,1\n", {}, ["deflection", "load", "columns"]),
        ("deflection,load (N)\n0,0\n1,1\n", {}, ["line 1", "deflection", "say the unit"]),
        ("wire (V),load (N)\n0,0\n1,1\n", {"deflection": Channel("wire")}, ["'V'", "volts"]),
        ("deflection (mm),load (N)\n0,0\n1,1\n", {"load": Channel(unit="kg")}, ["'N'", "'kg'"]),
        ("deflection (mm),load (N),run\n0,0,a\n1,1,a\n0,0,b\n", {}, ["line 4", "'b'", "one read"]),
        ("deflection (mm),load (N)\n0,5\n1,4\n", {"zero": "line"}, ["line 2", "do not rise"]),
        ("deflection (mm),load (N)\n", {}, ["line 1", "no rows"]),
        ("Durchbiegung (mm),Last (N)\n0,0\n-9,7\n", {}, ["deflections of 'test' go from 0 to -9"]),
        ("deflection (mm),load (N)\n0,0\n9,-7\n", {}, ["loads", "0 to -7, and", "reverse their"]),
    ],
)
def test_mistake_in_bending_readings_names_file_and_line(tmp_path, text, how, words):
    complaint_with(
        ["test.csv", *words], read_bending_curves, written_readings(tmp_path, text), **how
    )


def test_mean_and_scatter_of_repetitions_of_different_ends():
    found = scatter(
        [bending_curve([0, 10, 20], [0, 20, 40]), bending_curve([0, 10], [0, 24], "b")], places=5
    )
    assert found.deflection == pytest.approx([0, 5, 10, 15, 20])
    assert found.mean == pytest.approx([0, 11, 22, 30, 40])
    assert found.deviation[:3] == pytest.approx([0, np.sqrt(2), np.sqrt(8)])
    assert np.isnan(found.deviation[3:]).all()
    assert found.count.tolist() == [2, 2, 2, 1, 1]
    # Two readings at one deflection count as their mean.
    found = scatter([bending_curve([0, 10, 10, 20], [0, 10, 14, 20])], places=3)
    assert found.mean == pytest.approx([0, 12, 20])


def test_model_error_equals_that_by_hand():
    readings = [
        bending_curve([0, 10, 20, 60], [0, 20, 40, 100]),
        bending_curve([0, 30], [0, 60], "b"),
    ]
    error = model_error(readings, [0.0, 40.0], [0.0, 100.0])  # 2.5 N/mm against 2
    assert error.rms == pytest.approx(np.sqrt(np.mean(np.array([0, 5, 10, 0, 15]) ** 2)))
    assert (error.mean, error.relative) == pytest.approx((6.0, error.rms / 60))
    assert (error.compared, error.beyond_count) == (5, 1)
    assert model_error(readings[:1], [70.0, 80.0], [0.0, 1.0]) is None
    for none in ([], [bending_curve([0, 1], [0, 0])]):
        assert model_error(none, [0.0, 1.0], [0.0, 1.0]) is None


def test_zero_by_a_line_through_the_first_four_readings(tmp_path):
    path = tmp_path / "b.csv"
    for rows, deflection in (
        ("6,2\n8,6\n10,10\n12,14\n14,99\n", [1.0, 3.0, 5.0, 7.0, 9.0]),
        ("0.1,1\n0.2,2\n0.3,3\n0.4,4\n", [0.1, 0.2, 0.3, 0.4]),
        ("6,2\n6,3\n6,4\n6,5\n7,9\n", None), ("6,2\n7,2\n8,2\n9,2\n10,9\n", None),
    ):  # fmt: skip
        path.write_text("deflection (mm),load (N)\n" + rows)
        if deflection:
            (curve,) = read_bending_curves(path, zero="line")
            assert curve.deflection.tolist() == pytest.approx(deflection)
        else:
            assert "line 2: the first read" in complaint(read_bending_curves, path, zero="line")
