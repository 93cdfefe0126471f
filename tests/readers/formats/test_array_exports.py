"""readers/formats/array_exports.py: arrays of programs, and damaged archives."""

import pickle
import struct
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from bubblefit.readers import mat_files
from bubblefit.readers.formats import array_exports as npz_files
from bubblefit.readers.formats.array_exports import (
    array_names,
    read_arrays,
    recognises_vic3d,
)
from bubblefit.readers.frames import FrameOptions, read_frames
from scipy.io import savemat

from ...support.refusals import complaint


class Planted:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def test_pickle_is_never_read(tmp_path):
    path, trace = tmp_path / "run.npz", tmp_path / "trace"
    objects = np.array([Planted(trace)], dtype=object)
    np.savez(path, points3D=objects, U=objects)
    assert "Python objects" in complaint(read_frames, [path])
    path.write_bytes(pickle.dumps(Planted(trace)))
    for name in ("pyaldic", "csv", "vic3d-mat"):
        complaint(read_frames, [path], format=name)
    assert not trace.exists()


@pytest.mark.parametrize(
    ("names", "is_recognised"),
    [("XYUVW", True), ("XYZUVW", True), ("XYUV", False), ([*"XYUVW", "points3D"], False)],
)
def test_heights_are_no_sign_of_a_mat_file_of_vic3d(tmp_path, names, is_recognised):
    path = tmp_path / "a.mat"
    savemat(path, {name: np.ones((2, 2)) for name in names})
    assert recognises_vic3d(path, path.read_bytes()[:520]) is is_recognised


ARRAY_PLACES = np.arange(12.0).reshape(4, 3)
ARRAY_DISPLACEMENT = 0.01 * ARRAY_PLACES + 0.5


def test_arrays_of_an_archive_and_their_damage(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, a=ARRAY_PLACES, b=np.asfortranarray(ARRAY_PLACES), c=np.array("text"))
    found = read_arrays(path, ["a", "b", "c", "d"])
    assert sorted(found) == ["a", "b", "c"] and str(found["c"]) == "text"
    np.testing.assert_array_equal(found["a"], ARRAY_PLACES)
    np.testing.assert_array_equal(found["b"], ARRAY_PLACES)
    assert array_names(path) == ["a", "b", "c"] and array_names(tmp_path / "no.npz") == []
    assert "no such file" in complaint(read_arrays, tmp_path / "no.npz", ["a"])
    path = tmp_path / "a.npz"
    whole = npz_archive(path, "(2, 3)", np.arange(6.0).tobytes())
    assert read_arrays(whole, ["a"])["a"].tolist() == [[0, 1, 2], [3, 4, 5]]
    # 54 numbers are as long as file and header together: said to be too short, not too many.
    short, most = npz_archive(path, "(17,)", b"\0" * 8), "more than the file holds"
    assert "array 'a': ends early" in complaint(read_arrays, short, ["a"])
    for shape in ("(1000, 3)", "(-1, 3)", "(3, 99999999999, 3)"):
        said = complaint(read_arrays, npz_archive(path, shape, b"\0" * 8), ["a"])
        assert f"array 'a': says {shape} numbers, {most}" in said
    for kind in ("|O", "<c16", "<M8[s]"):
        said = complaint(read_arrays, npz_archive(path, "(1,)", b"\0" * 16, kind), ["a"])
        assert f"{path}: array 'a': holds Python objects" in said
    # 128 MiB of zeros in an eighth of a MiB.
    bomb = npz_archive(path, "(1, 5592405, 3)", bytes(2**27), packed=True)
    assert most in complaint(read_arrays, bomb, ["a"])


def npz_archive(path: Path, shape, body: bytes, kind: str = "<f8", packed: bool = False) -> Path:
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    header = header.ljust(117) + b"\n"
    how = zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED
    with zipfile.ZipFile(path, "w", how) as out:
        length = struct.pack("<H", len(header))
        out.writestr("a.npy", b"\x93NUMPY\x01\x00" + length + header + body)
    return path


def test_packed_arrays_keep_their_limits(tmp_path, monkeypatch):
    """Up to 64 MiB always, beyond by what is packed, never more than 1 GiB."""
    assert (npz_files.LARGEST, npz_files.SMALL, npz_files.RATIO) == (2**30, 2**26, 100)
    assert (mat_files.LARGEST, mat_files.SMALL, mat_files.RATIO) == (2**30, 2**26, 100)
    zeros = npz_archive(tmp_path / "a.npz", "(4096,)", b"\0" * 32768, packed=True)
    with zipfile.ZipFile(zeros) as packed:
        share = 32768 / packed.getinfo("a.npy").compress_size
    for small, ratio, largest, good in (
        (32767, 1.001, 2**30, True), (32767, 0.999, 2**30, False),
        (32768, 0.999, 2**30, True), (32768, 0.999, 32767, False),
    ):  # fmt: skip
        limits = {"SMALL": small, "RATIO": share * ratio, "LARGEST": largest}
        for name, limit in limits.items():
            monkeypatch.setattr(npz_files, name, limit)
        if good:
            assert len(read_arrays(zeros, ["a"])["a"]) == 4096
        else:
            assert "more than the file holds" in complaint(read_arrays, zeros, ["a"])


def test_pyaldic_displacements_and_places(tmp_path):
    path = tmp_path / "a.npz"
    own = np.array([0 * ARRAY_PLACES[:, 0], [7.0, 8.0, 9.0, 10.0]])
    np.savez(path, points3D=np.array([ARRAY_PLACES, ARRAY_PLACES + ARRAY_DISPLACEMENT]), V=own)
    _, frame = read_frames([path])  # displacements are those of the file where it has them
    np.testing.assert_allclose(
        frame.displacement[:, [0, 2]], ARRAY_DISPLACEMENT[:, [0, 2]] * [1, -1]
    )
    np.testing.assert_allclose(frame.displacement[:, 1], -own[1])
    np.testing.assert_allclose(frame.points[:, 0], ARRAY_PLACES[:, 0])
    assert set(frame.source.units.values()) == {"mm"}
    assert frame.source.columns["dy"] == "V" and frame.source.columns["x deformed"] == "points3D"
    places, numbers = "points3D: expected places (frames, points, 3)", "points3D: expected numbers"
    for points, words in (
        (ARRAY_PLACES, places), (np.zeros((1, 3, 2)), places), (np.zeros((1, 3, 4)), places),
        (np.zeros((1, 0, 3)), numbers), (np.full((1, 1, 3), "a"), numbers),
        (np.zeros((1, 5, 3)), "V: is (2, 4), points3D"),
    ):  # fmt: skip
        np.savez(path, points3D=points, V=own)
        assert words in complaint(read_frames, [path])


def test_multidic_of_other_shapes_is_refused(tmp_path):
    for places, moved in (((4, 3), (5, 3)), ((4, 2),) * 2, ((4, 4),) * 2, ((4, 3), (4, 2))):
        cells = {name: np.empty((1, 1), dtype=object) for name in ("p", "u")}
        cells["p"][0, 0], cells["u"][0, 0] = np.zeros(places), np.zeros(moved)
        results = {"Points3D": cells["p"], "Disp": {"DispVec": cells["u"]}}
        savemat(tmp_path / "a.mat", {"DIC3DPPresults": results})
        said = complaint(read_frames, [tmp_path / "a.mat"])
        assert said.endswith(f"a.mat: Points3D and DispVec are {places} and {moved}")


def test_multidic_has_a_frame_for_each_cell(tmp_path):
    cells = {name: np.empty((2, 1), dtype=object) for name in ("points", "vectors")}
    for k in (0, 1):
        cells["vectors"][k, 0] = k * ARRAY_DISPLACEMENT
        cells["points"][k, 0] = ARRAY_PLACES + k * ARRAY_DISPLACEMENT
    results = {"Points3D": cells["points"], "Disp": {"DispVec": cells["vectors"]}}
    savemat(tmp_path / "a.mat", {"DIC3DPPresults": results})
    frames = read_frames([tmp_path / "a.mat"])
    for k, frame in enumerate(frames):
        np.testing.assert_allclose(frame.points, ARRAY_PLACES, atol=1e-12)
        np.testing.assert_allclose(frame.displacement, k * ARRAY_DISPLACEMENT)
    assert len(frames) == 2


def ncorr(path: Path, u, v, spacing=4.0, pixel=0.1, coefficient=None):
    fields = {"plot_u_ref_formatted": u, "plot_v_ref_formatted": v}
    if coefficient is not None:
        fields["plot_corrcoef_dic"] = coefficient
    saved = np.empty((1, 1), dtype=[(name, object) for name in fields])
    for name, grid in fields.items():
        saved[name][0, 0] = grid
    about = {"spacing": spacing, "pixtounits": pixel, "units": "mm"}
    savemat(path, {"data_dic_save": {"displacements": saved, "dispinfo": about}})
    return read_frames([path], FrameOptions(planar=True))[0]


def test_ncorr_takes_correlated_points_in_its_grid(tmp_path):
    """Places a grid point apart are 5 pixels of 0.1 mm; row 0 is the upper one."""
    path = tmp_path / "a.mat"
    u, v = np.array([[0.0, -0.2], [0.0, 0.0]]), np.array([[0.0, 0.0], [-0.4, 0.0]])
    frame = ncorr(path, u, v)
    np.testing.assert_allclose(frame.points, [[0.5, 0, 0], [0, -0.5, 0]])
    np.testing.assert_allclose(frame.displacement, [[-0.2, 0, 0], [0, 0.4, 0]])
    # A point that moves along one axis only, to either side, is correlated.
    only_u = ncorr(path, np.array([[0.3, -0.2], [0.0, 0.0]]), np.zeros((2, 2)))
    only_v = ncorr(path, np.zeros((2, 2)), np.array([[0.3, -0.2], [0.0, 0.0]]))
    assert only_u.displacement[:, 0].tolist() == [0.3, -0.2]
    assert only_v.displacement[:, 1].tolist() == [-0.3, 0.2]
    # Its own coefficient says better where a point did not move.
    frame = ncorr(path, u, v, coefficient=np.array([[0.0, 0.1], [0.0, 0.1]]))
    np.testing.assert_allclose(frame.points, [[0.5, 0, 0], [0.5, -0.5, 0]])
    frame = ncorr(path, u, v, 0.0, 1.0, np.ones((3, 3)))
    np.testing.assert_allclose(frame.points, [[1, 0, 0], [0, -1, 0]])
    for grids, words in (
        ((np.ones((2, 3)), np.ones((3, 2))), "displacements: u and v are (2, 3) and (3, 2)"),
        ((np.ones((2, 2, 2)),) * 2, "displacements: u and v are (2, 2, 2) and (2, 2, 2)"),
        ((u, v, -1.0), "dispinfo.spacing: expected"), ((u, v, 4.0, 1e6), "dispinfo.pixtounits:"),
    ):  # fmt: skip
        assert complaint(ncorr, path, *grids).startswith(f"{path}: {words}")


def test_istra4d_arrays_of_different_shapes_are_refused(tmp_path):
    path = tmp_path / "a.hdf5"

    def written(mask: int = 4, dx: int = 4, without: str = "") -> list[Path]:
        with h5py.File(path, "w") as file:
            for axis in "xyz":
                file[f"coordinates/coordinate_{axis}"] = np.ones((2, 2))
                file[f"displacements/displacement_{axis}"] = np.ones(dx if axis == "x" else 4)
            if mask:
                file["coordinates/mask"] = np.array([1, 0, 2, 1, 1])[:mask]
            if without:
                del file[without]
        return [path]

    for mask, count in ((0, 4), (4, 3)):
        assert len(read_frames(written(mask))[0].points) == count
    for sizes in ((5,), (0, 3), (3,)):
        assert "are not of one size" in complaint(read_frames, written(*sizes))
    for name in ("coordinates/coordinate_x", "displacements/displacement_y"):
        assert "expected coordinates/" in complaint(read_frames, written(without=name))
