"""The published polynomials and the points they were fitted to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.curves import LoadCurve, read_load_curves, split_at_restarts
from bubblefit.readers.polynomials import (
    fit_load_polynomial,
    read_published_polynomials,
    specimen_scatter,
)

from ..complaints import complaint
from ..places import PUBLISHED

EXAMPLE = Path(__file__).parents[2] / "examples/uniaxial-valmex7318/curves.csv"


def test_the_examples_have_the_published_polynomials():
    ours = read_published_polynomials(EXAMPLE)
    theirs = read_published_polynomials(PUBLISHED / "published_uniaxial_polynomials.csv")
    assert list(ours) == list(theirs) == ["warp", "fill", "bias"]
    for direction, one in ours.items():
        other = theirs[direction]
        np.testing.assert_array_equal(one.polynomial.coefficients, other.polynomial.coefficients)
        assert (one.gauge_length, one.final_length) == (other.gauge_length, other.final_length)
        assert one.scatter == other.scatter


def test_lengths_are_those_of_table_3_1():
    published = read_published_polynomials(EXAMPLE)
    strain = {name: p.polynomial.end / p.gauge_length for name, p in published.items()}
    assert strain == pytest.approx({"warp": 0.165, "fill": 0.261, "bias": 0.555}, abs=5e-4)
    for one in published.values():
        assert one.polynomial(0.0) == 0.0
        assert one.polynomial.order == 4


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("warp", "90", "line 4, column 'direction': unknown direction '90'"),
        ("fill", "warp", "warp is given twice"),
        ("23.329", "20.0", "expected 0 < gauge length < final length"),
        (",c3", ",k3", "column 'c3': this column is missing"),
        ("812.44", "x", "line 4, column 'c1': expected a number"),
        ("c1", "b1", "column 'c1': this column is missing"),
    ],
)
def test_a_damaged_file_of_polynomials(tmp_path, old, new, words):
    path = tmp_path / "curves.csv"
    text = EXAMPLE.read_text()
    head, body = text[: text.index("direction,")], text[text.index("direction,") :]
    path.write_text(head + body.replace(old, new, 1))
    message = complaint(read_published_polynomials, path)
    assert "curves.csv" in message and words in message


def measured_points(shared_data: Path) -> dict[str, LoadCurve]:
    curves = read_load_curves(shared_data / "uniaxial/valmex7318_load_gauge.csv")
    return {curve.direction: curve for curve in curves}


def test_the_published_scatter_is_a_standard_deviation(shared_data):
    """21.7, 64.1, 40.3 N: about their own mean, n - 1; RMSE is 0.2 to 0.8 N less."""
    published, points = read_published_polynomials(EXAMPLE), measured_points(shared_data)
    for direction, one in published.items():
        scatter = specimen_scatter(split_at_restarts(points[direction]), one.polynomial)
        assert scatter.deviation == pytest.approx(one.scatter, abs=0.05)
        assert 0.1 < one.scatter - scatter.rmse < 0.9


def test_refitting_the_points_gives_what_was_published(shared_data):
    """Warp and bias to the digits printed: no legend marker is among the points.

    Not so fill, see the next test.
    """
    published, points = read_published_polynomials(EXAMPLE), measured_points(shared_data)
    printed = {"warp": ([2, 2, 2, 3], 0.998), "bias": ([2, 3, 4, 4], 0.987)}
    for direction, (digits, r_squared) in printed.items():
        curve = points[direction]
        fitted = fit_load_polynomial(curve.elongation, curve.load)
        half = 0.5 * 10.0 ** -np.array(digits)
        # Digitising adds an error of its own: half a unit more of the last digit.
        off = np.abs(fitted.coefficients - published[direction].polynomial.coefficients)[1:]
        assert (off < 2 * half).all()
        assert fitted.r_squared == pytest.approx(r_squared, abs=5e-4)


def test_one_fill_point_was_not_digitised(shared_data):
    """Fill gives R^2 0.9576 where Table 3.1 has 0.959, and coefficients 0.4 N/mm apart.

    One point more, near the origin, explains both: where is found from the published coefficients
    alone, R^2 then follows. (Five specimens start there: one marker may hide another.)
    """
    published = read_published_polynomials(EXAMPLE)["fill"].polynomial
    curve = measured_points(shared_data)["fill"]
    refitted = fit_load_polynomial(curve.elongation, curve.load)
    assert refitted.r_squared == pytest.approx(0.9576, abs=5e-5)
    assert np.abs(refitted.coefficients - published.coefficients).max() > 0.4
    u, load = np.append(curve.elongation, 0.07), np.append(curve.load, -2.1)
    completed = fit_load_polynomial(u, load)
    off = np.abs(completed.coefficients - published.coefficients)[1:]
    assert (off < [0.01, 0.01, 0.005, 0.0005]).all()
    assert completed.r_squared == pytest.approx(0.959, abs=5e-4)


def test_a_straight_line_has_one_coefficient(tmp_path):
    path = tmp_path / "p.csv"
    head = "direction,gauge_length_mm,final_length_mm"
    path.write_text(f"{head},c1\nweft,20,25,7.5\n")
    (fill,) = read_published_polynomials(path).values()
    assert (fill.direction, fill.gauge_length, fill.final_length) == ("fill", 20.0, 25.0)
    assert fill.polynomial.coefficients.tolist() == [0.0, 7.5]
    assert (fill.polynomial.end, fill.polynomial.points) == (5.0, 0) and np.isnan(fill.scatter)
    path.write_text(f"{head},c0,c1,c2,data_scatter_N\nwarp,20,25,1,2,3,4\n")
    (warp,) = read_published_polynomials(path).values()
    assert warp.polynomial.coefficients.tolist() == [1.0, 2.0, 3.0] and warp.scatter == 4.0
    for row, words in (
        ("warp,0,25,1", "line 2: expected 0 < gauge length < final length, got 0 and 25"),
        ("warp,25,25,1", "line 2: expected 0 < gauge length < final length, got 25 and 25"),
        ("warp,20,25,1\nwarp,20,25,1", "line 3, column 'direction': warp is given twice; expected "
         "once"),
    ):  # fmt: skip
        path.write_text(f"{head},c1\n{row}\n")
        assert complaint(read_published_polynomials, path) == f"{path}: {words}"
    path.write_text(f"{head},c2\nwarp,20,25,1\n")
    assert "column 'c1': this column is missing" in complaint(read_published_polynomials, path)
