"""Damaged and hostile files of frames, and each format at its limits."""

import os
import pickle
import struct
import sys
import time
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from bubblefit.readers import mat_files
from bubblefit.readers.fields import PLAIN, read_fields
from bubblefit.readers.formats import array_exports as npz_files
from bubblefit.readers.formats.array_exports import array_names, read_arrays
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.mat_files import (
    array_of,
    check_readable,
    is_mat,
    member,
    numbers_of,
    open_hdf5,
    read_variables,
    variable_names,
)
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from ..builders import camera_exports
from ..support.refusals import complaint

POINTS = np.array([[1.0, 2, 0.5], [4, -5, 0.25], [7, 8, -1], [0, 3, 0], [2, 2, 1], [3, 1, 1]])
FRAMES = [(POINTS, 0.01 * POINTS[:, [1, 0, 2]] + 0.02)]


class Planted:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (str(self.path), "w")


def test_a_pickle_is_never_read(tmp_path):
    path, trace = tmp_path / "run.npz", tmp_path / "trace"
    objects = np.array([Planted(trace)], dtype=object)
    np.savez(path, points3D=objects, U=objects)
    assert "Python objects" in complaint(read_frames, [path])
    path.write_bytes(pickle.dumps(Planted(trace)))
    for name in ("pyaldic", "csv", "vic3d-mat"):
        complaint(read_frames, [path], format=name)
    assert not trace.exists()


def mat(body: bytes, kind: int = 14) -> bytes:
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    return head + struct.pack("<II", kind, len(body)) + body


def part(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", kind, len(body)) + body + b"\0" * (-len(body) % 8)


def variable(kind: int, shape: list[int], rest: bytes) -> bytes:
    flags, name = part(6, struct.pack("<II", kind, 0)), part(1, b"X")
    return flags + part(5, struct.pack(f"<{len(shape)}i", *shape)) + name + rest


def doubles(*numbers: float) -> bytes:
    return part(9, struct.pack(f"<{len(numbers)}d", *numbers))


def fields(length: int, names: bytes) -> bytes:
    return part(5, struct.pack("<i", length)) + part(1, names)


@pytest.mark.parametrize(
    ("kind", "shape", "rest"),
    [
        (1, [2**31 - 1, 2**31 - 1], b""),
        (1, [1, 3], part(14, b"") * 2),
        (2, [2**31 - 1, 1], fields(8, b"a" * 8)),
        (2, [1, 1], fields(0, b"ab")),
        (6, [2, -1], doubles(1)),
        (6, [2, 2], doubles(1, 2, 3)),
        (6, [2**31 - 1, 2], doubles(0, 0)),
        (6, [1, 3], doubles(1, 2)[:-8]),
        (6, [1, 1], struct.pack("<II", 9, 2**31)),
        *[(6, [1, 1], part(n, b"\0" * 8)) for n in (8, 10, 11, 14, 15, 99)],
    ],
)
def test_mat_files_that_promise_too_much(tmp_path, kind, shape, rest):
    path, body = tmp_path / "a.mat", variable(kind, shape, rest)
    for content in (mat(body), mat(zlib.compress(part(14, body)), 15)):
        path.write_bytes(content)
        message = complaint(read_variables, path, ["X"])
        assert message.startswith(str(path)) and "is it damaged?" in message


def test_a_bomb_in_a_mat_file(tmp_path):
    path, packer = tmp_path / "a.mat", zlib.compressobj(9)
    size = 2**27
    inside = variable(6, [2**24, 1], struct.pack("<II", 9, size))
    bomb = packer.compress(struct.pack("<II", 14, len(inside) + size) + inside)
    for _ in range(128):
        bomb += packer.compress(b"\0" * 2**20)
    path.write_bytes(mat(bomb + packer.flush(), 15))
    said = complaint(read_variables, path, ["X"])
    assert "says (16777216, 1) numbers, more than the file holds" in said


def test_links_out_of_an_hdf5_file_are_not_followed(tmp_path):
    (secret,) = camera_exports.istra4d(tmp_path, FRAMES)
    secret, path = secret.rename(tmp_path / "secret.hdf5"), tmp_path / "a.hdf5"
    raw, place = tmp_path / "raw", "coordinates/coordinate_x"
    raw.write_bytes(b"\0" * 64)
    for link, words in (
        (lambda file: file.update(coordinates=h5py.ExternalLink(str(secret), "/coordinates")),
         f"{place}: is a link to another file"),
        (lambda file: file.create_dataset(place, (8,), dtype="f8", external=[(str(raw), 0, 64)]),
         "its numbers are in another file"),
        (lambda file: file.create_dataset(place, (10**6, 10**6), dtype="f8", chunks=(9, 9)),
         "numbers; is it damaged?"),
    ):  # fmt: skip
        with h5py.File(path, "w") as file:
            link(file)
        assert words in complaint(read_frames, [path])


@pytest.mark.parametrize("read", [lambda: time.sleep(60), lambda: os.kill(os.getpid(), 9)])
def test_what_hdf5_hangs_or_crashes_on_is_refused(tmp_path, monkeypatch, read):
    monkeypatch.setattr(mat_files, "SECONDS", 0.2)
    assert "the library for such files fails on it" in complaint(
        check_readable, tmp_path / "a", read
    )
    monkeypatch.setattr(mat_files, "SECONDS", 20.0)
    check_readable(tmp_path / "a", lambda: None)


def test_without_h5py_the_extra_is_named(tmp_path, monkeypatch):
    (path,) = camera_exports.istra4d(tmp_path, FRAMES)
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert "pip install 'bubblefit[hdf5]'" in complaint(read_frames, [path])
    matlab = tmp_path / "a.mat"
    matlab.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + path.read_bytes())
    assert "pip install 'bubblefit[hdf5]'" in complaint(read_frames, [matlab])


NAMES = {
    "x": ("x", "X", "x_mm", "X [mm]", "Koordinate X", "x0 mm".replace("0", "")),
    "y": ("y", "Y (mm)", "coor.Y [mm]", "y-coordinate"),
    "z": ("z", "Z_mm", "z undeformed [mm]"),
    "dx": ("dx", "u", "U [mm]", "displacement_x", "Verschiebung X [mm]", "x-displacement[mm]"),
    "dy": ("dy", "v", "uy", "disp y"),
    "dz": ("dz", "W", "uz [mm]", "Out-Of-Plane: W [mm]"),
}
lengths = st.floats(-1e4, 1e4, allow_subnormal=False).map(lambda v: v if abs(v) > 1e-9 else 0.5)


@settings(deadline=None, max_examples=80)
@example(
    rows=[(1.5, 2.5, 3.5, 4.5, 5.5, 6.5)] * 2,
    names=("X [mm]", "Y (mm)", "Z_mm", "U [mm]", "v", "W"), order=[5, 4, 3, 2, 1, 0],
    dialect="\t,", number="{!r}", encoding="utf-16", above=[], end="\r\n", quoted=False, flags=None,
)  # fmt: skip
@given(
    rows=st.lists(st.tuples(*[lengths] * 6), min_size=2, max_size=6),
    names=st.tuples(*[st.sampled_from(names) for names in NAMES.values()]),
    order=st.permutations(range(6)),
    dialect=st.sampled_from([",.", ";.", ";,", "\t.", "\t,", " ."]),
    number=st.sampled_from(["{!r}", "{:.17e}", "{:+.17g}", "{:.16E}"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    above=st.sampled_from([[], ["#", "", "# two, 2"], ["Sheet 3; flat", "second, of the day", ""]]),
    end=st.sampled_from(["\n", "\r\n", "\r", "\n\n"]),
    quoted=st.booleans(),
    flags=st.none() | st.lists(st.integers(0, 1), min_size=6, max_size=6),
)
def test_any_dialect_reads_back(
    tmp_path_factory, rows, names, order, dialect, number, encoding, above, end, quoted, flags
):
    separator, decimal = dialect
    good = [True, *(not flag for flag in (flags or [0] * 6)[1 : len(rows)])]
    heads = [names[i] for i in order] + ["flag"] * (flags is not None)
    if quoted or separator == " ":
        heads = [f'"{name}"' for name in heads]
    body = [[number.format(row[i]).replace(".", decimal) for i in order] for row in rows]
    if flags is not None:
        body = [[*row, str(int(not kept))] for row, kept in zip(body, good, strict=True)]
    path = tmp_path_factory.getbasetemp() / "dialect.csv"
    lines = [*above, *(separator.join(row) for row in [heads, *body]), ""]
    path.write_bytes(end.join(lines).encode(encoding))
    options = replace(PLAIN, flag_column=None if flags is None else "flag")
    (field,) = read_fields([path], [0.1], options)
    read = np.column_stack([field.points, field.z, field.displacement])
    rounding = 0 if number == "{!r}" else 1e-15
    np.testing.assert_allclose(read, np.array(rows)[good], rtol=rounding)
    assert sum(field.dropped.values()) == len(rows) - sum(good)


def test_files(tmp_path):
    path, body = tmp_path / "a.mat", variable(6, [1, 1], doubles(4))
    path.write_bytes(mat(body))
    head = path.read_bytes()[:600]
    assert is_mat(head) and is_mat(head[:128]) and not is_mat(head[:127])
    assert variable_names(path, head) == ["X"]
    assert read_variables(path, ["X", "Y"])["X"].tolist() == [[4.0]]
    for content in (mat(body)[:-1], b"MATLAB 4".ljust(140), mat(body)[:126] + b"XX" + body):
        path.write_bytes(content)
        assert "is it damaged?" in complaint(read_variables, path, ["X"])
    path.write_bytes(b"x" * 200)
    assert "is not a MAT-file of version 5 or 7.3" in complaint(read_variables, path, ["X"])
    path.write_bytes(mat(body)[:140])
    assert variable_names(path, head) is None
    savemat(path, {"t": "text", "l": np.array([True, False]), "o": np.array([[1, "a"]], object),
                   "s": np.array([(1, 2.5), (3, 4.5)], [("a", "i4"), ("b", "f8")])})  # fmt: skip
    found = read_variables(path, ["t", "l", "o", "s"])
    assert found["t"] == "text" and found["l"].tolist() == [[1, 0]]
    assert found["o"][0].tolist() == [[1]] and found["o"][1] == "a"
    assert [one["b"].item() for one in found["s"]] == [2.5, 4.5]
    path.unlink()
    assert "No such file or directory" in complaint(read_variables, path, ["X"])
    where = {"a": np.array([[True, False]]), "b": "text", "c": np.array(["x"])}
    assert numbers_of(path, where, "a").tolist() == [[1.0, 0.0]]
    for name in "bcd":
        assert f"variable '{name}': expected" in complaint(numbers_of, path, where, name)


PLACES = np.arange(12.0).reshape(4, 3)
MOVED = 0.01 * PLACES + 0.5


def test_numbers_that_an_archive_can_hold(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, a=PLACES, b=np.asfortranarray(PLACES), c=np.array("text"))
    found = read_arrays(path, ["a", "b", "c", "d"])
    assert sorted(found) == ["a", "b", "c"] and str(found["c"]) == "text"
    np.testing.assert_array_equal(found["a"], PLACES)
    np.testing.assert_array_equal(found["b"], PLACES)
    assert array_names(path) == ["a", "b", "c"] and array_names(tmp_path / "no.npz") == []
    assert "no such file" in complaint(read_arrays, tmp_path / "no.npz", ["a"])
    path = tmp_path / "a.npz"
    whole = archive(path, "(2, 3)", np.arange(6.0).tobytes())
    assert read_arrays(whole, ["a"])["a"].tolist() == [[0, 1, 2], [3, 4, 5]]
    # 54 numbers are as long as file and header together: said to be too short, not too many.
    short, most = archive(path, "(17,)", b"\0" * 8), "more than the file holds"
    assert "array 'a': ends early" in complaint(read_arrays, short, ["a"])
    for shape in ("(1000, 3)", "(-1, 3)", "(3, 99999999999, 3)"):
        said = complaint(read_arrays, archive(path, shape, b"\0" * 8), ["a"])
        assert f"array 'a': says {shape} numbers, {most}" in said
    for kind in ("|O", "<c16", "<M8[s]"):
        said = complaint(read_arrays, archive(path, "(1,)", b"\0" * 16, kind), ["a"])
        assert f"{path}: array 'a': holds Python objects" in said
    # 128 MiB of zeros in an eighth of a MiB.
    bomb = archive(path, "(1, 5592405, 3)", bytes(2**27), packed=True)
    assert most in complaint(read_arrays, bomb, ["a"])


def archive(path: Path, shape, body: bytes, kind: str = "<f8", packed: bool = False) -> Path:
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    header = header.ljust(117) + b"\n"
    how = zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED
    with zipfile.ZipFile(path, "w", how) as out:
        length = struct.pack("<H", len(header))
        out.writestr("a.npy", b"\x93NUMPY\x01\x00" + length + header + body)
    return path


def test_packed_numbers(tmp_path, monkeypatch):
    """Up to 64 MiB always, beyond by what is packed, never more than 1 GiB."""
    assert (npz_files.LARGEST, npz_files.SMALL, npz_files.RATIO) == (2**30, 2**26, 100)
    assert (mat_files.LARGEST, mat_files.SMALL, mat_files.RATIO) == (2**30, 2**26, 100)
    zeros = archive(tmp_path / "a.npz", "(4096,)", b"\0" * 32768, packed=True)
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


def test_pyaldic(tmp_path):
    path = tmp_path / "a.npz"
    own = np.array([0 * PLACES[:, 0], [7.0, 8.0, 9.0, 10.0]])
    np.savez(path, points3D=np.array([PLACES, PLACES + MOVED]), V=own)
    _, frame = read_frames([path])  # displacements are those of the file where it has them
    np.testing.assert_allclose(frame.displacement[:, [0, 2]], MOVED[:, [0, 2]] * [1, -1])
    np.testing.assert_allclose(frame.displacement[:, 1], -own[1])
    np.testing.assert_allclose(frame.points[:, 0], PLACES[:, 0])
    assert set(frame.source.units.values()) == {"mm"}
    assert frame.source.columns["dy"] == "V" and frame.source.columns["x deformed"] == "points3D"
    places, numbers = "points3D: expected places (frames, points, 3)", "points3D: expected numbers"
    for points, words in (
        (PLACES, places), (np.zeros((1, 3, 2)), places), (np.zeros((1, 3, 4)), places),
        (np.zeros((1, 0, 3)), numbers), (np.full((1, 1, 3), "a"), numbers),
        (np.zeros((1, 5, 3)), "V: is (2, 4), points3D"),
    ):  # fmt: skip
        np.savez(path, points3D=points, V=own)
        assert words in complaint(read_frames, [path])


def test_multidic_of_other_shapes(tmp_path):
    for places, moved in (((4, 3), (5, 3)), ((4, 2),) * 2, ((4, 4),) * 2, ((4, 3), (4, 2))):
        cells = {name: np.empty((1, 1), dtype=object) for name in ("p", "u")}
        cells["p"][0, 0], cells["u"][0, 0] = np.zeros(places), np.zeros(moved)
        results = {"Points3D": cells["p"], "Disp": {"DispVec": cells["u"]}}
        savemat(tmp_path / "a.mat", {"DIC3DPPresults": results})
        said = complaint(read_frames, [tmp_path / "a.mat"])
        assert said.endswith(f"a.mat: Points3D and DispVec are {places} and {moved}")


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


def test_ncorr_takes_what_it_correlated(tmp_path):
    """Places a grid point apart are 5 pixels of 0.1 mm; row 0 is the upper one."""
    path = tmp_path / "a.mat"
    u, v = np.array([[0.0, -0.2], [0.0, 0.0]]), np.array([[0.0, 0.0], [-0.4, 0.0]])
    frame = ncorr(path, u, v)
    np.testing.assert_allclose(frame.points, [[0.5, 0, 0], [0, -0.5, 0]])
    np.testing.assert_allclose(frame.displacement, [[-0.2, 0, 0], [0, 0.4, 0]])
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


def test_istra4d_of_arrays_that_do_not_agree(tmp_path):
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


def test_hdf5_members_and_sizes(tmp_path, monkeypatch):
    path = tmp_path / "a.hdf5"
    with h5py.File(path, "w") as file:
        file["group/numbers"] = np.arange(4, dtype="i2")
        file["group/words"] = "text"
        file["empty"] = h5py.Empty("f8")
    with open_hdf5(path) as file:
        assert member(path, file, "group/none") is member(path, file, "group/numbers/x") is None
        numbers = member(path, file, "group/numbers")
        for thing in (file["group"], file["group/words"]):
            assert f"{path}: n: expected an" in complaint(array_of, path, thing, "n")
        assert f"{path}: n: says it holds" in complaint(array_of, path, file["empty"], "n")
        # Each becomes a number of eight bytes.
        monkeypatch.setattr(mat_files, "LARGEST", 32)
        assert array_of(path, numbers, "n").tolist() == [0.0, 1.0, 2.0, 3.0]
        monkeypatch.setattr(mat_files, "LARGEST", 31)
        assert f"{path}: n: says it holds (4,)" in complaint(array_of, path, numbers, "n")
    path.write_bytes(b"no such thing")
    assert f"{path}: cannot be read as HDF5" in complaint(open_hdf5(path).__enter__)


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
def test_zones_of_tecplot_that_are_none(tmp_path, old, new, words):
    path = tmp_path / "a.dat"
    path.write_text(ZONE.replace(old, new).format(keys="I=2"))
    assert complaint(read_frames, [path]).startswith(f"{path}: {words}")


def test_rows_of_a_zone_are_points_by_its_flags(tmp_path):
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
