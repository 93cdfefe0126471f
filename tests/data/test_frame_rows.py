"""Rows of made-up files as points of a frame, number by number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.frames import FrameOptions, FrameRows, frame_of

from ..complaints import complaint

PATH = Path("a.csv")
#: Of three rows; the last one is zero throughout.
VALUES = {
    "x": np.array([1.0, 2.0, 0.0]), "y": np.array([3.0, 4.0, 0.0]), "z": np.array([5.0, 6.0, 0.0]),
    "dx": np.array([0.1, 0.2, 0.0]), "dy": np.array([0.3, 0.4, 0.0]),
    "dz": np.array([0.5, 0.6, 0.0]),
}  # fmt: skip
NAMES = {name: name.upper() for name in VALUES}


def frame(values=VALUES, units=None, options=None, **rows):
    names = {name: name.upper() for name in values}
    return frame_of(
        FrameRows(values, names, units or {}, **rows), options or FrameOptions(), PATH, "f"
    )


def test_lengths_become_mm_each_by_its_own_unit() -> None:
    units = {"x": "cm", "y": "M", "z": "in", "dx": "µm", "dy": "", "dz": "?"}
    found = frame(units=units, options=FrameOptions(length_scale=2.0))
    np.testing.assert_allclose(found.points, [[10, 3e3, 127], [20, 4e3, 152.4]])
    np.testing.assert_allclose(found.displacement, [[1e-4, 0.6, 1.0], [2e-4, 0.8, 1.2]])
    assert found.path == PATH and found.sigma is None
    source = found.source
    assert (source.format, source.columns, source.notes) == ("f", NAMES, ())
    assert source.units == {"x": "cm", "y": "M", "z": "in", "dx": "µm", "dz": "?"}
    said = complaint(frame, units={"x": "mm", "dy": "Pixel"})
    assert said == (
        "a.csv: column 'DY': is in pixels; export lengths, or name a column of dy in mm with "
        "columns"
    )


def test_rows_left_out_are_counted_once_by_the_first_reason() -> None:
    values = {name: np.append(value, [7.0, 0.0, 8.0]) for name, value in VALUES.items()}
    found = frame(
        values,
        valid=np.array([True, True, True, False, False, True]),
        sigma=np.array([0.0, 0.1, -1.0, 0.2, -1.0, -1e-9]),
        dropped={"without a value": 3, "flagged as doubtful": 1, "never": 0},
    )
    assert found.points[:, 0].tolist() == [1.0, 2.0]
    assert found.sigma is not None and found.sigma.tolist() == [0.0, 0.1]
    assert found.dropped == {
        "without a value": 3, "flagged as doubtful": 3, "sigma below zero": 2
    }  # fmt: skip
    assert frame().dropped == {"all zero": 1}


def test_one_row_of_zeros_is_a_point_where_nothing_moves() -> None:
    still = {name: value * (name[0] != "d") for name, value in VALUES.items()}
    assert len(frame(still).points) == 3 and frame(still).dropped == {}
    twice = {name: np.append(value, 0.0) for name, value in still.items()}
    assert frame(twice).dropped == {"all zero": 2}
    lost = {**still, "dx": np.array([np.nan, 0.0, 0.0])}
    assert len(frame(lost).points) == 3


def test_axes_of_a_camera_are_turned_over_unless_the_user_says_no() -> None:
    found = frame(camera_axes=True, notes=("read",))
    np.testing.assert_array_equal(found.points[0], [1, -3, -5])
    np.testing.assert_array_equal(found.displacement[0], [0.1, -0.3, -0.5])
    turned = "y and z are turned over: in the file y points down, z away from the camera"
    assert found.source.notes == ("read", turned)
    as_written = frame(camera_axes=True, options=FrameOptions(camera_axes=False))
    np.testing.assert_array_equal(as_written.points[0], [1, 3, 5])
    asked = frame(options=FrameOptions(camera_axes=True))
    assert asked.source.notes == (turned,)


def test_places_after_the_motion() -> None:
    after = {f"{name} deformed" if name in "xyz" else name: v for name, v in VALUES.items()}
    found = frame(after)
    np.testing.assert_allclose(found.points[1], [1.8, 3.6, 5.4])
    np.testing.assert_allclose(found.displacement[1], [0.2, 0.4, 0.6])
    assert found.source.notes == (
        "x, y, z are places in the deformed state; the displacement is taken off",
    )
    asked = frame(options=FrameOptions(coordinates="deformed"))
    np.testing.assert_array_equal(asked.points, found.points)
    both = {**{name: VALUES[name] for name in "xyz"}, "x deformed": np.array([1.5, 2.5, 0.0])}
    both |= {"dy": VALUES["dy"], "dz": VALUES["dz"]}
    found = frame(both)
    np.testing.assert_allclose(found.displacement[:, 0], [0.5, 0.5])
    assert found.source.notes == ("displacements along x are deformed less reference places",)


def test_what_is_missing_is_said() -> None:
    flat = {name: value for name, value in VALUES.items() if "z" not in name}
    assert complaint(frame, flat) == (
        "a.csv: planar correlation, without z and dz; a stereo one is needed"
    )
    assert complaint(frame, {**flat, "z": VALUES["z"]}) == (
        "a.csv: planar correlation, without dz; a stereo one is needed"
    )
    some = {name: VALUES[name] for name in ("x", "y", "dy")}
    assert complaint(frame, some) == (
        "a.csv: no column of z and dx and dz; name them with columns. Read: X, Y, DY"
    )
    planar = frame(flat, options=FrameOptions(planar=True))
    np.testing.assert_array_equal(planar.points[:, 2], [0.0, 0.0])
    np.testing.assert_array_equal(planar.displacement[:, 2], [0.0, 0.0])
    assert planar.source.notes == ("planar correlation: z and dz are taken to be zero",)
    assert "dz" in complaint(frame, {**flat, "z": VALUES["z"]}, options=FrameOptions(planar=True))
    # What nobody asks for may be missing, and is not known.
    free = frame(flat, options=FrameOptions(("x", "y", "dx", "dy")))
    assert np.isnan(free.points[:, 2]).all() and np.isnan(free.displacement[:, 2]).all()


@pytest.mark.parametrize(("scale", "good"), [(1e-300, True), (0.0, False), (np.inf, False)])
def test_scales_of_length(scale: float, good: bool) -> None:
    if good:
        assert FrameOptions(length_scale=scale).length_scale == scale
    else:
        said = complaint(FrameOptions, length_scale=scale)
        assert said == f"length_scale: expected mm per unit, above 0, got {scale}"
