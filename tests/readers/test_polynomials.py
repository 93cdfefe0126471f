"""Displacement fields and polynomials over the disk and over the load."""

import csv
from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.bubble.sheet import fit_disk_polynomial
from bubblefit.experiments.strips.curve_shape import compare_orders
from bubblefit.readers.curves import (
    LoadPolynomial,
    fit_load_polynomial,
    read_load_curves,
    read_published_polynomials,
    specimen_deviation,
    split_at_restarts,
)
from bubblefit.readers.fields import read_fields
from bubblefit.readers.frames import FLAGGED, FrameOptions
from hypothesis import given, settings
from hypothesis import strategies as st

from ..support.paths import PUBLISHED
from ..support.refusals import complaint

NAMES = ("x", "y", "dx", "dy", "dz")
GOOD = "x,y,dx,dy,dz,flag\n1,2,0.1,0.2,0.3,0\n-4,5,0.4,0.5,0.6,1\n7,8,0.7,0.8,0.9,0\n"


@pytest.fixture(scope="module")
def scratch(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("fields") / "field.csv"


def test_a_table_becomes_a_field(scratch):
    scratch.write_text("# DIC, frame 7\n\n" + GOOD)
    (field,) = read_fields([scratch], [0.3], FrameOptions(NAMES, flag_column="flag"))
    assert field.pressure == 0.3
    assert field.dropped == {FLAGGED: 1}
    np.testing.assert_array_equal(field.points, [[1, 2], [7, 8]])
    np.testing.assert_array_equal(field.displacement, [[0.1, 0.2, 0.3], [0.7, 0.8, 0.9]])
    (everything,) = read_fields([str(scratch)], [0.3])
    assert (len(everything.points), everything.dropped) == (3, {})
    columns = {"x": "X0", "y": '"Y0"', "dx": "U", "dy": "V", "dz": "W"}
    text = '% m\n "Y0" ,X0,W,V,U\n1,2,3,4,5\n'
    (field,) = fields_of(scratch, text, columns=columns, comment="%", length_scale=1e3)
    np.testing.assert_array_equal(field.points, [[2000, 1000]])
    np.testing.assert_array_equal(field.displacement, [[5000, 4000, 3000]])


def fields_of(path: Path, text: str, *pressures, **asked):
    path.write_text(text)
    return read_fields([path], pressures or [1.0], FrameOptions(NAMES, **asked))


def test_the_height_of_the_reference_state_is_read_where_it_is_there(scratch):
    assert fields_of(scratch, GOOD)[0].z is None
    high = "x,y,z,dx,dy,dz\n1,2,-0.5,0.1,0.2,0.3\n4,5,0.25,0.4,0.5,0.6\n"
    (field,) = fields_of(scratch, high, length_scale=10.0)
    np.testing.assert_array_equal(field.z, [-5.0, 2.5])
    # Under another name only where it is named; then it must be there.
    columns = {name: name for name in NAMES} | {"z": "height"}
    (field,) = fields_of(scratch, high.replace("z,", "height,", 1), columns=columns)
    np.testing.assert_array_equal(field.z, [-0.5, 0.25])
    assert field.source.columns["z"] == "height" and field.path == scratch
    assert "column 'height'" in complaint(fields_of, scratch, high, columns=columns)


def test_points_that_are_doubtful_or_lost(scratch):
    text = GOOD.replace("-4,5,0.4,0.5,0.6,1", "-4,5,nan,,speckle,1")
    (field,) = fields_of(scratch, text, flag_column="flag")
    assert field.dropped == {FLAGGED: 1}
    assert "line 3, column 'dz'" in complaint(read_fields, [scratch], [1.0])
    lost = GOOD.replace("0.3,0", ",0").replace("0.7,0.8,0.9,0", "0,0,NaN,0")
    (field,) = fields_of(scratch, lost + "3,3,1,1,1,0\n0,0,0,0,0,0\n")
    assert field.dropped == {"without a value": 2, "all zero": 1}
    np.testing.assert_array_equal(field.points, [[-4, 5], [3, 3]])
    for words in ("valid 1 0 1", "Validity true False TRUE", "invalid 0 1 0"):
        flags = iter(words.split())
        lines = [line.rsplit(",", 1)[0] + f",{next(flags)}" for line in GOOD.splitlines()]
        (field,) = fields_of(scratch, "\n".join(lines))
        assert (len(field.points), field.dropped) == (2, {FLAGGED: 1})
    # What does not say its polarity is not used, and said; it may be named either way.
    (field,) = fields_of(scratch, GOOD)
    assert "column 'flag' is not used" in field.source.notes[0] and field.dropped == {}
    (field,) = fields_of(scratch, GOOD, valid_column="flag")
    np.testing.assert_array_equal(field.points, [[-4, 5]])


tables = st.lists(
    st.tuples(*[st.floats(-1e6, 1e6, allow_subnormal=False)] * 5), min_size=1, max_size=30
)


LOST = ["", " ", "nan", "NaN"]
BAD_CELLS = [*LOST, "inf", "-inf", "1e999", "9" * 400, "1;2", "1.2.3", "x", "0x1"]


@settings(deadline=None)
@given(
    rows=tables.map(lambda rows: [[*map(repr, row), "0"] for row in rows]),
    row=st.integers(0, 10**6),
    column=st.integers(0, 5),
    cell=st.sampled_from([*BAD_CELLS, "1,5", '"1']),
)
def test_one_bad_cell_is_found_with_its_line(scratch, rows, row, column, cell):
    row %= len(rows)
    rows[row][column] = cell
    # Two good rows beside it: something is left, and not all of it is zero.
    rows += [["1", "2", "3", "4", "5", "0"]] * 2
    text = "# a comment\n" + "\n".join(map(",".join, [[*NAMES, "flag"], *rows]))
    if cell in LOST and column < 5:
        (field,) = fields_of(scratch, text, flag_column="flag")
        assert field.dropped["without a value"] == 1
        return
    message = complaint(fields_of, scratch, text, flag_column="flag")
    assert str(scratch) in message
    if cell in BAD_CELLS:
        assert f"line {row + 3}, column {[*NAMES, 'flag'][column]!r}: expected a number" in message
    elif cell == "1,5":
        assert f"line {row + 3}: expected 6 cells as in the header, found 7" in message
    else:
        assert "quotation mark" in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "no such file"), ("", "found nothing"), ("\n# only a comment\n", "found nothing"),
        ("x,y,dx,dy,dz,flag\n", "only a header line"), ("a;b;c\n1;2;3\n", "no row of names"),
        (GOOD.replace("dz", "p"), "column 'dz': this column is missing; the file has: x, y, dx"),
        (GOOD.replace("x,y,dx", "X,y,ux").replace("dy,dz", "u,dz"), "dx may be 'ux' or 'u'; name"),
        (GOOD.replace("x,y,", "x [px],y [px],"), "column 'x [px]': is in pixels"),
        (GOOD.replace(",0\n", ",1\n"), "no row is left to use: 3 flagged as doubtful"),
        (GOOD.replace("0.3", "p").replace("0.9", "p"), "found 'p'; so in 1 more row"),
        (GOOD.replace("0.3", "nan").replace("0.9", "nan"), "no row is left to use: 1 flagged as"),
        ("\0" * 40, "not a text file"), (b"\xff\xfe\x00", "not text in UTF-8"),
    ],
)  # fmt: skip
def test_the_refusal_says_what_is_wrong(scratch, text, words):
    scratch.unlink(missing_ok=True)
    if text is not None:
        scratch.write_bytes(text if isinstance(text, bytes) else text.encode())
    message = complaint(read_fields, [scratch], [0.1], FrameOptions(NAMES, flag_column="flag"))
    assert words in message and "field.csv" in message


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"pressures": [0.1, 0.2]}, "files"), ({"length_scale": 0.0}, "length_scale"),
        ({"length_scale": float("nan")}, "length_scale"), ({"columns": {"Y": "y"}}, "columns"),
        ({"length_scale": 1e308}, str(Path("field.csv"))),
        ({"files": [Path.home()]}, "is a folder"),
    ],
)  # fmt: skip
def test_arguments_that_do_not_go_together(scratch, change, field):
    scratch.write_text(GOOD)

    def read(files=(scratch,), pressures=(0.1,), **options):
        return read_fields(files, pressures, FrameOptions(NAMES, **options))

    assert field in complaint(read, **change)


def test_the_real_tests_are_read_whole(shared_data):
    with open(shared_data / "bubble/grid_pressures.csv", newline="") as stream:
        pressures = [float(row["p_MPa"]) for row in csv.DictReader(stream)]
    for test in (1, 2, 3):
        files = [shared_data / f"bubble/grid/test{test}_{i:02d}.csv" for i in range(20)]
        fields = read_fields(files, pressures, FrameOptions(NAMES, flag_column="flag"))
        for path, field in zip(files, fields, strict=True):
            rows = [line for line in path.read_text().splitlines() if line[:1] not in "#x"]
            flagged = sum(not line.endswith(",0") for line in rows)
            assert len(field.points) == len(rows) - flagged
            assert field.dropped == ({FLAGGED: flagged} if flagged else {})
        assert (np.diff([f.displacement[:, 2].max() for f in fields]) > 0).all()
        assert np.abs(fields[0].points).max() < 100


RADIUS = 80.0
POINTS = RADIUS * np.random.default_rng(2).uniform(-0.7, 0.7, (60, 2))


def surface(points: np.ndarray) -> np.ndarray:
    x, y = points.T / RADIUS
    return np.column_stack([3 + x - 2 * x * y, 0.5 * y**3 - x**2 * y])


def test_a_disk_polynomial_is_given_back():
    found = fit_disk_polynomial(POINTS, surface(POINTS), RADIUS, 3)
    there = np.array([[0.0, 0.0], [80.0, 0.0], [-40.0, 60.0]])
    np.testing.assert_allclose(found.at(there), surface(there), atol=1e-12)
    assert (found.radius, found.degree, found.coefficients.shape) == (RADIUS, 3, (10, 2))
    assert found.rms == pytest.approx([0.0, 0.0], abs=1e-12)
    # Of a lower degree the first is met, the second is not.
    low = fit_disk_polynomial(POINTS, surface(POINTS), RADIUS, 2)
    left = surface(POINTS) - low.at(POINTS)
    assert low.rms == pytest.approx(np.sqrt(np.mean(left**2, axis=0)))
    assert low.rms[0] < 1e-12 and low.rms[1] > 0.01
    mean = fit_disk_polynomial(np.eye(2), np.array([[1.0], [4.0]]), 1.0, 0)
    assert mean.at(np.zeros((1, 2))).tolist() == [[2.5]] and mean.rms.tolist() == [1.5]
    assert fit_disk_polynomial(POINTS[:20], surface(POINTS[:20]), RADIUS, 3).degree == 3
    for points in (POINTS[:19], POINTS * [1.0, 0.0]):
        assert "degree: " in complaint(fit_disk_polynomial, points, surface(points), RADIUS, 3)


@settings(deadline=None, max_examples=60)
@given(
    order=st.integers(1, 6),
    through_origin=st.booleans(),
    end=st.sampled_from([0.01, 3.3, 11.0, 1e3]),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_polynomial_of_the_order_is_met_exactly(order, through_origin, end, seed):
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


def test_r_squared_and_rmse_are_those_of_numpy():
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
        ([1, 2], [1, 2, 3], 1, "got 2 and 3"), ([1, np.nan], [1, 2], 1, "finite numbers"),
        ([], [], 1, "elongation above 0"), ([-1, -2], [1, 2], 1, "elongation above 0"),
        ([0, 0], [1, 2], 1, "elongation above 0"), ([1, 2], [3, 3], 1, "all 2 loads are 3 N"),
        ([1, 2, 3], [1, 2, 3], 4, "order 4: 4 coefficients need as many points, there are 3"),
        ([1, 1, 1, 1, 2], [1, 2, 3, 4, 5], 3, "order 3: the elongations settle only 2 of 3"),
        ([1, 2], [1, 2], 0, "order: expected 1 to 12, got 0"),
    ],
)  # fmt: skip
def test_points_that_settle_no_polynomial(u, load, order, words):
    assert words in complaint(fit_load_polynomial, u, load, order)


def test_scatter_is_about_the_polynomial():
    line = LoadPolynomial(np.array([0.0, 10.0]), 2.0, np.nan, np.nan, 0)
    u, load = np.array([1.0, 2.0, 1.0, 2.0]), np.array([13.0, 23.0, 10.0, 16.0])
    assert specimen_deviation(u, load, line) == pytest.approx(np.std([3, 3, 0, -4], ddof=1))
    assert "scatter needs two points" in complaint(specimen_deviation, u[:1], load[:1], line)


def test_scores_are_what_they_say():
    random = np.random.default_rng(3)
    u = np.sort(random.uniform(0, 5, 30))
    load = 50 * u + 20 * u**2 + random.normal(0, 5, 30)
    names = np.arange(30) % 3
    for through_origin in (True, False):
        single = compare_orders(u, load, [1, 2, 3], through_origin)
        whole = compare_orders(u, load, [1, 2, 3], through_origin, names.tolist())
        assert [order for order, _, _ in single] == [1, 2, 3]
        for (order, rmse, each), (_, _, by_specimen) in zip(single, whole, strict=True):
            left = load - fit_load_polynomial(u, load, order, through_origin)(u)
            assert rmse == pytest.approx(np.sqrt((left**2).mean()))
            # The shortcut through the hat matrix against really fitting without.
            for groups, found in ((np.arange(30), each), (names, by_specimen)):
                out = load.copy()
                for g in np.unique(groups):
                    kept = groups != g
                    own = fit_load_polynomial(u[kept], load[kept], order, through_origin)
                    out[~kept] -= own(u[~kept])
                assert found == pytest.approx(np.sqrt((out**2).mean()), rel=1e-8)


@pytest.mark.parametrize("through_origin", [True, False])
def test_as_few_points_as_can_be_compared(through_origin):
    u = np.arange(1.0, 5.0 if through_origin else 6.0)
    load = np.array([1.0, 5.0, 8.0, 17.0, 26.0])[: len(u)]
    ((_, _, left_out),) = compare_orders(u, load, [2], through_origin)
    assert np.isfinite(left_out)
    said = complaint(compare_orders, u[1:], load[1:], [2], through_origin)
    assert said.startswith("order 2: comparing needs")


@pytest.mark.parametrize(("other", "finite"), [(1.0, True), (0.0, False)])
def test_a_specimen_that_the_others_do_not_settle(other, finite):
    """Its error is that of a line through the one other point, which may lie at the origin."""
    u, load = np.array([100.0, 100.0, other]), np.array([205.0, 195.0, 3.0])
    ((_, _, left_out),) = compare_orders(u, load, [1], specimens=["a", "a", "b"])
    # Without a: 3 u, off by 95 and 105. Without b: 2 u, off by 1.
    expected = np.sqrt((95.0**2 + 105.0**2 + 1.0) / 3) if finite else np.inf
    assert left_out == pytest.approx(expected)


def test_the_orders_offered_decide_the_thesis_choice(shared_data):
    for curve in read_load_curves(shared_data / "uniaxial/valmex7318_load_gauge.csv"):
        parts = split_at_restarts(curve)
        names = [part.specimen for part in parts for _ in part.load]
        found = compare_orders(curve.elongation, curve.load, specimens=names)
        _, rmse, left_out = zip(*found, strict=True)
        assert (np.diff(rmse) < 0).all()
        # "The fill and bias directions can be simplified to third order" (section 3.2): even to
        # second in fill, for a specimen that was left out; warp needs more.
        best = {"warp": 6, "fill": 5, "bias": 7}[curve.direction]
        assert int(np.argmin(left_out)) + 1 == best
        if curve.direction == "fill":
            assert left_out[1] < min(left_out[2], left_out[3])


EXAMPLE = Path(__file__).parents[2] / "examples/uniaxial-valmex7318/curves.csv"


def test_the_examples_have_the_published_polynomials():
    ours = read_published_polynomials(EXAMPLE)
    theirs = read_published_polynomials(PUBLISHED / "published_uniaxial_polynomials.csv")
    assert list(ours) == list(theirs) == ["warp", "fill", "bias"]
    for one, other in zip(ours.values(), theirs.values(), strict=True):
        np.testing.assert_array_equal(one.polynomial.coefficients, other.polynomial.coefficients)
        assert (one.gauge_length, one.final_length) == (other.gauge_length, other.final_length)
        assert one.scatter == other.scatter
        assert (one.polynomial(0.0), one.polynomial.order) == (0.0, 4)
    # Lengths are those of Table 3.1.
    strain = {name: p.polynomial.end / p.gauge_length for name, p in ours.items()}
    assert strain == pytest.approx({"warp": 0.165, "fill": 0.261, "bias": 0.555}, abs=5e-4)


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
def test_a_damaged_file_of_polynomials(tmp_path, old, new, words):
    path, text = tmp_path / "curves.csv", EXAMPLE.read_text()
    head, body = text[: text.index("direction,")], text[text.index("direction,") :]
    path.write_text(head + body.replace(old, new, 1))
    message = complaint(read_published_polynomials, path)
    assert "curves.csv" in message and words in message


@pytest.fixture
def points(shared_data):
    curves = read_load_curves(shared_data / "uniaxial/valmex7318_load_gauge.csv")
    return {curve.direction: curve for curve in curves}


def test_the_published_scatter_is_a_standard_deviation(points):
    """21.7, 64.1, 40.3 N: about their own mean, n - 1."""
    for direction, one in read_published_polynomials(EXAMPLE).items():
        curve = points[direction]
        found = specimen_deviation(curve.elongation, curve.load, one.polynomial)
        assert found == pytest.approx(one.scatter, abs=0.05)


def test_one_fill_point_was_not_digitised(points):
    """Fill gives R^2 0.9576 where Table 3.1 has 0.959, and coefficients 0.4 N/mm apart."""
    published = read_published_polynomials(EXAMPLE)["fill"].polynomial
    curve = points["fill"]
    refitted = fit_load_polynomial(curve.elongation, curve.load)
    assert refitted.r_squared == pytest.approx(0.9576, abs=5e-5)
    assert np.abs(refitted.coefficients - published.coefficients).max() > 0.4
    completed = fit_load_polynomial(np.append(curve.elongation, 0.07), np.append(curve.load, -2.1))
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
    path.write_text(f"{head},c2\nwarp,20,25,1\n")
    assert "column 'c1': this column is missing" in complaint(read_published_polynomials, path)
