"""Displacement fields read from tables."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.readers.fields import read_fields
from bubblefit.readers.frames import FLAGGED, FrameOptions
from hypothesis import given, settings
from hypothesis import strategies as st

from ..complaints import complaint

NAMES = ("x", "y", "dx", "dy", "dz")
GOOD = "x,y,dx,dy,dz,flag\n1,2,0.1,0.2,0.3,0\n-4,5,0.4,0.5,0.6,1\n7,8,0.7,0.8,0.9,0\n"


@pytest.fixture(scope="module")
def scratch(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("fields") / "field.csv"


def test_a_table_becomes_a_field(scratch):
    scratch.write_text("# DIC, frame 7\n\n" + GOOD)
    (field,) = read_fields([scratch], [0.3], flag_column="flag")
    assert field.pressure == 0.3
    assert field.dropped == {FLAGGED: 1}
    np.testing.assert_array_equal(field.points, [[1, 2], [7, 8]])
    np.testing.assert_array_equal(field.displacement, [[0.1, 0.2, 0.3], [0.7, 0.8, 0.9]])
    (everything,) = read_fields([str(scratch)], [0.3])
    assert (len(everything.points), everything.dropped) == (3, {})


def test_names_units_and_comments_are_the_callers(scratch):
    scratch.write_text('% m\n "Y0" ,X0,W,V,U\n1,2,3,4,5\n')
    columns = {"x": "X0", "y": '"Y0"', "dx": "U", "dy": "V", "dz": "W"}
    (field,) = read_fields([scratch], [1.0], columns, comment="%", length_scale=1e3)
    np.testing.assert_array_equal(field.points, [[2000, 1000]])
    np.testing.assert_array_equal(field.displacement, [[5000, 4000, 3000]])


def test_the_height_of_the_reference_state_is_read_where_it_is_there(scratch):
    assert read_fields([_written(scratch, GOOD)], [1.0])[0].z is None
    high = "x,y,z,dx,dy,dz\n1,2,-0.5,0.1,0.2,0.3\n4,5,0.25,0.4,0.5,0.6\n"
    (field,) = read_fields([_written(scratch, high)], [1.0], length_scale=10.0)
    np.testing.assert_array_equal(field.z, [-5.0, 2.5])
    # Under another name only where it is named; then it must be there.
    other = high.replace("z,", "height,", 1)
    columns = {name: name for name in NAMES} | {"z": "height"}
    (field,) = read_fields([_written(scratch, other)], [1.0], columns)
    np.testing.assert_array_equal(field.z, [-0.5, 0.25])
    assert field.source.columns["z"] == "height" and field.path == scratch
    assert "column 'height': this column is missing" in complaint(
        read_fields, [_written(scratch, high)], [1.0], columns
    )


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_a_doubtful_row_may_hold_anything(scratch):
    scratch.write_text(GOOD.replace("-4,5,0.4,0.5,0.6,1", "-4,5,nan,,speckle,1"))
    (field,) = read_fields([scratch], [1.0], flag_column="flag")
    assert field.dropped == {FLAGGED: 1}
    assert "line 3, column 'dz'" in complaint(read_fields, [scratch], [1.0])


def test_lost_points_are_dropped_and_counted(scratch):
    lost = GOOD.replace("0.3,0", ",0").replace("0.7,0.8,0.9,0", "0,0,NaN,0")
    (field,) = read_fields([_written(scratch, lost + "3,3,1,1,1,0\n0,0,0,0,0,0\n")], [1.0])
    assert field.dropped == {"without a value": 2, "all zero": 1}
    np.testing.assert_array_equal(field.points, [[-4, 5], [3, 3]])
    # In a frame at rest one row of zeros is the point at the origin.
    (field,) = read_fields([_written(scratch, "x,y,dx,dy,dz\n0,0,0,0,0\n1,2,0,0,0\n")], [1.0])
    assert (len(field.points), field.dropped) == (2, {})
    (field,) = read_fields(
        [_written(scratch, "x,y,dx,dy,dz\n0,0,0,0,0\n0,0,0,0,0\n1,2,0,0,0\n")], [1]
    )
    assert field.dropped == {"all zero": 2}


def test_flags_of_either_polarity(scratch):
    for heading, words in (
        ("valid", "1 0 1"),
        ("Validity", "true False TRUE"),
        ("invalid", "0 1 0"),
    ):
        flags = iter([heading, *words.split()])
        lines = [line.rsplit(",", 1)[0] + f",{next(flags)}" for line in GOOD.splitlines()]
        (field,) = read_fields([_written(scratch, "\n".join(lines))], [1.0])
        assert (len(field.points), field.dropped) == (2, {FLAGGED: 1})
    # What does not say its polarity is not used, and said; it may be named either way.
    (field,) = read_fields([_written(scratch, GOOD)], [1.0])
    assert "column 'flag' is not used" in field.source.notes[0] and field.dropped == {}
    options = FrameOptions(NAMES, valid_column="flag")
    (field,) = read_fields([scratch], [1.0], options=options)
    np.testing.assert_array_equal(field.points, [[-4, 5]])


numbers = st.floats(-1e6, 1e6, allow_subnormal=False)
tables = st.lists(st.tuples(*[numbers] * 5, st.sampled_from([0, 1])), min_size=1, max_size=30)


@settings(deadline=None)
@given(
    rows=tables.filter(lambda rows: any(row[5] == 0 for row in rows)),
    order=st.permutations([*NAMES, "flag", "note"]),
    breaks=st.sampled_from(["\n", "\r\n"]),
    preamble=st.sampled_from(["", "# one\n", "#\n\n# two, 2\n", "\ufeff"]),
    blank=st.booleans(),
)
def test_good_tables_come_back_exactly(scratch, rows, order, breaks, preamble, blank):
    lines = [",".join(order)]
    for row in rows:
        cells = dict(zip([*NAMES, "flag"], map(repr, row), strict=True)) | {"note": "a b"}
        lines += [",".join(cells[name] for name in order)] + [""] * blank
    text = preamble + breaks.join(lines) + breaks
    scratch.write_bytes(text.encode())
    (field,) = read_fields([scratch], [0.1], flag_column="flag")
    kept = np.array([row[:5] for row in rows if row[5] == 0])
    np.testing.assert_array_equal(np.hstack([field.points, field.displacement]), kept)
    assert sum(field.dropped.values()) == len(rows) - len(kept)


LOST_CELLS = ["", " ", "nan", "NaN"]
BAD_CELLS = [*LOST_CELLS, "inf", "-inf", "1e999", "9" * 400, "1;2", "1.2.3", "x", "0x1"]


@settings(deadline=None)
@given(
    rows=tables.map(lambda rows: [[*map(repr, row[:5]), "0"] for row in rows]),
    row=st.integers(0, 10**6),
    column=st.integers(0, 5),
    cell=st.sampled_from([*BAD_CELLS, "1,5", '"1']),
)
def test_one_bad_cell_is_found_with_its_line(scratch, rows, row, column, cell):
    row %= len(rows)
    rows[row][column] = cell
    if cell in LOST_CELLS and column < 5:
        # Two good rows beside it: something is left, and not all of it is zero.
        rows += [["1", "2", "3", "4", "5", "0"]] * 2
        scratch.write_text("\n".join(map(",".join, [[*NAMES, "flag"], *rows])))
        (field,) = read_fields([scratch], [0.1], flag_column="flag")
        assert field.dropped["without a value"] == 1
        return
    text = "\n".join(map(",".join, [[*NAMES, "flag"], *rows]))
    scratch.write_text(f"# a comment\n{text}\n")
    message = complaint(read_fields, [scratch], [0.1], flag_column="flag")
    assert str(scratch) in message
    if cell in BAD_CELLS:
        assert f"line {row + 3}, column {[*NAMES, 'flag'][column]!r}: expected a number" in message
    elif cell == "1,5":
        assert f"line {row + 3}: expected 6 cells as in the header, found 7" in message
    else:
        assert "quotation mark" in message


@settings(deadline=None, max_examples=300)
@given(
    start=st.integers(0, len(GOOD)),
    length=st.integers(0, 30),
    garbage=st.one_of(
        st.binary(max_size=20),
        st.text('",\n#.e-+0129 \t\r;', max_size=20).map(str.encode),
    ),
)
def test_a_damaged_table_is_a_field_or_refused(scratch, start, length, garbage):
    content = GOOD.encode()
    scratch.write_bytes(content[:start] + garbage + content[start + length :])
    try:
        (field,) = read_fields([scratch], [0.1], flag_column="flag")
    except InputError as error:
        assert "\n" not in str(error)
        assert str(scratch) in str(error)
    else:
        assert len(field.points) == len(field.displacement) > 0
        assert np.isfinite(field.points).all() and np.isfinite(field.displacement).all()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "no such file"),
        ("", "found nothing"),
        ("\n# only a comment\n", "found nothing"),
        ("x,y,dx,dy,dz,flag\n", "only a header line"),
        (GOOD.replace("dz", "p"), "column 'dz': this column is missing; the file has: x, y, dx"),
        (GOOD.replace("dz", "dy"), "column 'dy': this column appears twice"),
        (GOOD.replace("dy,dz", "u,dz"), "column 'dy': this column is missing"),
        (GOOD.replace("x,y,dx", "X,y,ux").replace("dy,dz", "u,dz"), "dx may be 'ux' or 'u'; name"),
        (GOOD.replace("x,y,", "x [px],y [px],"), "column 'x [px]': is in pixels; export lengths"),
        ("a;b;c\n1;2;3\n", "no row of names with places and displacements"),
        (GOOD.replace(",0\n", ",1\n"), "no row is left to use: 3 flagged as doubtful"),
        (GOOD.replace(",0\n", ",?\n"), "line 2, column 'flag': expected a number, found '?'"),
        (GOOD.replace("0.3", "p").replace("0.9", "p"), "found 'p'; so in 1 more row"),
        (GOOD.replace("0.3", "nan").replace("0.9", "nan"), "no row is left to use: 1 flagged as"),
        ("x;y;dx;dy;dz\n1;2;3,100;1,200;2,300\n", "is the comma a decimal mark, or does it mark"),
        (GOOD.replace("7,8,0.7,0.8,0.9,0", "7,8,0.7"), "line 4, column 'flag'"),
        ("\0" * 40, "not a text file"),
        (b"\xff\xfe\x00", "not text in UTF-8"),
    ],
)
def test_the_refusal_says_what_is_wrong(scratch, text, words):
    scratch.unlink(missing_ok=True)
    if text is not None:
        scratch.write_bytes(text if isinstance(text, bytes) else text.encode())
    message = complaint(read_fields, [scratch], [0.1], flag_column="flag")
    assert words in message
    assert "field.csv" in message


def test_a_folder_is_not_a_table(tmp_path):
    assert "cannot be read" in complaint(read_fields, [tmp_path], [0.1])


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"pressures": [0.1, 0.2]}, "files"),
        ({"length_scale": 0.0}, "length_scale"),
        ({"length_scale": float("nan")}, "length_scale"),
        ({"columns": {"x": "x", "Y": "y"}}, "columns: unknown quantity 'Y'"),
    ],
)
def test_arguments_that_do_not_go_together(scratch, change, field):
    scratch.write_text(GOOD)
    asked = {"files": [scratch], "pressures": [0.1]} | change
    assert complaint(read_fields, **asked).startswith(field)


def test_lengths_beyond_all_measure(scratch):
    scratch.write_text(GOOD.replace("0.9", "1e308"))
    assert "length unit" in complaint(read_fields, [scratch], [0.1], length_scale=1e3)


def test_the_real_tests_are_read_whole(shared_data):
    for test in (1, 2, 3):
        files = [shared_data / f"bubble/grid/test{test}_{i:02d}.csv" for i in range(20)]
        with open(shared_data / "bubble/grid_pressures.csv", newline="") as stream:
            pressures = [float(row["p_MPa"]) for row in csv.DictReader(stream)]
        fields = read_fields(files, pressures, flag_column="flag")
        for path, field in zip(files, fields, strict=True):
            rows = [line for line in path.read_text().splitlines() if line[:1] not in "#x"]
            flagged = sum(not line.endswith(",0") for line in rows)
            assert len(field.points) == len(rows) - flagged
            assert field.dropped == ({FLAGGED: flagged} if flagged else {})
        apex = [f.displacement[:, 2].max() for f in fields]
        assert (np.diff(apex) > 0).all()
        assert np.abs(fields[0].points).max() < 100
