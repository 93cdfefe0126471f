"""readers/mat_files.py: MATLAB and HDF5 files, damaged and hostile ones among them."""

import os
import struct
import sys
import time
import zlib

import h5py
import numpy as np
import pytest
from bubblefit.readers import mat_files
from bubblefit.readers.frames import read_frames
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
from scipy.io import savemat

from ..builders import camera_exports
from ..support.refusals import complaint
from .cases import TWO_FRAMES, mat_doubles, mat_fields, mat_file, mat_part, mat_variable


@pytest.mark.parametrize(
    ("kind", "shape", "rest"),
    [
        (1, [2**31 - 1, 2**31 - 1], b""),
        (1, [1, 3], mat_part(14, b"") * 2),
        (2, [2**31 - 1, 1], mat_fields(8, b"a" * 8)),
        (2, [1, 1], mat_fields(0, b"ab")),
        (6, [2, -1], mat_doubles(1)),
        (6, [2, 2], mat_doubles(1, 2, 3)),
        (6, [2**31 - 1, 2], mat_doubles(0, 0)),
        (6, [1, 3], mat_doubles(1, 2)[:-8]),
        (6, [1, 1], struct.pack("<II", 9, 2**31)),
        *[(6, [1, 1], mat_part(n, b"\0" * 8)) for n in (8, 10, 11, 14, 15, 99)],
    ],
)
def test_mat_file_that_promises_too_much_is_refused(tmp_path, kind, shape, rest):
    path, body = tmp_path / "a.mat", mat_variable(kind, shape, rest)
    for content in (mat_file(body), mat_file(zlib.compress(mat_part(14, body)), 15)):
        path.write_bytes(content)
        message = complaint(read_variables, path, ["X"])
        assert message.startswith(str(path)) and "is it damaged?" in message


def test_compressed_bomb_in_a_mat_file_is_refused(tmp_path):
    path, packer = tmp_path / "a.mat", zlib.compressobj(9)
    size = 2**27
    inside = mat_variable(6, [2**24, 1], struct.pack("<II", 9, size))
    bomb = packer.compress(struct.pack("<II", 14, len(inside) + size) + inside)
    for _ in range(128):
        bomb += packer.compress(b"\0" * 2**20)
    path.write_bytes(mat_file(bomb + packer.flush(), 15))
    said = complaint(read_variables, path, ["X"])
    assert "says (16777216, 1) numbers, more than the file holds" in said


def test_links_out_of_an_hdf5_file_are_not_followed(tmp_path):
    (secret,) = camera_exports.istra4d(tmp_path, TWO_FRAMES)
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
def test_file_on_which_hdf5_hangs_or_crashes_is_refused(tmp_path, monkeypatch, read):
    monkeypatch.setattr(mat_files, "SECONDS", 0.2)
    assert "the library for such files fails on it" in complaint(
        check_readable, tmp_path / "a", read
    )
    monkeypatch.setattr(mat_files, "SECONDS", 20.0)
    check_readable(tmp_path / "a", lambda: None)


def test_missing_h5py_is_refused_with_its_extra(tmp_path, monkeypatch):
    (path,) = camera_exports.istra4d(tmp_path, TWO_FRAMES)
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert "pip install 'bubblefit[hdf5]'" in complaint(read_frames, [path])
    matlab = tmp_path / "a.mat"
    matlab.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + path.read_bytes())
    assert "pip install 'bubblefit[hdf5]'" in complaint(read_frames, [matlab])


def test_variables_of_mat_files_and_their_damage(tmp_path):
    path, body = tmp_path / "a.mat", mat_variable(6, [1, 1], mat_doubles(4))
    path.write_bytes(mat_file(body))
    head = path.read_bytes()[:600]
    assert is_mat(head) and is_mat(head[:128]) and not is_mat(head[:127])
    assert variable_names(path, head) == ["X"]
    assert read_variables(path, ["X", "Y"])["X"].tolist() == [[4.0]]
    for content in (
        mat_file(body)[:-1],
        b"MATLAB 4".ljust(140),
        mat_file(body)[:126] + b"XX" + body,
    ):
        path.write_bytes(content)
        assert "is it damaged?" in complaint(read_variables, path, ["X"])
    path.write_bytes(b"x" * 200)
    assert "is not a MAT-file of version 5 or 7.3" in complaint(read_variables, path, ["X"])
    path.write_bytes(mat_file(body)[:140])
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


def test_hdf5_members_and_their_sizes(tmp_path, monkeypatch):
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


@pytest.mark.parametrize("depth", [16, 17])
def test_cells_within_each_other_are_read_to_a_depth_of_sixteen(tmp_path, depth):
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        item = file.create_dataset("#refs#/0", data=[[4.0]])
        for number in range(1, depth):
            item = file.create_dataset(f"#refs#/{number}", (1, 1), h5py.ref_dtype, item.ref)
        file.create_dataset("X", (1, 1), h5py.ref_dtype, item.ref)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    if depth > 16:
        assert "has too many parts" in complaint(read_variables, path, ["X"])
        return
    value = read_variables(path, ["X"])["X"]
    for _ in range(depth):
        (value,) = value
    assert value.tolist() == [[4.0]]


@pytest.mark.parametrize(("depth", "content"), [(16, [[4.0]]), (17, None)])
def test_cells_of_older_files_are_read_to_a_depth_of_sixteen(tmp_path, depth, content):
    value = np.array([[4.0]])
    for _ in range(depth):
        cell = np.empty((1, 1), dtype=object)
        cell[0, 0] = value
        value = cell
    savemat(tmp_path / "a.mat", {"X": value})
    read = read_variables(tmp_path / "a.mat", ["X"])["X"]
    for _ in range(depth):
        (read,) = read
    assert (read if read is None else read.tolist()) == content
