"""readers/formats/tecplot.py: zones of Tecplot's text files."""

import numpy as np
import pytest
from bubblefit.readers.fields import read_fields
from bubblefit.readers.frames import FrameOptions, read_frames

from ...support.refusals import complaint

ZONE = "VARIABLES = x y z dx dy dz\nZONE {keys}\n1 2 3 4 5 6\n7 8 9 10 11 12\n"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("{keys}", "I=1", "line 2: the zone says 1 points, its numbers are 2"),
        ("{keys}", "I=2 J=2 K=3", "line 2: the zone says 2 x 2 x 3 points, its numbers are 2"),
        ("12", "", "line 2: expected 6 numbers a point, found 11 numbers"),
        ("1 2 3 4 5 6\n7 8 9 10 11 12", "", "line 2: expected 6 numbers a point, found 0 numbers"),
        ("1 2 3", "x" * 41 + " 2 3", "line 3: expected numbers, found '" + "x" * 40 + "'"),
        ("1 2 3", "1.2.3" + "4" * 40, "line 3: expected a number, found '1.2.3" + "4" * 35 + "'"),
        ("{keys}", "F=FEBLOCK", "line 2: a zone of points"),
        ("{keys}", "ZONETYPE=FEQUAD", "line 2: a zone of points"),
        ("= x y z dx", "= x x z dx", "VARIABLES: the variable of x may be one of several"),
        ("x y z", "a b c", "VARIABLES: no places"),
    ],
)
def test_damaged_zones_are_refused(tmp_path, old, new, words):
    path = tmp_path / "a.dat"
    path.write_text(ZONE.replace(old, new).format(keys="I=2"))
    assert complaint(read_frames, [path]).startswith(f"{path}: {words}")


def test_flags_of_a_zone_drop_its_rows(tmp_path):
    path = tmp_path / "a.dat"
    for flag, options, first in (
        ("valid", {}, 7.0), ("invalid", {}, 1.0),
        ("f", {"flag_column": "f"}, 1.0), ("f", {"valid_column": "f"}, 7.0),
    ):  # fmt: skip
        path.write_text(f"VARIABLES = x y z dx dy dz {flag}\nZONE\n1 2 3 4 5 6 0\n7 8 9 1 1 1 1\n")
        (frame,) = read_frames([path], FrameOptions(**options))
        assert frame.points[:, 0].tolist() == [first], (flag, options)
        assert frame.dropped == {"flagged as doubtful": 1}
    assert "variable of valid 'g' is missing" in complaint(
        read_frames, [path], FrameOptions(valid_column="g")
    )


TECPLOT = """\
TITLE = "a"
VARIABLES = x, y
"dx", "dy" "dz" "valid"
ZONE I=2, J=1, F=BLOCK
1 2 3 4
0.1 0.2 0.3
0.4 0.5 0.6
1 0
ZONE T="next" I=1 DATAPACKING=POINT
1 3 0.7 0.8 0.9 1
"""


def test_zones_are_frames_in_points_or_blocks(tmp_path):
    path = tmp_path / "a.dat"
    path.write_text(TECPLOT)
    first, second = read_fields([path], [0.1, 0.2])
    np.testing.assert_array_equal(first.points, [[1, 3]])
    np.testing.assert_array_equal(first.displacement, [[0.1, 0.3, 0.5]])
    np.testing.assert_array_equal(second.displacement, [[0.7, 0.8, 0.9]])
    # Only a first frame in which nothing moves is a reference.
    assert "for each of 1 pressures, found 2" in complaint(read_fields, [path], [0.1])
    for old, words in (('"dz"', "planar correlation, without dz"), ('"dy"', "no column of dy")):
        path.write_text(TECPLOT.replace(old, '"p"'))
        assert words in complaint(read_fields, [path], [0.1, 0.2])
