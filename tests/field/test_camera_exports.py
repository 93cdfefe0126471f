"""Field: a bubble as programs of image correlation export it.

The layouts are those that the readers in `readers/formats` name their sources of.
"""

import h5py
import numpy as np
import pytest
from bubblefit.experiments.strips.gauge import virtual_strain_gauge
from bubblefit.readers.fields import QUANTITIES, read_fields
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.mat_files import read_variables
from bubblefit.readers.registry import format_of

from ..builders import camera_exports
from ..builders.camera_exports import EXPORTS
from ..support.refusals import complaint

PRESSURES = [0.05, 0.1, 0.2]


@pytest.fixture(scope="module")
def camera_frames():
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
def test_exported_bubble_reads_back(case, camera_frames, tmp_path):
    name, write = EXPORTS[case]
    files = write(tmp_path, camera_frames)
    assert {format_of("frame", file).name for file in files} == {name}
    for field, (points, moved) in zip(read_fields(files, PRESSURES), camera_frames, strict=True):
        assert field.z is not None and field.source.format == name
        places = np.column_stack([field.points, field.z])
        np.testing.assert_allclose(places, points, rtol=0, atol=1e-9)
        np.testing.assert_allclose(field.displacement, moved, rtol=0, atol=1e-9)
        assert {"x", "dz"} <= {key.split()[0] for key in field.source.columns}
        assert field.dropped == DROPPED.get(case, field.dropped)


def test_choices_of_a_reader_are_noted(camera_frames, tmp_path):
    def first(write, **options):
        options = FrameOptions(QUANTITIES, **options)
        return read_fields(write(tmp_path, camera_frames), PRESSURES, options=options)[0]

    deformed, turned = first(camera_exports.pyaldic_csv).source.notes
    assert "places in the deformed state" in deformed and "y points down" in turned
    assert "turned over" in first(camera_exports.matchid_2024).source.notes[0]
    # The user's word comes first.
    field = first(camera_exports.matchid_2024, camera_axes=False)
    np.testing.assert_allclose(field.displacement[:, 2], -camera_frames[0][1][:, 2], atol=1e-12)
    field = first(camera_exports.plain, coordinates="deformed")
    np.testing.assert_allclose(
        field.points, (camera_frames[0][0] - camera_frames[0][1])[:, :2], atol=1e-12
    )
    # Units and sigma are kept.
    field = first(camera_exports.vic3d)
    assert set(field.source.units.values()) == {"mm"} and set(field.sigma) == {0.02}
    units = first(camera_exports.german).source.units
    assert (units["x"], units["dx"]) == ("m", "µm")
    files = camera_exports.pyaldic(tmp_path, camera_frames)
    assert len(read_frames(files)) == 4
    assert [f.pressure for f in read_fields(files, PRESSURES)] == PRESSURES
    assert not read_fields(files, [0.0, *PRESSURES])[0].displacement.any()
    assert "for each of 2 pressures, found 4" in complaint(read_fields, files, [0.1, 0.2])


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
    """Write what MATLAB's -v7.3 makes of Ncorr's struct: fields as lists of references."""
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
