"""Frames of image correlation read from tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.readers.frames import Frame, FrameOptions, read_frames
from hypothesis import given, settings
from hypothesis import strategies as st

from ..complaints import complaint


@pytest.fixture(scope="module")
def scratch(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("frames") / "frame.csv"


def options(columns=None, **others) -> FrameOptions:
    return FrameOptions(columns=columns, **others)


def test_frames_are_read_with_holes(tmp_path):
    path = tmp_path / "B00001.csv"
    path.write_text("# m\nX,Y,Z,U,V,W,mask\n1,2,3,4,5,6,0\n1,2,3,,NaN,,0\n1,x,3,4,5,6,1\n")
    names = dict(zip(("x", "y", "z", "dx", "dy", "dz"), "XYZUVW", strict=True))
    (frame,) = read_frames([path], options(names, flag_column="mask", length_scale=10.0))
    np.testing.assert_array_equal(frame.points, [[10, 20, 30], [10, 20, 30]])
    np.testing.assert_array_equal(frame.displacement, [[40, 50, 60], [np.nan] * 3])
    assert frame.path == path
    message = complaint(read_frames, [path], options(names))
    assert "B00001.csv: line 5, column 'Y': expected a number, found 'x'" in message
    # The names are found without being told.
    (found,) = read_frames([path], options(flag_column="mask", length_scale=10.0))
    np.testing.assert_array_equal(found.points, frame.points)
    assert complaint(read_frames, []).startswith("files")
    assert complaint(options, {"w": "W"}).startswith("columns: unknown quantity 'w'")
    assert complaint(options, length_scale=0.0).startswith("length_scale")
    assert "length unit" in complaint(
        read_frames, [path], options(names, flag_column="mask", length_scale=1e308)
    )


@pytest.mark.parametrize(
    ("points", "displacement", "sigma", "shapes"),
    [
        ((2, 3), (3, 3), None, r"\(2, 3\) and \(3, 3\)"),
        ((2, 2), (2, 2), None, r"\(2, 2\) and \(2, 2\)"),
        ((2, 3), (2, 3), (3,), r"\(m,\) sigma, got \(3,\)"),
        ((2, 3), (2, 3), (2, 3), r"\(m,\) sigma, got \(2, 3\)"),
    ],
)
def test_arrays_that_make_no_frame(points, displacement, sigma, shapes):
    with pytest.raises(ValueError, match=shapes):
        Frame(np.zeros(points), np.zeros(displacement), sigma=sigma and np.zeros(sigma))
    assert len(Frame(np.zeros((2, 3)), np.zeros((2, 3)), sigma=np.zeros(2)).points) == 2


@settings(deadline=None, max_examples=200)
@given(start=st.integers(0, 60), length=st.integers(0, 30), garbage=st.binary(max_size=20))
def test_a_damaged_frame_is_a_frame_or_refused(scratch, start, length, garbage):
    content = b"x,y,z,dx,dy,dz\n1,2,3,4,5,6\n1,2,3,,nan,\n7,8,9,10,11,12\n"
    scratch.write_bytes(content[:start] + garbage + content[start + length :])
    try:
        (frame,) = read_frames([scratch])
    except InputError as error:
        assert str(scratch) in str(error) and "\n" not in str(error)
    else:
        assert not np.isinf(frame.points).any() and not np.isinf(frame.displacement).any()
