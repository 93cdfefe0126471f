"""Frames of a camera: rows, files, choice of frames, words of files."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from bubblefit.experiments.strips.gauge import virtual_strain_gauge
from bubblefit.readers.fields import QUANTITIES, read_fields
from bubblefit.readers.frame_choice import AT_REST_FRAME_CHOICE as AT_REST
from bubblefit.readers.frame_choice import BEYOND, RELEASED, REPEATED, choose_frames
from bubblefit.readers.frames import FrameOptions, FrameRows, frame_files, frame_of, read_frames
from bubblefit.readers.mat_files import read_variables
from bubblefit.readers.registry import format_of
from hypothesis import given
from hypothesis import strategies as st

from ..builders import camera_exports
from ..builders.camera_exports import EXPORTS
from ..support.refusals import complaint, complaint_with


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


PATH, PLAIN = Path("a.csv"), FrameOptions()
#: Of three rows; the last one is zero throughout.
VALUES = {
    "x": np.array([1.0, 2.0, 0.0]), "y": np.array([3.0, 4.0, 0.0]), "z": np.array([5.0, 6.0, 0.0]),
    "dx": np.array([0.1, 0.2, 0.0]), "dy": np.array([0.3, 0.4, 0.0]),
    "dz": np.array([0.5, 0.6, 0.0]),
}  # fmt: skip
NAMES = {name: name.upper() for name in VALUES}


def frame(values=VALUES, units=None, options=PLAIN, **rows):
    names = {name: name.upper() for name in values}
    return frame_of(FrameRows(values, names, units or {}, **rows), options, PATH, "f")


def test_lengths_become_mm_each_by_its_own_unit():
    units = {"x": "cm", "y": "M", "z": "in", "dx": "µm", "dy": "", "dz": "?"}
    found = frame(units=units, options=FrameOptions(length_scale=2.0))
    np.testing.assert_allclose(found.points, [[10, 3e3, 127], [20, 4e3, 152.4]])
    np.testing.assert_allclose(found.displacement, [[1e-4, 0.6, 1.0], [2e-4, 0.8, 1.2]])
    assert found.path == PATH and found.sigma is None
    source = found.source
    assert (source.format, source.columns, source.notes) == ("f", NAMES, ())
    assert source.units == {name: unit for name, unit in units.items() if unit}
    assert "column 'DY': is in pixels" in complaint(frame, units={"x": "mm", "dy": "Pixel"})


def test_rows_left_out_are_counted_once_by_the_first_reason():
    values = {name: np.append(value, [7.0, 0.0, 8.0]) for name, value in VALUES.items()}
    dropped = {"without a value": 3, "flagged as doubtful": 1, "never": 0}
    sigma = np.array([0.0, 0.1, -1.0, 0.2, -1.0, -1e-9])
    valid = np.array([True, True, True, False, False, True])
    found = frame(values, valid=valid, sigma=sigma, dropped=dropped)
    assert found.points[:, 0].tolist() == [1.0, 2.0]
    assert found.sigma is not None and found.sigma.tolist() == [0.0, 0.1]
    expected = {"without a value": 3, "flagged as doubtful": 3, "sigma below zero": 2}
    assert found.dropped == expected
    assert frame().dropped == {"all zero": 1}
    still = {name: value * (name[0] != "d") for name, value in VALUES.items()}
    assert len(frame(still).points) == 3 and frame(still).dropped == {}
    twice = {name: np.append(value, 0.0) for name, value in still.items()}
    assert frame(twice).dropped == {"all zero": 2}
    lost = {**still, "dx": np.array([np.nan, 0.0, 0.0])}
    assert len(frame(lost).points) == 3


def test_axes_of_a_camera_are_turned_over_unless_the_user_says_no():
    found = frame(camera_axes=True, notes=("read",))
    np.testing.assert_array_equal(found.points[0], [1, -3, -5])
    np.testing.assert_array_equal(found.displacement[0], [0.1, -0.3, -0.5])
    assert found.source.notes[0] == "read" and "turned over" in found.source.notes[1]
    as_written = frame(camera_axes=True, options=FrameOptions(camera_axes=False))
    np.testing.assert_array_equal(as_written.points[0], [1, 3, 5])
    asked = frame(options=FrameOptions(camera_axes=True))
    assert asked.source.notes == found.source.notes[1:]


def test_places_after_the_motion():
    after = {f"{name} deformed" if name in "xyz" else name: v for name, v in VALUES.items()}
    found = frame(after)
    np.testing.assert_allclose(found.points[1], [1.8, 3.6, 5.4])
    np.testing.assert_allclose(found.displacement[1], [0.2, 0.4, 0.6])
    assert "x, y, z are places in the deformed state" in found.source.notes[0]
    asked = frame(options=FrameOptions(coordinates="deformed"))
    np.testing.assert_array_equal(asked.points, found.points)
    both = {**{name: VALUES[name] for name in "xyz"}, "x deformed": np.array([1.5, 2.5, 0.0])}
    found = frame(both | {"dy": VALUES["dy"], "dz": VALUES["dz"]})
    np.testing.assert_allclose(found.displacement[:, 0], [0.5, 0.5])
    assert found.source.notes == ("displacements along x are deformed less reference places",)


def test_what_is_missing_is_said():
    flat = {name: value for name, value in VALUES.items() if "z" not in name}
    some = {name: VALUES[name] for name in ("x", "y", "dy")}
    with_z = {**flat, "z": VALUES["z"]}
    for values, options, words in (
        (flat, {}, "without z and dz;"), (with_z, {}, "without dz;"),
        (some, {}, "no column of z and dx and dz;"), (with_z, {"planar": True}, "dz"),
    ):  # fmt: skip
        assert words in complaint(frame, values, options=FrameOptions(**options))
    planar = frame(flat, options=FrameOptions(planar=True))
    np.testing.assert_array_equal(planar.points[:, 2], [0.0, 0.0])
    np.testing.assert_array_equal(planar.displacement[:, 2], [0.0, 0.0])
    assert planar.source.notes == ("planar correlation: z and dz are taken to be zero",)
    # What nobody asks for may be missing, and is not known.
    free = frame(flat, options=FrameOptions(("x", "y", "dx", "dy")))
    assert np.isnan(free.points[:, 2]).all() and np.isnan(free.displacement[:, 2]).all()


def test_the_order_of_frames(tmp_path):
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


#: MPa, as a camera saw a test: rest, rise, hold, release, end of the log.
SEEN = np.array([np.nan, 0.0, -0.001, 0.010, 0.020, 0.031, 0.031, 0.052, 0.040, 0.012, np.nan])


def test_frames_of_the_rise():
    chosen = choose_frames(SEEN, [0.012, 0.0305, 0.05], tolerance=0.003, inflation=1)
    assert chosen[0] == (3, 5, 7)
    assert chosen[1] == {BEYOND: 2, AT_REST: 2, RELEASED: 2}
    # Not in the order of time, the release cannot be told from the rise.
    assert choose_frames(SEEN, [0.012], tolerance=0.003)[0] == (9,)
    chosen = choose_frames(SEEN)
    assert chosen[0] == (3, 9, 4, 5, 8, 7)
    assert chosen[1] == {BEYOND: 2, AT_REST: 2, REPEATED: 1}
    assert choose_frames(SEEN, inflation=1)[0] == (3, 4, 5, 7)
    # 2 % of the largest asked for is 1.04 kPa.
    for asked, words in (
        ([0.0305, 0.0420, 0.052], ["pressures[1]", "within 1.04 kPa of 42 kPa", "at 40 kPa"]),
        ([0.0195, 0.0205, 0.052], ["pressures[1]", "frame at 20 kPa", "19.5 and to 20.5 kPa"]),
    ):
        complaint_with(words, choose_frames, SEEN, asked)
    assert "the 6 frames" in complaint(choose_frames, SEEN, None, 7)
    assert "none of the 3 frames is under pressure" in complaint(choose_frames, SEEN[:3])


@given(
    pressures=st.lists(st.floats(1e-3, 1.0), min_size=1, max_size=40, unique=True), data=st.data()
)
def test_as_many_as_asked_for_and_rising(pressures, data):
    each = np.array(pressures)
    count = data.draw(st.integers(1, len(choose_frames(each)[0])))
    taken = each[list(choose_frames(each, count=count)[0])]
    assert len(taken) == count and (np.diff(taken) > 0).all()
    assert taken[-1] == pytest.approx(each.max())


PRESSURES = [0.05, 0.1, 0.2]


@pytest.fixture(scope="module")
def frames():
    random = np.random.default_rng(7)
    r, angle = 100 * np.sqrt(random.uniform(0.001, 1, 60)), random.uniform(0, 2 * np.pi, 60)
    r[:10] = 100.0
    x, y = r * np.cos(angle), r * np.sin(angle)
    high = 1 - (r / 100) ** 2
    points = np.stack([x, y, 3 * high * np.cos(angle) + 0.5], axis=1)
    moved = [
        p * high[:, None] * np.stack([0.1 * x, -0.07 * y, 150 + 0.2 * x], axis=1) for p in PRESSURES
    ]
    return [(points, u) for u in moved]


#: Rejected points of an export, by reason.
DROPPED = {
    "plain": {}, "davis": {"all zero": 1}, "tecplot": {"flagged as doubtful": 1},
    "vic3d": {"sigma below zero": 2}, "vic3d-mat": {"sigma below zero": 1},
    "aramis": {"without a value": 1}, "matchid 2023": {"without a value": 1},
    "dice": {"flagged as doubtful": 2}, "istra4d": {"flagged as doubtful": 1},
    "pyaldic": {"without a value": 1},
}  # fmt: skip


@pytest.mark.parametrize("case", EXPORTS)
def test_a_bubble_reads_back(case, frames, tmp_path):
    name, write = EXPORTS[case]
    files = write(tmp_path, frames)
    assert {format_of("frame", file).name for file in files} == {name}
    for field, (points, moved) in zip(read_fields(files, PRESSURES), frames, strict=True):
        assert field.z is not None and field.source.format == name
        places = np.column_stack([field.points, field.z])
        np.testing.assert_allclose(places, points, rtol=0, atol=1e-9)
        np.testing.assert_allclose(field.displacement, moved, rtol=0, atol=1e-9)
        assert {"x", "dz"} <= {key.split()[0] for key in field.source.columns}
        assert field.dropped == DROPPED.get(case, field.dropped)


def test_what_a_reader_chose_is_said(frames, tmp_path):
    def first(write, **options):
        options = FrameOptions(QUANTITIES, **options)
        return read_fields(write(tmp_path, frames), PRESSURES, options=options)[0]

    deformed, turned = first(camera_exports.pyaldic_csv).source.notes
    assert "places in the deformed state" in deformed and "y points down" in turned
    assert "turned over" in first(camera_exports.matchid_2024).source.notes[0]
    # The user's word comes first.
    field = first(camera_exports.matchid_2024, camera_axes=False)
    np.testing.assert_allclose(field.displacement[:, 2], -frames[0][1][:, 2], atol=1e-12)
    field = first(camera_exports.plain, coordinates="deformed")
    np.testing.assert_allclose(field.points, (frames[0][0] - frames[0][1])[:, :2], atol=1e-12)
    # Units and sigma are kept.
    field = first(camera_exports.vic3d)
    assert set(field.source.units.values()) == {"mm"} and set(field.sigma) == {0.02}
    units = first(camera_exports.german).source.units
    assert (units["x"], units["dx"]) == ("m", "µm")
    files = camera_exports.pyaldic(tmp_path, frames)
    assert len(read_frames(files)) == 4
    assert [f.pressure for f in read_fields(files, PRESSURES)] == PRESSURES
    assert not read_fields(files, [0.0, *PRESSURES])[0].displacement.any()
    assert "for each of 2 pressures, found 4" in complaint(read_fields, files, [0.1, 0.2])


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


def test_tecplot_zones_are_frames_in_points_or_blocks(tmp_path):
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


def test_small_letters_of_vic3d_are_places_in_the_picture(tmp_path):
    path = tmp_path / "old.csv"
    heads = ", ".join(f'"{name}"' for name in ("x", "y", "u", "v", *"XYZUVW", "sigma"))
    path.write_text(f"{heads}\n500,400,3,4,1,2,3,0.1,0.2,0.3,0.01\n0,0,0,0,0,0,0,0,0,0,-1\n")
    (field,) = read_fields([path], [0.1])
    assert field.source.format == "vic3d" and field.dropped == {"sigma below zero": 1}
    np.testing.assert_array_equal(np.append(field.points, field.z), [1, 2, 3])
    np.testing.assert_array_equal(field.displacement, [[0.1, 0.2, 0.3]])
    # In a table of unknown origin nobody can tell.
    assert "dx may be 'u' or 'U'" in complaint(read_fields, [path], [0.1], format="csv")


@pytest.mark.parametrize("version", [5, 7.3])
def test_ncorr_is_planar(version, tmp_path):
    column, row = (grid.ravel() for grid in np.meshgrid(np.arange(1, 40), np.arange(1, 20)))
    points = 0.5 * np.stack([column, -row, 0 * row], axis=1)
    frames = [(points, points * (e, -0.3 * e, 0.0)) for e in (0.01, 0.02)]
    files = camera_exports.ncorr(tmp_path, frames)
    if version == 7.3:
        files = [as_version_73(files[0], tmp_path / "ncorr73.mat")]
    assert format_of("frame", files[0]).name == "ncorr"
    assert "planar correlation" in complaint(read_fields, files, [0.1, 0.2])
    read = read_frames(files, FrameOptions(planar=True))
    for frame, (points, moved) in zip(read, frames, strict=True):
        order = np.lexsort(frame.points.T[:2]), np.lexsort(points.T[:2])
        np.testing.assert_allclose(frame.points[order[0]], points[order[1]], atol=1e-9)
        np.testing.assert_allclose(frame.displacement[order[0]], moved[order[1]], atol=1e-9)
    gauge = virtual_strain_gauge(read, (2.0, -5.0), (18.0, -5.0))
    np.testing.assert_allclose(gauge.strain, [0.01, 0.02], rtol=1e-9)


def as_version_73(path, copy):
    """What MATLAB's -v7.3 makes of Ncorr's struct: fields as lists of references."""
    (saved,) = read_variables(path, ["data_dic_save"])["data_dic_save"]
    frames = saved["displacements"]
    with h5py.File(copy, "w", userblock_size=512) as file:

        def written(name, value):
            text = isinstance(value, str)
            data = np.array([[ord(c)] for c in value], dtype="u2") if text else np.transpose(value)
            item = file.create_dataset(name, data=data)
            item.attrs["MATLAB_class"] = b"char" if text else b"double"
            return item.ref

        for name in frames[0]:
            parts = [written(f"#refs#/{name}{k}", one[name]) for k, one in enumerate(frames)]
            references = np.array(parts, dtype=h5py.ref_dtype).reshape(-1, 1)
            file[f"data_dic_save/displacements/{name}"] = references
        for name, value in saved["dispinfo"][0].items():
            written(f"data_dic_save/dispinfo/{name}", value)
    with copy.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return copy


def places(path, ids, points):
    rows = [";".join(map(str, (i, *row))) for i, row in zip(ids, points.tolist(), strict=True)]
    path.write_text("\n".join(["Point ID;X deformed [mm];Y deformed [mm];Z deformed [mm]", *rows]))
    return path


def test_a_reference_of_its_own_beside_places(tmp_path):
    draw = np.random.default_rng(1)
    rest, moved = draw.uniform(-90, 90, (20, 3)), draw.normal(0, 2, (2, 20, 3))
    options = FrameOptions(QUANTITIES, reference=places(tmp_path / "ref.csv", range(20), rest))
    order = [draw.permutation(20)[:count] for count in (20, 13)]
    files = [
        places(tmp_path / f"s{k}.csv", own, (rest + u)[own])
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
