"""readers/fields.py: displacement fields from tables, and polynomial surfaces."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.fields import (
    PLAIN,
    DisplacementField,
    DisplacementSurface,
    fit_surface,
    read_fields,
    surface_table,
)
from bubblefit.readers.frames import FLAGGED, FrameOptions
from hypothesis import given, settings
from hypothesis import strategies as st

from ..support.refusals import complaint


def equation_4_4(c: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Eq. 4.4: C0 x^4 y^4 + C1 x^3 y^4 + ... + C24, by falling powers of y, then of x."""
    powers = [(i, j) for j in (4, 3, 2, 1, 0) for i in (4, 3, 2, 1, 0)]
    return sum(own * x**i * y**j for own, (i, j) in zip(c, powers, strict=True))


def on_a_disk(count: int, seed: int, radius: float = 100.0) -> np.ndarray:
    random = np.random.default_rng(seed)
    r, angle = radius * np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    return np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)


def test_coefficients_stand_in_the_order_of_equation_4_4():
    c = np.random.default_rng(4).standard_normal((3, 25))
    points = on_a_disk(300, 1, radius=1.5)
    u = np.stack([equation_4_4(row, *points.T) for row in c], axis=1)
    surface = fit_surface(DisplacementField(0.3, points, u), 4)
    np.testing.assert_allclose(surface.physical, c, atol=1e-10)
    np.testing.assert_allclose(surface.r_squared, 1.0, atol=1e-12)
    assert surface.scale == np.abs(points).max()


@settings(deadline=None, max_examples=40)
@given(
    degree=st.integers(0, 8),
    extra=st.integers(0, 4),
    seed=st.integers(0, 2**32 - 1),
    radius=st.sampled_from([1e-2, 1.0, 100.0, 1e4]),
)
def test_surface_of_the_degree_is_recovered(degree, extra, seed, radius):
    terms = np.random.default_rng(seed).standard_normal((3, degree + 1, degree + 1))

    def exact(points):
        return np.polynomial.polynomial.polyval2d(*(points / radius).T, terms.transpose(1, 2, 0)).T

    points = on_a_disk(600, seed, radius)
    surface = fit_surface(DisplacementField(0.1, points, exact(points)), min(degree + extra, 8))
    elsewhere = on_a_disk(100, seed + 1, 0.9 * radius)
    np.testing.assert_allclose(surface.evaluate(elsewhere), exact(elsewhere), atol=1e-8)
    np.testing.assert_allclose(surface.r_squared, 1.0, atol=1e-10)


def test_r_squared_of_a_surface_is_the_share_explained(shared_data):
    points = on_a_disk(2000, 3)
    random = np.random.default_rng(5)
    x = points[:, 0]
    # Noise as large as the signal explains half; a constant direction is met; pure noise is not.
    u = np.stack([x + np.std(x) * random.standard_normal(2000), 0 * x + 3, 0 * x], axis=1)
    surface = fit_surface(DisplacementField(0.1, points, u), 1)
    assert surface.r_squared[0] == pytest.approx(0.5, abs=0.05)
    np.testing.assert_array_equal(surface.r_squared[1:], 1.0)
    u[:, 2] = random.standard_normal(2000)
    assert fit_surface(DisplacementField(0.1, points, u), 1).r_squared[2] < 0.02
    path = shared_data / "bubble/grid/test1_11.csv"
    (field,) = read_fields([path], [0.1372402], replace(PLAIN, flag_column="flag"))
    r_squared = np.array([fit_surface(field, d).r_squared for d in (2, 4, 6, 8)])
    assert (np.diff(r_squared, axis=0) > 0).all()
    # The thesis has 0.92 to 0.997 on its own DIC fields with degree 4 (Table 5.3).
    assert (r_squared[1] > 0.99).all()


@pytest.fixture
def fitted_surfaces() -> tuple[DisplacementSurface, ...]:
    random = np.random.default_rng(8)
    points = on_a_disk(400, 2)
    return tuple(
        fit_surface(DisplacementField(p, points, random.standard_normal((400, 3))), degree)
        for p, degree in ((0.022, 4), (0.097, 0), (0.3, 8))
    )


def test_table_of_surfaces_has_equation_4_4(fitted_surfaces):
    points, table = on_a_disk(50, 6), surface_table(fitted_surfaces)
    assert list(table)[:6] == ["pressure_MPa", "direction", "R2", "degree", "scale_mm", "C0"]
    assert table["direction"].tolist() == [*"xyz"] * 3 and table["degree"].tolist()[::3] == [
        4,
        0,
        8,
    ]
    by_hand = [
        equation_4_4(table.loc[row, "C0":"C24"].to_numpy(float), *points.T) for row in (0, 1, 2)
    ]
    np.testing.assert_allclose(
        np.transpose(by_hand), fitted_surfaces[0].evaluate(points), atol=1e-10
    )
    assert table.loc[3, "C1":].isna().all() and table.loc[6].notna().all()


FIELD_NAMES = ("x", "y", "dx", "dy", "dz")
GOOD_FIELD = "x,y,dx,dy,dz,flag\n1,2,0.1,0.2,0.3,0\n-4,5,0.4,0.5,0.6,1\n7,8,0.7,0.8,0.9,0\n"


@pytest.fixture(scope="module")
def field_file(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("fields") / "field.csv"


def test_table_becomes_a_displacement_field(field_file):
    field_file.write_text("# DIC, frame 7\n\n" + GOOD_FIELD)
    (field,) = read_fields([field_file], [0.3], FrameOptions(FIELD_NAMES, flag_column="flag"))
    assert field.pressure == 0.3
    assert field.dropped == {FLAGGED: 1}
    np.testing.assert_array_equal(field.points, [[1, 2], [7, 8]])
    np.testing.assert_array_equal(field.displacement, [[0.1, 0.2, 0.3], [0.7, 0.8, 0.9]])
    (everything,) = read_fields([str(field_file)], [0.3])
    assert (len(everything.points), everything.dropped) == (3, {})
    columns = {"x": "X0", "y": '"Y0"', "dx": "U", "dy": "V", "dz": "W"}
    text = '% m\n "Y0" ,X0,W,V,U\n1,2,3,4,5\n'
    (field,) = fields_of(field_file, text, columns=columns, comment="%", length_scale=1e3)
    np.testing.assert_array_equal(field.points, [[2000, 1000]])
    np.testing.assert_array_equal(field.displacement, [[5000, 4000, 3000]])


def fields_of(path: Path, text: str, *pressures, **asked):
    path.write_text(text)
    return read_fields([path], pressures or [1.0], FrameOptions(FIELD_NAMES, **asked))


def test_height_of_the_reference_state_is_read_if_present(field_file):
    assert fields_of(field_file, GOOD_FIELD)[0].z is None
    high = "x,y,z,dx,dy,dz\n1,2,-0.5,0.1,0.2,0.3\n4,5,0.25,0.4,0.5,0.6\n"
    (field,) = fields_of(field_file, high, length_scale=10.0)
    np.testing.assert_array_equal(field.z, [-5.0, 2.5])
    # Under another name only where it is named; then it must be there.
    columns = {name: name for name in FIELD_NAMES} | {"z": "height"}
    (field,) = fields_of(field_file, high.replace("z,", "height,", 1), columns=columns)
    np.testing.assert_array_equal(field.z, [-0.5, 0.25])
    assert field.source.columns["z"] == "height" and field.path == field_file
    assert "column 'height'" in complaint(fields_of, field_file, high, columns=columns)


def test_doubtful_and_lost_points_are_dropped_and_counted(field_file):
    text = GOOD_FIELD.replace("-4,5,0.4,0.5,0.6,1", "-4,5,nan,,speckle,1")
    (field,) = fields_of(field_file, text, flag_column="flag")
    assert field.dropped == {FLAGGED: 1}
    assert "line 3, column 'dz'" in complaint(read_fields, [field_file], [1.0])
    lost = GOOD_FIELD.replace("0.3,0", ",0").replace("0.7,0.8,0.9,0", "0,0,NaN,0")
    (field,) = fields_of(field_file, lost + "3,3,1,1,1,0\n0,0,0,0,0,0\n")
    assert field.dropped == {"without a value": 2, "all zero": 1}
    np.testing.assert_array_equal(field.points, [[-4, 5], [3, 3]])
    for words in ("valid 1 0 1", "Validity true False TRUE", "invalid 0 1 0"):
        flags = iter(words.split())
        lines = [line.rsplit(",", 1)[0] + f",{next(flags)}" for line in GOOD_FIELD.splitlines()]
        (field,) = fields_of(field_file, "\n".join(lines))
        assert (len(field.points), field.dropped) == (2, {FLAGGED: 1})
    # What does not say its polarity is not used, and said; it may be named either way.
    (field,) = fields_of(field_file, GOOD_FIELD)
    assert "column 'flag' is not used" in field.source.notes[0] and field.dropped == {}
    (field,) = fields_of(field_file, GOOD_FIELD, valid_column="flag")
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
def test_bad_cell_is_named_with_its_line(field_file, rows, row, column, cell):
    row %= len(rows)
    rows[row][column] = cell
    # Two good rows beside it: something is left, and not all of it is zero.
    rows += [["1", "2", "3", "4", "5", "0"]] * 2
    text = "# a comment\n" + "\n".join(map(",".join, [[*FIELD_NAMES, "flag"], *rows]))
    if cell in LOST and column < 5:
        (field,) = fields_of(field_file, text, flag_column="flag")
        assert field.dropped["without a value"] == 1
        return
    message = complaint(fields_of, field_file, text, flag_column="flag")
    assert str(field_file) in message
    if cell in BAD_CELLS:
        assert (
            f"line {row + 3}, column {[*FIELD_NAMES, 'flag'][column]!r}: expected a number"
            in message
        )
    elif cell == "1,5":
        assert f"line {row + 3}: expected 6 cells as in the header, found 7" in message
    else:
        assert "quotation mark" in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "no such file"),
        ("", "found nothing"),
        ("\n# only a comment\n", "found nothing"),
        ("x,y,dx,dy,dz,flag\n", "only a header line"),
        ("a;b;c\n1;2;3\n", "no row of names"),
        (
            GOOD_FIELD.replace("dz", "p"),
            "column 'dz': this column is missing; the file has: x, y, dx",
        ),
        (
            GOOD_FIELD.replace("x,y,dx", "X,y,ux").replace("dy,dz", "u,dz"),
            "dx may be 'ux' or 'u'; name",
        ),
        (GOOD_FIELD.replace("x,y,", "x [px],y [px],"), "column 'x [px]': is in pixels"),
        (GOOD_FIELD.replace(",0\n", ",1\n"), "no row is left to use: 3 flagged as doubtful"),
        (GOOD_FIELD.replace("0.3", "p").replace("0.9", "p"), "found 'p'; so in 1 more row"),
        (
            GOOD_FIELD.replace("0.3", "nan").replace("0.9", "nan"),
            "no row is left to use: 1 flagged as",
        ),
        ("\0" * 40, "not a text file"),
        (b"\xff\xfe\x00", "not text in UTF-8"),
    ],
)
def test_refused_field_says_what_is_wrong(field_file, text, words):
    field_file.unlink(missing_ok=True)
    if text is not None:
        field_file.write_bytes(text if isinstance(text, bytes) else text.encode())
    message = complaint(
        read_fields, [field_file], [0.1], FrameOptions(FIELD_NAMES, flag_column="flag")
    )
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
def test_inconsistent_arguments_of_fields_are_refused(field_file, change, field):
    field_file.write_text(GOOD_FIELD)

    def read(files=(field_file,), pressures=(0.1,), **options):
        return read_fields(files, pressures, FrameOptions(FIELD_NAMES, **options))

    assert field in complaint(read, **change)


def test_chosen_frames_of_a_file_are_counted_without_a_first_one_at_rest(tmp_path):
    path = tmp_path / "all.csv"
    moved = "".join(f"{k},{x},{y},0,0,{k}\n" for k in range(4) for x in (0, 1) for y in (0, 1, 2))
    path.write_text(f"frame,x,y,dx,dy,dz\n{moved}")

    def chosen(count):
        options = replace(PLAIN, columns=None)
        return read_fields([path], [0.1, 0.3], options, frames=[0, 2], count=count)

    for count, rises in ((3, [1, 3]), (4, [0, 2])):
        assert [field.displacement[1, 2] for field in chosen(count)] == rises
    for count in (2, 5):
        words = f"files: expected one frame for each of {count} pressures, found 4"
        assert complaint(chosen, count) == words


def test_measured_fields_are_read_completely(shared_data):
    with open(shared_data / "bubble/grid_pressures.csv", newline="") as stream:
        pressures = [float(row["p_MPa"]) for row in csv.DictReader(stream)]
    for test in (1, 2, 3):
        files = [shared_data / f"bubble/grid/test{test}_{i:02d}.csv" for i in range(20)]
        fields = read_fields(files, pressures, FrameOptions(FIELD_NAMES, flag_column="flag"))
        for path, field in zip(files, fields, strict=True):
            rows = [line for line in path.read_text().splitlines() if line[:1] not in "#x"]
            flagged = sum(not line.endswith(",0") for line in rows)
            assert len(field.points) == len(rows) - flagged
            assert field.dropped == ({FLAGGED: flagged} if flagged else {})
        assert (np.diff([f.displacement[:, 2].max() for f in fields]) > 0).all()
        assert np.abs(fields[0].points).max() < 100


def test_impossible_surfaces_are_refused():
    points = np.random.default_rng(1).uniform(-50, 50, (4, 2))
    field = DisplacementField(0.02, points, np.column_stack([points, points[:, 0] * points[:, 1]]))
    found = fit_surface(field, 1)  # four coefficients through four points
    np.testing.assert_allclose(found.evaluate(points), field.displacement, atol=1e-9)
    line = DisplacementField(0.02, np.tile(points[:2], (4, 1)), np.zeros((8, 3)))
    # Rounding is no second direction: the singular value of it is 1e-14 of the others.
    place = np.linspace(-50.0, 50.0, 8)[:, None]
    rounded = place * [0.6, 0.8] + 1e-12 * points[np.arange(8) % 4] / 50.0
    rounded_line = DisplacementField(0.02, rounded, np.zeros((8, 3)))
    assert "settle only" in complaint(fit_surface, rounded_line, 1)
    few = DisplacementField(0.02, points[:3], np.zeros((3, 3)))
    for bad, degree, words in (
        (few, 1, "surface of degree 1 at 20 kPa: 4 coefficients need as many points, there are 3"),
        (line, 1, "surface of degree 1 at 20 kPa: the 8 points lie so that they settle only 2"),
        (field, -1, "degree: expected 0 to 12, got -1"), (field, 13, "degree: expected 0 to 12"),
    ):  # fmt: skip
        assert complaint(fit_surface, bad, degree).startswith(words)
    assert complaint(fit_surface, few, 1).endswith("there are 3; lower the degree")
