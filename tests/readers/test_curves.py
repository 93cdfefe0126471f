"""readers/curves.py: load curves of strips, their specimens and polynomials."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.curves import (
    LoadCurve,
    LoadPolynomial,
    cut_of,
    direction_named,
    fit_load_polynomial,
    in_order,
    read_load_curves,
    read_published_polynomials,
    specimen_deviation,
    split_at_restarts,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from ..support.refusals import complaint
from .cases import read_export


def test_measured_points_need_no_options(shared_data):
    path = shared_data / "uniaxial/valmex7318_load_gauge.csv"
    curves = read_load_curves(path)
    assert [c.direction for c in curves] == ["warp", "fill", "bias"]
    assert [c.specimen for c in curves] == ["warp", "fill", "bias45"]
    assert [len(c.load) for c in curves] == [59, 39, 98]
    rows = [line.split(",") for line in path.read_text().splitlines()[2:]]
    for curve in curves:
        here = [row for row in rows if row[0] == curve.specimen]
        np.testing.assert_array_equal(curve.elongation, [float(row[1]) for row in here])
        np.testing.assert_array_equal(curve.load, [float(row[2]) for row in here])
    # Five specimens a direction (section 3.1), listed one after the other.
    parts = [[len(part.load) for part in split_at_restarts(curve)] for curve in curves]
    assert parts == [[10, 18, 10, 10, 11], [10, 9, 9, 3, 8], [11, 22, 21, 22, 22]]
    (fill,) = read_load_curves(path, direction="weft")
    np.testing.assert_array_equal(fill.load, curves[1].load)


def test_specimens_and_directions_are_read_from_their_columns(export_file):
    text = (
        "Specimen No.,Test direction,Load (kN),Extension (cm)\n"
        "A,Warp,0.1,1\nB,Warp,0.2,2\nA,Warp,0.3,3\nA,45-degree bias,0.4,4\n"
    )
    curves = read_export(export_file, text, direction=None)
    found = [(c.direction, c.specimen) for c in curves]
    assert found == [("warp", "A"), ("warp", "B"), ("bias", "A")]
    np.testing.assert_allclose(curves[0].load, [100, 300])
    np.testing.assert_allclose(curves[0].elongation, [10, 30])
    assert "no fill; it has: warp, bias" in complaint(
        read_export, export_file, text, direction="fill"
    )
    columns = {"specimen": "Test direction", "direction": "Specimen No."}
    message = complaint(read_export, export_file, text, direction=None, columns=columns)
    assert "line 2, column 'Specimen No.': unknown direction 'A'" in message


def test_rows_after_the_largest_load_are_cut():
    u, load = np.arange(6.0), np.array([0, 5, 9, 10, 3, 1.0])
    cut = LoadCurve("warp", "1", u, load, None, time=u, frame=np.arange(6)).until_largest_load()
    assert cut.elongation.tolist() == [0, 1, 2, 3] and cut.load.max() == cut.load[-1] == 10
    assert (cut.cut, len(cut.time), len(cut.frame)) == (2, 4, 4)


@settings(deadline=None, max_examples=60)
@given(
    order=st.integers(1, 6),
    through_origin=st.booleans(),
    end=st.sampled_from([0.01, 3.3, 11.0, 1e3]),
    seed=st.integers(0, 2**32 - 1),
)
def test_load_polynomial_of_the_order_is_recovered(order, through_origin, end, seed):
    scaled = np.random.default_rng(seed).uniform(-500, 500, order + 1)
    scaled[0] *= not through_origin
    scaled[-1] += 10.0
    u = np.linspace(0, end, 40)
    load = np.polynomial.polynomial.polyval(u / end, scaled)
    fitted = fit_load_polynomial(u, load, order, through_origin)
    np.testing.assert_allclose(fitted.coefficients * end ** np.arange(order + 1), scaled, atol=1e-6)
    np.testing.assert_allclose(fitted(u), load, atol=1e-8)
    assert (fitted.order, fitted.points, fitted.end) == (order, 40, end)
    assert fitted.r_squared == pytest.approx(1.0) and fitted.rmse < 1e-8
    assert not through_origin or fitted.coefficients[0] == 0.0


def test_r_squared_and_rmse_of_a_load_polynomial():
    random = np.random.default_rng(1)
    u = np.linspace(0, 3, 50)
    load = 100 * u + random.normal(0, 20, 50)
    fitted = fit_load_polynomial(u, load, 1, through_origin=False)
    np.testing.assert_allclose(fitted.coefficients[::-1], np.polyfit(u, load, 1))
    left = load - fitted(u)
    assert fitted.rmse == pytest.approx(np.sqrt((left**2).mean()))
    assert fitted.r_squared == pytest.approx(np.corrcoef(u, load)[0, 1] ** 2)
    assert fitted(1.0).shape == ()


@pytest.mark.parametrize(
    ("u", "load", "order", "words"),
    [
        ([1, 1 + 4e-14, 1 - 4e-14, 1, 2], [1, 2, 3, 4, 5], 3, "settle only 2 of 3"),
        ([1, 2], [1, 2, 3], 1, "got 2 and 3"), ([1, np.nan], [1, 2], 1, "finite numbers"),
        ([], [], 1, "elongation above 0"), ([-1, -2], [1, 2], 1, "elongation above 0"),
        ([0, 0], [1, 2], 1, "elongation above 0"), ([1, 2], [3, 3], 1, "all 2 loads are 3 N"),
        ([1, 2, 3], [1, 2, 3], 4, "order 4: 4 coefficients need as many points, there are 3"),
        ([1, 1, 1, 1, 2], [1, 2, 3, 4, 5], 3, "order 3: the elongations settle only 2 of 3"),
        ([1, 2], [1, 2], 0, "order: expected 1 to 12, got 0"),
    ],
)  # fmt: skip
def test_points_that_determine_no_polynomial_are_refused(u, load, order, words):
    assert words in complaint(fit_load_polynomial, u, load, order)


def test_specimen_deviation_is_about_the_polynomial():
    line = LoadPolynomial(np.array([0.0, 10.0]), 2.0, np.nan, np.nan, 0)
    u, load = np.array([1.0, 2.0, 1.0, 2.0]), np.array([13.0, 23.0, 10.0, 16.0])
    assert specimen_deviation(u, load, line) == pytest.approx(np.std([3, 3, 0, -4], ddof=1))
    assert "scatter needs two points" in complaint(specimen_deviation, u[:1], load[:1], line)


PUBLISHED_EXAMPLE = Path(__file__).parents[2] / "examples/uniaxial-valmex7318/curves.csv"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("warp", "90", "line 4, column 'direction': unknown direction '90'"),
        ("fill", "warp", "warp is given twice"), ("812.44", "x", "line 4, column 'c1': expected"),
        ("23.329", "20.0", "expected 0 < gauge length < final length"),
        ("20.022,23.329", "0,25", "line 4: expected 0 < gauge length < final length, got 0 and 25"),
        ("20.022,23.329", "25,25", "line 4: expected 0 < gauge length < final length, got 25 and"),
        (",c3", ",k3", "column 'c3': this column is missing"),
        ("c1", "b1", "column 'c1': this column is missing"),
    ],
)  # fmt: skip
def test_damaged_file_of_polynomials_is_refused(tmp_path, old, new, words):
    path, text = tmp_path / "curves.csv", PUBLISHED_EXAMPLE.read_text()
    head, body = text[: text.index("direction,")], text[text.index("direction,") :]
    path.write_text(head + body.replace(old, new, 1))
    message = complaint(read_published_polynomials, path)
    assert "curves.csv" in message and words in message


def test_straight_line_has_one_coefficient(tmp_path):
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
    path.write_text(f"{head},c2\nwarp,20,25,1\n")
    assert "column 'c1': this column is missing" in complaint(read_published_polynomials, path)


def split(*elongation: float) -> list[list[float]]:
    u = np.array(elongation)
    curve = LoadCurve("warp", "s", u, 10 * u, None, time=np.arange(len(u)), notes=("n",))
    parts = split_at_restarts(curve)
    assert [p.specimen for p in parts] == [f"s {k}" for k in range(1, len(parts) + 1)]
    assert all(p.notes == ("n",) and (p.load == 10 * p.elongation).all() for p in parts)
    assert np.concatenate([p.time for p in parts]).tolist() == list(range(len(u)))
    return [p.elongation.tolist() for p in parts]


def test_specimen_begins_where_elongation_falls_below_half():
    assert split(0, 1, 2, 0.99, 3) == [[0, 1, 2], [0.99, 3]]
    assert split(0, 1, 2, 1.0, 3) == [[0, 1, 2, 1.0, 3]]
    assert split(0, 5, 0, 5, 0, 5) == [[0, 5], [0, 5], [0, 5]]
    # Noise up to a hundredth of all is no elongation yet.
    assert split(0.1, -0.1, 0.1, 10) == [[0.1, -0.1, 0.1, 10]]
    assert split(0.11, -0.1, 0.1, 10) == [[0.11], [-0.1, 0.1, 10]]


def test_directions_in_degrees_are_angles_from_the_warp(tmp_path):
    path = tmp_path / "fan.csv"
    rows = [f"{angle},{u},{(angle + 1) * u}" for angle in (0, 90, 45.0, 60, 15) for u in (1, 2)]
    path.write_text("\n".join(["direction_deg,elongation_mm,force_N", *rows]))
    curves = read_load_curves(path)
    directions = [curve.direction for curve in curves]
    assert directions == ["warp", "fill", "bias", "60 degrees", "15 degrees"]
    assert in_order(directions) == ["warp", "fill", "bias", "15 degrees", "60 degrees"]
    assert [cut_of(direction) for direction in directions[2:]] == ["bias"] * 3
    (steep,) = read_load_curves(path, direction="60 deg")
    assert steep.load.tolist() == [61.0, 122.0]
    path.write_text(path.read_text().replace("\n60,", "\n105,"))
    assert "unknown direction '105 deg'" in complaint(read_load_curves, path)
    # Whether 0 is the warp depends on the laboratory, unless the file says that it is an angle.
    path.write_text(path.read_text().replace("direction_deg", "direction"))
    assert "unknown direction '0'" in complaint(read_load_curves, path)


def test_specimens_side_by_side_are_named_by_a_pattern(tmp_path):
    """With lateral strains; the columns of the shorter specimen end in empty cells."""
    path = tmp_path / "foil.csv"
    names = ",".join(f"eps{k},width change{k},sig{k}" for k in (1, 2))
    path.write_text(f"{names}\n0,0,0,0,0,0\n0.01,-0.004,5,0.02,-0.01,9\n0.02,-0.008,10,,,\n")
    columns = {"elongation": "eps*", "load": "sig*", "lateral": "width*"}
    options = {"load_unit": "N", "length_unit": "mm/mm", "gauge_length": {"warp": 10.0}}
    first, second = read_load_curves(path, columns=columns, direction="warp", **options)
    assert first.elongation == pytest.approx([0, 0.1, 0.2]) and first.load.tolist() == [0, 5, 10]
    assert first.lateral == pytest.approx([0, -0.004, -0.008])
    assert second.lateral == pytest.approx([0, -0.01]) and len(second.load) == 2
    assert second.until_largest_load().lateral == pytest.approx([0, -0.01])
    words = complaint(read_load_curves, path, columns={**columns, "load": "F*"}, direction="warp")
    assert "F*" in words


@pytest.mark.parametrize(
    ("name", "direction"),
    [("4.5 deg", "4.5 degrees"), (4.5, "4.5 degrees"), ("45 deg", "bias"), (90, "fill")],
)
def test_directions_are_named_by_words_and_angles(name, direction):
    assert direction_named(name) == direction
