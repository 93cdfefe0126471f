"""readers/frames.py: rows, files and order of frames."""

import numpy as np
import pytest
from bubblefit.readers.fields import QUANTITIES
from bubblefit.readers.frames import Frame, FrameOptions, frame_files, read_frames
from bubblefit.readers.histories import apex_height

from ..support.refusals import complaint, complaint_with
from .cases import FRAME_NAMES, FRAME_PATH, FRAME_VALUES, frame_of_values


def test_frames_are_read_with_holes(tmp_path):
    path = tmp_path / "B00001.csv"
    path.write_text("# m\nX,Y,Z,U,V,W,mask\n1,2,3,4,5,6,0\n1,2,3,,NaN,,0\n1,x,3,4,5,6,1\n")
    names = dict(zip(("x", "y", "z", "dx", "dy", "dz"), "XYZUVW", strict=True))
    for columns in (names, None):  # the names are found without being told
        options = FrameOptions(columns=columns, flag_column="mask", length_scale=10.0)
        (frame,) = read_frames([path], options)
        np.testing.assert_array_equal(frame.points, [[10, 20, 30], [10, 20, 30]])
        np.testing.assert_array_equal(frame.displacement, [[40, 50, 60], [np.nan] * 3])
        assert frame.path == path
    message = complaint(read_frames, [path], FrameOptions(columns=names))
    assert "B00001.csv: line 5, column 'Y': expected a number, found 'x'" in message
    assert complaint(read_frames, []).startswith("files")
    assert complaint(FrameOptions, columns={"w": "W"}).startswith("columns: expected one of x, y")
    for scale in (0.0, np.inf):
        assert complaint(FrameOptions, length_scale=scale).startswith("length_scale: ")
    assert FrameOptions(length_scale=1e-300).length_scale == 1e-300


def test_lengths_become_mm_by_the_unit_of_their_column():
    units = {"x": "cm", "y": "M", "z": "in", "dx": "µm", "dy": "", "dz": "?"}
    found = frame_of_values(units=units, options=FrameOptions(length_scale=2.0))
    np.testing.assert_allclose(found.points, [[10, 3e3, 127], [20, 4e3, 152.4]])
    np.testing.assert_allclose(found.displacement, [[1e-4, 0.6, 1.0], [2e-4, 0.8, 1.2]])
    assert found.path == FRAME_PATH and found.sigma is None
    source = found.source
    assert (source.format, source.columns, source.notes) == ("f", FRAME_NAMES, ())
    assert source.units == {name: unit for name, unit in units.items() if unit}
    assert "column 'DY': is in pixels" in complaint(
        frame_of_values, units={"x": "mm", "dy": "Pixel"}
    )


@pytest.mark.parametrize("unit", ["dm", "nm", "yd", "%", "kPa", "voxel", "mm/mm"])
def test_columns_that_are_named_and_in_no_known_length_are_refused(tmp_path, unit):
    path = tmp_path / "t_1.csv"
    path.write_text(f"x [mm],y [mm],z [mm],dx [{unit}],dy [mm],dz [mm]\n1,2,3,4,5,6\n")
    columns = FrameOptions(columns={"dx": f"dx [{unit}]"})
    words = f"column 'dx [{unit}]': expected a unit of mm, cm, m, µm, in, mil and ft, got '{unit}'"
    assert words in complaint(read_frames, [path], columns)


@pytest.mark.parametrize("word", ["ref", "Deformed", "x", "1"])
def test_words_in_brackets_that_are_no_unit_leave_the_unit_open(tmp_path, word):
    path = tmp_path / "t_1.csv"
    path.write_text(f"X ({word}),y,z,dx,dy,dz\n1,2,3,4,5,6\n")
    options = FrameOptions(columns={"x": f"X ({word})"}, length_scale=10.0)
    (frame,) = read_frames([path], options)
    np.testing.assert_array_equal(frame.points, [[10, 20, 30]])


@pytest.mark.parametrize("is_named", [False, True])
def test_long_words_of_units_in_brackets_are_read(tmp_path, is_named):
    path = tmp_path / "t_1.csv"
    names = {name: f"{name} [micrometers]" for name in FRAME_NAMES}
    path.write_text(",".join(names.values()) + "\n1,2,3,4,5,6\n")
    (frame,) = read_frames([path], FrameOptions(columns=names if is_named else None))
    np.testing.assert_allclose(frame.points, [[1e-3, 2e-3, 3e-3]])
    np.testing.assert_allclose(frame.displacement, [[4e-3, 5e-3, 6e-3]])


def test_dropped_rows_are_counted_by_their_first_reason():
    values = {name: np.append(value, [7.0, 0.0, 8.0]) for name, value in FRAME_VALUES.items()}
    dropped = {"without a value": 3, "flagged as doubtful": 1, "never": 0}
    sigma = np.array([0.0, 0.1, -1.0, 0.2, -1.0, -1e-9])
    valid = np.array([True, True, True, False, False, True])
    found = frame_of_values(values, valid=valid, sigma=sigma, dropped=dropped)
    assert found.points[:, 0].tolist() == [1.0, 2.0]
    assert found.sigma is not None and found.sigma.tolist() == [0.0, 0.1]
    expected = {"without a value": 3, "flagged as doubtful": 3, "sigma below zero": 2}
    assert found.dropped == expected
    assert frame_of_values().dropped == {"all zero": 1}
    still = {name: value * (name[0] != "d") for name, value in FRAME_VALUES.items()}
    assert len(frame_of_values(still).points) == 3 and frame_of_values(still).dropped == {}
    twice = {name: np.append(value, 0.0) for name, value in still.items()}
    assert frame_of_values(twice).dropped == {"all zero": 2}
    lost = {**still, "dx": np.array([np.nan, 0.0, 0.0])}
    assert len(frame_of_values(lost).points) == 3


def test_camera_axes_are_turned_over_unless_refused():
    found = frame_of_values(camera_axes=True, notes=("read",))
    np.testing.assert_array_equal(found.points[0], [1, -3, -5])
    np.testing.assert_array_equal(found.displacement[0], [0.1, -0.3, -0.5])
    assert found.source.notes[0] == "read" and "turned over" in found.source.notes[1]
    as_written = frame_of_values(camera_axes=True, options=FrameOptions(camera_axes=False))
    np.testing.assert_array_equal(as_written.points[0], [1, 3, 5])
    asked = frame_of_values(options=FrameOptions(camera_axes=True))
    assert asked.source.notes == found.source.notes[1:]


def test_deformed_places_are_moved_back():
    after = {f"{name} deformed" if name in "xyz" else name: v for name, v in FRAME_VALUES.items()}
    found = frame_of_values(after)
    np.testing.assert_allclose(found.points[1], [1.8, 3.6, 5.4])
    np.testing.assert_allclose(found.displacement[1], [0.2, 0.4, 0.6])
    assert "x, y, z are places in the deformed state" in found.source.notes[0]
    asked = frame_of_values(options=FrameOptions(coordinates="deformed"))
    np.testing.assert_array_equal(asked.points, found.points)
    both = {**{name: FRAME_VALUES[name] for name in "xyz"}, "x deformed": np.array([1.5, 2.5, 0.0])}
    found = frame_of_values(both | {"dy": FRAME_VALUES["dy"], "dz": FRAME_VALUES["dz"]})
    np.testing.assert_allclose(found.displacement[:, 0], [0.5, 0.5])
    assert found.source.notes == ("displacements along x are deformed less reference places",)


def test_missing_columns_are_named():
    flat = {name: value for name, value in FRAME_VALUES.items() if "z" not in name}
    some = {name: FRAME_VALUES[name] for name in ("x", "y", "dy")}
    with_z = {**flat, "z": FRAME_VALUES["z"]}
    for values, options, words in (
        (flat, {}, "without z and dz;"), (with_z, {}, "without dz;"),
        (some, {}, "no column of z and dx and dz;"), (with_z, {"planar": True}, "dz"),
    ):  # fmt: skip
        assert words in complaint(frame_of_values, values, options=FrameOptions(**options))
    planar = frame_of_values(flat, options=FrameOptions(planar=True))
    np.testing.assert_array_equal(planar.points[:, 2], [0.0, 0.0])
    np.testing.assert_array_equal(planar.displacement[:, 2], [0.0, 0.0])
    assert planar.source.notes == ("planar correlation: z and dz are taken to be zero",)
    # What nobody asks for may be missing, and is not known.
    free = frame_of_values(flat, options=FrameOptions(("x", "y", "dx", "dy")))
    assert np.isnan(free.points[:, 2]).all() and np.isnan(free.displacement[:, 2]).all()


def test_files_of_frames_are_ordered_by_number(tmp_path):
    for name in ("f10.csv", "f2.csv", "f1.csv", "g.csv", "a[1].csv"):
        (tmp_path / name).write_text("")
    (tmp_path / "f3.csv").mkdir()
    for asked, expected in (
        (["f*.csv"], ["f1.csv", "f2.csv", "f10.csv"]),
        (["f2.csv", "f1.csv", "f10.csv"], ["f2.csv", "f1.csv", "f10.csv"]),
        (["g.csv", "f?.csv"], ["g.csv", "f1.csv", "f2.csv"]),
        # Of quoted patterns the order is meant, whatever a shell would have made of it.
        (["f1*.csv", "f2.csv"], ["f1.csv", "f10.csv", "f2.csv"]),
        # A name with a bracket in it is a file before it is a pattern.
        (["a[1].csv"], ["a[1].csv"]),
    ):
        files, note = frame_files([str(tmp_path / name) for name in asked])
        assert ([file.name for file in files], note) == (expected, None)
    # As a shell sorts an unquoted pattern.
    files, note = frame_files([str(tmp_path / name) for name in ("f1.csv", "f10.csv", "f2.csv")])
    assert [file.name for file in files] == ["f1.csv", "f10.csv", "f2.csv"]
    assert note is not None and "f10.csv before f2.csv" in note
    folder = tmp_path / "run[1]"
    folder.mkdir()
    for name in ("f10.csv", "f2.csv"):
        (folder / name).write_text("")
    assert frame_files(["f*.csv"], folder=folder) == ([folder / "f2.csv", folder / "f10.csv"], None)
    _, note = frame_files(["f10.csv", "f2.csv"], folder=folder)
    assert "f10.csv before f2.csv" in note
    for asked, words in (
        (["g*"], f"no file matches '{folder}/g*'"), ([""], "files: is a folder"),
        (["f2.csv", "f*.csv"], f"{folder}/f2.csv: files: is given twice"),
    ):  # fmt: skip
        assert words in complaint(frame_files, asked, "files", folder)


def places_of(path, ids, points):
    rows = [";".join(map(str, (i, *row))) for i, row in zip(ids, points.tolist(), strict=True)]
    path.write_text("\n".join(["Point ID;X deformed [mm];Y deformed [mm];Z deformed [mm]", *rows]))
    return path


def test_reference_displacements_beside_places(tmp_path):
    draw = np.random.default_rng(1)
    rest, moved = draw.uniform(-90, 90, (20, 3)), draw.normal(0, 2, (2, 20, 3))
    options = FrameOptions(QUANTITIES, reference=places_of(tmp_path / "ref.csv", range(20), rest))
    order = [draw.permutation(20)[:count] for count in (20, 13)]
    files = [
        places_of(tmp_path / f"s{k}.csv", own, (rest + u)[own])
        for k, (own, u) in enumerate(zip(order, moved, strict=True))
    ]
    for frame, own, u in zip(read_frames(files, options), order, moved, strict=True):
        at = np.sort(own)
        np.testing.assert_allclose(frame.points, rest[at])
        np.testing.assert_allclose(frame.displacement, u[at], atol=1e-9)
    bare = files[1].read_text().replace("Point ID", "value")
    files[1].write_text(bare)
    complaint_with(["s1.csv", "13 points, the reference 20"], read_frames, files, options)
    both = tmp_path / "both.csv"
    both.write_text("x,y,z,dx,dy,dz\n1,2,3,4,5,6\n7,8,9,1,2,3\n")
    complaint_with(["both.csv", "holds displacements"], read_frames, [both], options)


def test_apex_height_is_a_high_quantile_of_the_points():
    up = np.outer(50 * (1 - np.linspace(0, 1, 2001)), [0.6, 0.0, -0.8])
    up[7] = 900.0
    up[3] = np.nan
    frame = Frame(np.zeros_like(up), up)
    # 98 % of points evenly along a cone moved less than 98 % of its height.
    assert apex_height(frame) == pytest.approx(49.0, abs=0.1)
    assert np.isnan(apex_height(Frame(np.zeros((2, 3)), np.full((2, 3), np.nan))))


@pytest.mark.parametrize("before", ["", "./"])
def test_frames_in_the_order_of_a_shell_are_noted_wherever_their_names_begin(
    tmp_path, monkeypatch, before
):
    monkeypatch.chdir(tmp_path)
    for number in (1, 2, 10):
        (tmp_path / f"t_{number}.csv").write_text("x\n")
    _, note = frame_files([f"{before}t_{number}.csv" for number in (1, 10, 2)], "files")
    assert note is not None and "t_10.csv before t_2.csv" in note


def test_points_are_paired_by_rows_where_some_are_flagged(tmp_path):
    rest = np.random.default_rng(1).uniform(-90, 90, (25, 3))

    def places(name, points, lost):
        lines = ["x,y,z,valid"]
        lines += [
            ",".join(map(str, (*row, int(k != lost)))) for k, row in enumerate(points.tolist())
        ]
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n")
        return path

    options = FrameOptions(QUANTITIES, reference=places("ref.csv", rest, 3), valid_column="valid")
    (frame,) = read_frames([places("s.csv", rest + np.array([0.0, 0.0, 2.0]), 17)], options)
    assert len(frame.points) == 23
    np.testing.assert_allclose(frame.displacement, np.tile([0.0, 0.0, 2.0], (23, 1)), atol=1e-9)
