"""Exports of image correlation: each format read, each at its limits."""

import numpy as np
import pytest
from bubblefit.experiments.strips.gauge import virtual_strain_gauge
from bubblefit.readers.fields import QUANTITIES, read_fields
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.registry import format_of

from .. import dic_exports
from ..complaints import complaint
from ..dic_exports import EXPORTS

PRESSURES = [0.05, 0.1, 0.2]


@pytest.fixture(scope="module")
def frames():
    """A bubble that is not symmetric, above a sheet that is not flat, with a rim that holds."""
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


@pytest.mark.parametrize("case", EXPORTS)
def test_a_bubble_reads_back(case, frames, tmp_path):
    name, write = EXPORTS[case]
    files = write(tmp_path, frames)
    assert {format_of("frame", file).name for file in files} == {name}
    fields = read_fields(files, PRESSURES)
    for field, (points, moved) in zip(fields, frames, strict=True):
        assert field.z is not None and field.source.format == name
        places = np.column_stack([field.points, field.z])
        np.testing.assert_allclose(places, points, rtol=0, atol=1e-9)
        np.testing.assert_allclose(field.displacement, moved, rtol=0, atol=1e-9)
        assert {"x", "dz"} <= {key.split()[0] for key in field.source.columns}


@pytest.mark.parametrize(
    ("case", "dropped"),
    [
        ("plain", {}), ("davis", {"all zero": 1}), ("tecplot", {"flagged as doubtful": 1}),
        ("vic3d", {"sigma below zero": 2}), ("vic3d-mat", {"sigma below zero": 1}),
        ("aramis", {"without a value": 1}), ("matchid 2023", {"without a value": 1}),
        ("dice", {"flagged as doubtful": 2}), ("istra4d", {"flagged as doubtful": 1}),
        ("pyaldic", {"without a value": 1}),
    ],
)  # fmt: skip
def test_rejected_points_are_dropped_and_counted(case, dropped, frames, tmp_path):
    (field, *_) = read_fields(EXPORTS[case][1](tmp_path, frames), PRESSURES)
    assert field.dropped == dropped
    assert len(field.points) == len(frames[0][0])


def test_units_and_sigma_are_kept(frames, tmp_path):
    (field, *_) = read_fields(dic_exports.vic3d(tmp_path, frames), PRESSURES)
    assert set(field.source.units.values()) == {"mm"} and set(field.sigma) == {0.02}
    (field, *_) = read_fields(dic_exports.german(tmp_path, frames), PRESSURES)
    assert (field.source.units["x"], field.source.units["dx"]) == ("m", "µm")


def test_what_a_reader_chose_is_said(frames, tmp_path):
    (field, *_) = read_fields(dic_exports.pyaldic_csv(tmp_path, frames), PRESSURES)
    deformed, turned = field.source.notes
    assert deformed.startswith("x, y, z are places in the deformed state")
    assert "y points down, z away from the camera" in turned
    (field, *_) = read_fields(dic_exports.matchid_2024(tmp_path, frames), PRESSURES)
    assert "turned over" in field.source.notes[0]
    # The user's word comes first.
    as_written = FrameOptions(QUANTITIES, camera_axes=False)
    files = dic_exports.matchid_2024(tmp_path, frames)
    (field, *_) = read_fields(files, PRESSURES, options=as_written)
    np.testing.assert_allclose(field.displacement[:, 2], -frames[0][1][:, 2], atol=1e-12)
    deformed = FrameOptions(QUANTITIES, coordinates="deformed")
    (field, *_) = read_fields(dic_exports.plain(tmp_path, frames), PRESSURES, options=deformed)
    np.testing.assert_allclose(field.points, (frames[0][0] - frames[0][1])[:, :2], atol=1e-12)


def test_one_file_with_all_frames_may_begin_with_the_reference(frames, tmp_path):
    files = dic_exports.pyaldic(tmp_path, frames)
    assert len(read_frames(files)) == 4
    assert [f.pressure for f in read_fields(files, PRESSURES)] == PRESSURES
    assert read_fields(files, [0.0, *PRESSURES])[0].displacement.any() == False  # noqa: E712
    message = complaint(read_fields, files, [0.1, 0.2])
    assert "expected one frame for each of 2 pressures, found 4" in message


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
    for old, new, words in (
        ("0.4 0.5 0.6", "0.4 0.5", "line 4: expected 6 numbers a point, found 11 numbers"),
        ('"dz"', '"p"', "planar correlation, without dz; a stereo one is needed"),
        ('"dy"', '"p"', "no column of dy; name them with columns"),
    ):
        path.write_text(TECPLOT.replace(old, new))
        assert words in complaint(read_fields, [path], [0.1, 0.2])


def test_a_short_row_is_not_filled_up_where_blanks_separate(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("x y dx dy dz\n1 2 3 4 5\n1 2 3 4\n")
    message = complaint(read_fields, [path], [0.1])
    assert "line 3: expected 5 cells as in the header, found 4" in message


def test_small_letters_of_vic3d_are_places_in_the_picture(tmp_path):
    path = tmp_path / "old.csv"
    heads = ", ".join(f'"{name}"' for name in ("x", "y", "u", "v", *"XYZUVW", "sigma"))
    path.write_text(f"{heads}\n500,400,3,4,1,2,3,0.1,0.2,0.3,0.01\n0,0,0,0,0,0,0,0,0,0,-1\n")
    (field,) = read_fields([path], [0.1])
    assert field.source.format == "vic3d" and field.dropped == {"sigma below zero": 1}
    np.testing.assert_array_equal(np.append(field.points, field.z), [1, 2, 3])
    np.testing.assert_array_equal(field.displacement, [[0.1, 0.2, 0.3]])
    # In a table of unknown origin nobody can tell.
    message = complaint(read_fields, [path], [0.1], format="csv")
    assert "the column of dx may be 'u' or 'U'; name one with columns" in message


def test_both_states_without_displacements(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(
        "x undeformed [mm];y undeformed [mm];z undeformed [mm];"
        "x deformed [mm];y deformed [mm];z deformed [mm]\n1;2;3;1.5;2.25;13\n"
    )
    (field,) = read_fields([path], [0.1])
    np.testing.assert_array_equal(field.points, [[1, 2]])
    np.testing.assert_array_equal(field.displacement, [[0.5, 0.25, 10]])
    assert "displacements along x, y, z are deformed less reference places" in field.source.notes


def test_dice_without_a_stereo_model_is_refused(tmp_path):
    path = tmp_path / "DICe_solution_0.txt"
    path.write_text(
        "SUBSET_ID,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA\n0,9,9,1,1,0.1\n"
    )
    message = complaint(read_fields, [path], [0.1])
    assert "has no MODEL_COORDINATES_X: planar and in pixels; run DICe with a stereo" in message
    # Names in a comment above the numbers.
    np.savetxt(path, [[1, 2, 3, 4, 5]], delimiter=",", header="made by us\nx,y,dx,dy,dz")
    (field,) = read_fields([path], [0.1])
    np.testing.assert_array_equal(field.displacement, [[3, 4, 5]])


@pytest.mark.parametrize("version", [5, 7.3])
def test_ncorr_is_planar(version, tmp_path):
    column, row = (grid.ravel() for grid in np.meshgrid(np.arange(1, 40), np.arange(1, 20)))
    points = 0.5 * np.stack([column, -row, 0 * row], axis=1)
    frames = [(points, points * (e, -0.3 * e, 0.0)) for e in (0.01, 0.02)]
    files = dic_exports.ncorr(tmp_path, frames)
    if version == 7.3:
        files = [as_version_73(files[0], tmp_path / "ncorr73.mat")]
    assert format_of("frame", files[0]).name == "ncorr"
    assert "planar correlation" in complaint(read_fields, files, [0.1, 0.2])
    read = read_frames(files, FrameOptions(planar=True))
    for frame, (points, moved) in zip(read, frames, strict=True):
        order = np.lexsort(frame.points.T[:2]), np.lexsort(points.T[:2])
        np.testing.assert_allclose(frame.points[order[0]], points[order[1]], atol=1e-9)
        np.testing.assert_allclose(frame.displacement[order[0]], moved[order[1]], atol=1e-9)
        assert "planar correlation: z and dz are taken to be zero" in frame.source.notes
    gauge = virtual_strain_gauge(read, (2.0, -5.0), (18.0, -5.0))
    np.testing.assert_allclose(gauge.strain, [0.01, 0.02], rtol=1e-9)


def as_version_73(path, copy):
    """What MATLAB's -v7.3 makes of Ncorr's struct: fields as lists of references."""
    import h5py
    from bubblefit.readers.mat_files import read_variables

    (saved,) = read_variables(path, ["data_dic_save"])["data_dic_save"]
    with h5py.File(copy, "w", userblock_size=512) as file:
        group = file.create_group("data_dic_save/displacements")
        for name in saved["displacements"][0]:
            parts = []
            for k, one in enumerate(saved["displacements"]):
                part = file.create_dataset(f"#refs#/{name}{k}", data=np.asarray(one[name]).T)
                part.attrs["MATLAB_class"] = b"double"
                parts.append(part.ref)
            references = np.array(parts, dtype=h5py.ref_dtype).reshape(-1, 1)
            group.create_dataset(name, data=references, dtype=h5py.ref_dtype)
        for name, value in saved["dispinfo"][0].items():
            text = isinstance(value, str)
            data = np.array([[ord(c)] for c in value], dtype="u2") if text else value
            item = file.create_dataset(f"data_dic_save/dispinfo/{name}", data=data)
            item.attrs["MATLAB_class"] = b"char" if text else b"double"
    with copy.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return copy
