"""Damaged and hostile files of frames, and each format at its limits."""

import builtins
import io
import os
import pickle
import struct
import sys
import time
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.readers import hdf5_files, mat_files
from bubblefit.readers.fields import read_fields
from bubblefit.readers.formats import pyaldic as npz_files
from bubblefit.readers.formats.pyaldic import array_names, read_arrays
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.hdf5_files import array_of, check_readable, member, open_hdf5
from bubblefit.readers.mat_files import (
    MatrixParts,
    is_mat,
    numbers_of,
    read_variables,
    variable_names,
)
from hypothesis import example, given, settings
from hypothesis import strategies as st

from .. import dic_exports
from ..complaints import complaint
from ..dic_exports import EXPORTS

# --- hostile frames ---
POINTS = np.array([[1.0, 2, 0.5], [4, -5, 0.25], [7, 8, -1], [0, 3, 0], [2, 2, 1], [3, 1, 1]])
FRAMES = [(POINTS, 0.01 * POINTS[:, [1, 0, 2]] + 0.02)]
#: Each export of one frame, as bytes, with its suffix.
CASES = [*EXPORTS, "ncorr"]


@pytest.fixture(scope="module")
def exports(tmp_path_factory) -> dict[str, tuple[bytes, Path]]:
    content = {}
    for case in CASES:
        folder = tmp_path_factory.mktemp("hostile")
        write = dic_exports.ncorr if case == "ncorr" else EXPORTS[case][1]
        frames = [(np.abs(POINTS), FRAMES[0][1])] if case == "ncorr" else FRAMES
        (file,) = write(folder, frames)
        content[case] = file.read_bytes(), folder / f"damaged{file.suffix}"
    return content


garbage = st.one_of(
    st.binary(max_size=12),
    st.text('",;\n#.e-+0129 \t\r=', max_size=12).map(str.encode),
    st.sampled_from([b"\xff\xff\xff\x7f", b"\0" * 8, b"\xff" * 8, b"nan", b"1e999", b"9" * 50]),
)


@pytest.mark.parametrize("case", CASES)
@settings(deadline=None, max_examples=15)
@given(where=st.floats(0, 1), length=st.integers(0, 40), new=garbage)
def test_a_damaged_export_is_frames_or_refused(exports, case, where, length, new):
    content, path = exports[case]
    start = round(where * len(content))
    path.write_bytes(content[:start] + new + content[start + length :])
    try:
        frames = read_frames([path], FrameOptions(planar=True))
    except InputError as error:
        assert "\n" not in str(error) and str(path) in str(error)
    else:
        for frame in frames:
            assert frame.points.shape == frame.displacement.shape
            assert not np.isinf(frame.points).any() and not np.isinf(frame.displacement).any()


@pytest.mark.parametrize("name", sorted({name for name, _ in EXPORTS.values()} | {"ncorr"}))
@settings(deadline=None, max_examples=5)
@given(content=st.binary(max_size=300))
@example(content=b"")
@example(content=b"MATLAB 5.0 MAT-file" + b" " * 107 + b"IM" + b"\x0e\0\0\0\xff\xff\xff\x7f")
@example(content=b"PK\x03\x04" + b"\0" * 40)
@example(content=b"\x89HDF\r\n\x1a\n" + b"\0" * 90)
@example(content=b"\xff\xfe" + "x;y;dx;dy;dz\n1;2;3;4".encode("utf-16-le"))
def test_garbage_under_every_name_is_refused(tmp_path_factory, name, content):
    path = tmp_path_factory.getbasetemp() / "garbage"
    path.write_bytes(content)
    try:
        read_frames([path], format=name)
    except InputError as error:
        assert "\n" not in str(error)


class Planted:
    """Unpickled, it leaves a file behind."""

    def __init__(self, path: Path):
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


def npy(header: bytes, body: bytes = b"") -> bytes:
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + body


def test_headers_that_promise_too_much(tmp_path):
    path = tmp_path / "run.npz"
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (3, 99999999999, 3), }"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("points3D.npy", npy(header.ljust(117) + b"\n", b"\0" * 80))
    assert "more than the file holds" in complaint(read_frames, [path])
    # 128 MiB of zeros in an eighth of a MiB.
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1, 5592405, 3), }"
    zeros = io.BytesIO()
    with zipfile.ZipFile(zeros, "w", zipfile.ZIP_DEFLATED) as archive:
        with archive.open("points3D.npy", "w") as stream:
            stream.write(npy(header.ljust(117) + b"\n"))
            for _ in range(128):
                stream.write(b"\0" * 2**20)
    path.write_bytes(zeros.getvalue())
    assert "more than the file holds" in complaint(read_frames, [path])


def mat(body: bytes, kind: int = 14) -> bytes:
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    return head + struct.pack("<II", kind, len(body)) + body


def part(kind: int, body: bytes) -> bytes:
    return struct.pack("<II", kind, len(body)) + body + b"\0" * (-len(body) % 8)


def variable(kind: int, shape: list[int], rest: bytes) -> bytes:
    flags, name = part(6, struct.pack("<II", kind, 0)), part(1, b"X")
    return flags + part(5, struct.pack(f"<{len(shape)}i", *shape)) + name + rest


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (variable(1, [2**31 - 1, 2**31 - 1], b""), "parts in"),
        (variable(1, [3, 1], part(14, b"") * 2), "3 parts in 64 bytes"),
        (variable(2, [2**31 - 1, 1], part(5, struct.pack("<i", 8)) + part(1, b"a" * 8)), "parts"),
        (variable(6, [2**31 - 1, 2], part(9, b"\0" * 16)), "2 numbers for a shape"),
        (variable(6, [-1, -2], part(9, b"\0" * 16)), "no shape"),
        (variable(6, [1, 1], struct.pack("<II", 9, 2**31)), "longer than the variable"),
        (variable(6, [1, 1], part(99, b"\0" * 8)), "unknown kind 99"),
    ],
)
def test_mat_files_that_promise_too_much(tmp_path, body, words):
    path = tmp_path / "a.mat"
    for content in (mat(body), mat(zlib.compress(part(14, body)), 15)):
        path.write_bytes(content)
        message = complaint(read_variables, path, ["X"])
        assert words in message and "is the file damaged?" in message
    # A struct without fields does not loop.
    body = variable(2, [2**31 - 1, 2**31 - 1], part(5, struct.pack("<i", 8)) + part(1, b""))
    path.write_bytes(mat(body))
    assert read_variables(path, ["X"]) == {"X": []}


def test_a_bomb_in_a_mat_file(tmp_path):
    path, packer = tmp_path / "a.mat", zlib.compressobj(9)
    size = 2**27
    inside = variable(6, [2**24, 1], struct.pack("<II", 9, size))
    bomb = packer.compress(struct.pack("<II", 14, len(inside) + size) + inside)
    for _ in range(128):
        bomb += packer.compress(b"\0" * 2**20)
    path.write_bytes(mat(bomb + packer.flush(), 15))
    assert "cannot be read; is it damaged?" in complaint(read_variables, path, ["X"])


def test_deep_nesting_is_refused(tmp_path):
    path, body = tmp_path / "a.mat", variable(6, [1, 1], part(9, b"\0" * 8))
    for _ in range(40):
        body = variable(1, [1, 1], part(14, body))
    path.write_bytes(mat(body))
    assert "nested too deeply" in complaint(read_variables, path, ["X"])


values = st.recursive(
    st.one_of(
        st.lists(st.floats(allow_nan=False), min_size=1, max_size=4).map(np.array),
        st.lists(st.integers(-9, 9), min_size=4, max_size=4).map(
            lambda n: np.array(n, dtype="i2").reshape(2, 2)
        ),
        st.lists(st.booleans(), min_size=1, max_size=3).map(np.array),
        st.text("abc xyz", min_size=1, max_size=8).filter(str.strip),
    ),
    lambda inner: st.dictionaries(st.sampled_from("abcd"), inner, min_size=1, max_size=3),
    max_leaves=6,
)


@settings(deadline=None, max_examples=40)
@given(value=values, compressed=st.booleans())
def test_what_scipy_writes_is_read(tmp_path_factory, value, compressed):
    from scipy.io import savemat

    path = tmp_path_factory.getbasetemp() / "round.mat"
    savemat(path, {"value": value, "other": 1.0}, do_compression=compressed)
    assert_same(read_variables(path, ["value"])["value"], value)


def assert_same(read, value):
    if isinstance(value, dict):
        (read,) = read
        assert set(read) == set(value)
        for key in value:
            assert_same(read[key], value[key])
    elif isinstance(value, str):
        assert read == value
    else:
        np.testing.assert_array_equal(read, np.atleast_2d(value))


def test_links_out_of_an_hdf5_file_are_not_followed(tmp_path):
    import h5py

    (secret,) = dic_exports.istra4d(tmp_path, FRAMES)
    secret = secret.rename(tmp_path / "secret.hdf5")
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["coordinates"] = h5py.ExternalLink(str(secret), "/coordinates")
        file["displacements"] = h5py.ExternalLink(str(secret), "/displacements")
    message = complaint(read_frames, [tmp_path / "a.hdf5"])
    assert "coordinates/coordinate_x: is a link to another file, which is not followed" in message
    raw = tmp_path / "raw"
    raw.write_bytes(b"\0" * 64)
    with h5py.File(tmp_path / "b.hdf5", "w") as file:
        coordinates = file.create_group("coordinates")
        outside = [(str(raw), 0, 64)]
        coordinates.create_dataset("coordinate_x", (8,), dtype="f8", external=outside)
    assert "its numbers are in another file" in complaint(read_frames, [tmp_path / "b.hdf5"])
    with h5py.File(tmp_path / "c.hdf5", "w") as file:
        file.create_dataset("coordinates/coordinate_x", (10**6, 10**6), dtype="f8", chunks=(9, 9))
    assert "numbers; is it damaged?" in complaint(read_frames, [tmp_path / "c.hdf5"])


@pytest.mark.parametrize("read", [lambda: time.sleep(60), lambda: os.kill(os.getpid(), 9)])
def test_what_hdf5_hangs_or_crashes_on_is_refused(tmp_path, read):
    assert "its library fails on it" in complaint(check_readable, tmp_path / "a", read, 0.2)
    check_readable(tmp_path / "a", lambda: None)


def test_without_h5py_the_extra_is_named(tmp_path, monkeypatch):
    (path,) = dic_exports.istra4d(tmp_path, FRAMES)
    inside = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "h5py":
            raise ImportError(name)
        return inside(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    monkeypatch.delitem(sys.modules, "h5py", raising=False)
    message = complaint(read_frames, [path])
    assert "needs h5py; install it with: pip install 'bubblefit[hdf5]'" in message
    matlab = tmp_path / "a.mat"
    matlab.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + path.read_bytes())
    assert "pip install 'bubblefit[hdf5]'" in complaint(read_frames, [matlab])


# --- plain tables in any dialect ---
NAMES = {
    "x": ("x", "X", "x_mm", "X [mm]", "Koordinate X", "x0 mm".replace("0", "")),
    "y": ("y", "Y (mm)", "coor.Y [mm]", "y-coordinate"),
    "z": ("z", "Z_mm", "z undeformed [mm]"),
    "dx": ("dx", "u", "U [mm]", "displacement_x", "Verschiebung X [mm]", "x-displacement[mm]"),
    "dy": ("dy", "v", "uy", "disp y"),
    "dz": ("dz", "W", "uz [mm]", "Out-Of-Plane: W [mm]"),
}
FORMATS = (repr, "{:.17e}".format, "{:+.17g}".format, "{:.16E}".format)
lengths = st.floats(-1e4, 1e4, allow_subnormal=False).map(lambda v: v if abs(v) > 1e-9 else 0.5)


@settings(deadline=None, max_examples=60)
@example(
    rows=[(1.5, 2.5, 3.5, 4.5, 5.5, 6.5)] * 2,
    names=("X [mm]", "Y (mm)", "Z_mm", "U [mm]", "v", "W"),
    order=[5, 4, 3, 2, 1, 0],
    dialect=("\t", ","),
    number=repr,
    encoding="utf-16",
    above=[],
    end="\r\n",
    quoted=False,
    extra=True,
)
@given(
    rows=st.lists(st.tuples(*[lengths] * 6), min_size=2, max_size=6),
    names=st.tuples(*[st.sampled_from(names) for names in NAMES.values()]),
    order=st.permutations(range(6)),
    dialect=st.sampled_from(
        [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", ".")]
    ),
    number=st.sampled_from(FORMATS),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    above=st.sampled_from([[], ["# a comment"], ["Sheet 3; flat", "second, of the day", ""]]),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    quoted=st.booleans(),
    extra=st.booleans(),
)
def test_any_dialect_reads_back(
    tmp_path_factory, rows, names, order, dialect, number, encoding, above, end, quoted, extra
):
    separator, decimal = dialect
    heads = [names[i] for i in order] + ["note"] * extra
    if quoted or separator == " ":
        heads = [f'"{name}"' for name in heads]
    body = [
        separator.join([number(row[i]).replace(".", decimal) for i in order] + ["1"] * extra)
        for row in rows
    ]
    path = tmp_path_factory.getbasetemp() / "dialect.csv"
    path.write_bytes(end.join([*above, separator.join(heads), *body, ""]).encode(encoding))
    (field,) = read_fields([path], [0.1])
    read = np.column_stack([field.points, field.z, field.displacement])
    np.testing.assert_allclose(read, rows, rtol=1e-15)


# --- mat matrix ---
def value(kind: int, shape: list[int], rest: bytes, order: str = "<"):
    return MatrixParts(variable(kind, shape, rest), order).matrix(0)


def doubles(*numbers: float) -> bytes:
    return part(9, struct.pack(f"<{len(numbers)}d", *numbers))


@pytest.mark.parametrize("kind", [6, 7, 15])
def test_numbers_run_along_the_first_index_first(kind):
    found = value(kind, [2, 3], doubles(1, 2, 3, 4, 5, 6))
    np.testing.assert_array_equal(found, [[1, 3, 5], [2, 4, 6]])


def test_every_type_of_numbers():
    codes = {1: "b", 2: "B", 3: "h", 4: "H", 5: "i", 6: "I", 7: "f", 9: "d", 12: "q", 13: "Q"}
    for kind, code in codes.items():
        body = struct.pack(f"<3{code}", 1, 2, 3)
        assert value(6, [1, 3], part(kind, body)).tolist() == [[1, 2, 3]], code
    for kind in (8, 10, 11, 14, 15):
        with pytest.raises(ValueError, match=f"numbers of an unknown kind {kind}"):
            value(6, [1, 1], part(kind, b"\0" * 8))
    with pytest.raises(ValueError, match="numbers of an unknown kind 9"):
        value(6, [1, 1], part(9, b"\0" * 12))


def test_text_truth_and_what_only_matlab_can_read():
    assert value(4, [1, 3], part(4, struct.pack("<3H", 97, 0, 98))) == "ab"
    assert value(4, [1, 5000], part(2, b"x" * 5000)) == "x" * 4096
    assert value(4, [1, 2], part(6, struct.pack("<2I", 0x110000, 0x10FFFF))) == "\U0010ffff"
    flags = part(6, struct.pack("<II", 9 | 0x200, 0))
    shape = part(5, struct.pack("<2i", 1, 2))
    body = flags + shape + part(1, b"X") + part(2, b"\0\2")
    truth = MatrixParts(body, "<").matrix(0)
    assert truth.dtype == bool and truth.tolist() == [[False, True]]
    for kind in (3, 5, 16, 17):
        assert value(kind, [1, 1], doubles(1)) is None
    assert MatrixParts(b"", "<").matrix(0).shape == (0, 0)


def test_small_parts_and_the_other_order_of_bytes():
    """A part of four bytes or fewer stands in the second half of its own tag."""
    small = struct.pack("<HHBBxx", 2, 2, 7, 8)
    assert value(6, [1, 2], small).tolist() == [[7, 8]]
    assert MatrixParts(small + small, "<").part() == (2, b"\7\x08")
    body = struct.pack(">II", 9, 16) + struct.pack(">2d", 1.5, 2.5)
    assert MatrixParts(body, ">").numbers().tolist() == [1.5, 2.5]


def test_cells_and_structs():
    one = part(14, variable(6, [1, 1], doubles(1)))
    two = part(14, variable(6, [1, 2], doubles(2, 3)))
    cells = value(1, [1, 2], one + two)
    assert [cell.tolist() for cell in cells] == [[[1.0]], [[2.0, 3.0]]]
    fields = part(5, struct.pack("<i", 8)) + part(1, b"a\0xxxxxxbb".ljust(16, b"\0"))
    found = value(2, [1, 2], fields + one + two + two + one)
    assert [{k: v.tolist() for k, v in each.items()} for each in found] == [
        {"a": [[1.0]], "bb": [[2.0, 3.0]]},
        {"a": [[2.0, 3.0]], "bb": [[1.0]]},
    ]


@pytest.mark.parametrize(
    ("kind", "shape", "rest", "words"),
    [
        (6, [3], doubles(1, 2, 3), r"no shape: \[3\]"),
        (6, [2, -1], doubles(1), r"no shape: \[2, -1\]"),
        (6, [2, 2], doubles(1, 2, 3), r"3 numbers for a shape of \[2, 2\]"),
        (6, [1, 3], doubles(1, 2)[:-8], "a part is longer than the variable"),
        (2, [1, 1], part(5, struct.pack("<i", 0)) + part(1, b"ab"), "field names of 0 letters"),
        (2, [1, 1], part(5, struct.pack("<i", -1)) + part(1, b"ab"), "field names of -1 letters"),
        (2, [1, 1], part(5, struct.pack("<i", 3)) + part(1, b"abcd"), "field names of 3 letters"),
        (1, [1, 3], part(14, b"") * 2, "3 parts in 64 bytes"),
    ],
)
def test_what_a_damaged_variable_says(kind, shape, rest, words):
    with pytest.raises(ValueError, match=words):
        value(kind, shape, rest)
    # Empty cells fill a variable to its last byte.
    assert [cell.shape for cell in value(1, [1, 2], part(14, b"") * 2)] == [(0, 0)] * 2
    assert value(6, [0, 2], part(9, b"")).shape == (0, 2)


def test_sixteen_cells_within_each_other():
    def nested(depth: int) -> bytes:
        body = variable(6, [1, 1], doubles(1))
        for _ in range(depth):
            body = variable(1, [1, 1], part(14, body))
        return body

    found = MatrixParts(nested(16), "<").matrix(0)
    for _ in range(16):
        (found,) = found
    assert found.tolist() == [[1.0]]
    with pytest.raises(ValueError, match="nested too deeply"):
        MatrixParts(nested(17), "<").matrix(0)


def test_files(tmp_path):
    path = tmp_path / "a.mat"
    body = variable(6, [1, 1], doubles(4))
    path.write_bytes(mat(body))
    head = path.read_bytes()[:600]
    assert is_mat(head) and is_mat(head[:128]) and not is_mat(head[:127])
    assert variable_names(path, head) == ["X"]
    assert read_variables(path, ["X", "Y"])["X"].tolist() == [[4.0]]
    path.write_bytes(mat(body)[:-1])
    assert variable_names(path, head) is None
    assert "ends within a variable; is it damaged?" in complaint(read_variables, path, ["X"])
    path.write_bytes(b"MATLAB 4".ljust(140))
    assert complaint(read_variables, path, ["X"]) == (f"{path}: is not a MAT-file; is it damaged?")
    path.write_bytes(b"x" * 200)
    assert "is not a MAT-file of version 5 or 7.3; save" in complaint(read_variables, path, ["X"])
    path.unlink()
    assert complaint(read_variables, path, ["X"]).endswith(
        "cannot be read: No such file or directory"
    )


def test_numbers_among_other_things():
    where = {"a": np.array([[True, False]]), "b": "text", "c": np.array(["x"])}
    assert numbers_of(Path("a.mat"), where, "a").tolist() == [[1.0, 0.0]]
    for name in "bcd":
        assert f"variable '{name}': expected" in complaint(numbers_of, Path("a.mat"), where, name)


# --- limits of exports ---
PLACES = np.arange(12.0).reshape(4, 3)
MOVED = 0.01 * PLACES + 0.5


# --- .npz ---
def test_arrays_of_an_archive(tmp_path):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, a=PLACES, b=np.asfortranarray(PLACES), c=np.array("text"))
    found = read_arrays(path, ["a", "b", "c", "d"])
    assert sorted(found) == ["a", "b", "c"] and str(found["c"]) == "text"
    np.testing.assert_array_equal(found["a"], PLACES)
    np.testing.assert_array_equal(found["b"], PLACES)
    assert array_names(path) == ["a", "b", "c"] and array_names(tmp_path / "no.npz") == []
    assert complaint(read_arrays, tmp_path / "no.npz", ["a"]).endswith("no.npz: no such file")


def archive(path: Path, shape: str, body: bytes, kind: str = "<f8", packed: bool = False) -> Path:
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    how = zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED
    with zipfile.ZipFile(path, "w", how) as out:
        out.writestr("a.npy", npy(header.ljust(117) + b"\n", body))
    return path


def test_numbers_that_an_archive_can_hold(tmp_path):
    path = tmp_path / "a.npz"
    whole = archive(path, "(2, 3)", np.arange(6.0).tobytes())
    assert read_arrays(whole, ["a"])["a"].tolist() == [[0, 1, 2], [3, 4, 5]]
    # 54 numbers are as long as file and header together: said to be too short, not too many.
    short = archive(path, "(17,)", b"\0" * 8)
    assert "array 'a': ends early; is the file damaged?" in complaint(read_arrays, short, ["a"])
    for shape in ("(1000, 3)", "(-1, 3)"):
        said = complaint(read_arrays, archive(path, shape, b"\0" * 8), ["a"])
        assert f"array 'a': says {shape} numbers, more than the file holds; is it damaged?" in said
    for kind in ("|O", "<c16", "<M8[s]"):
        assert complaint(read_arrays, archive(path, "(1,)", b"\0" * 16, kind), ["a"]) == (
            f"{path}: array 'a': holds Python objects or records, which are not read: save plain "
            "numbers"
        )


def test_packed_numbers(tmp_path, monkeypatch):
    """Up to 64 MiB always, beyond by what is packed, never more than 1 GiB."""
    assert (npz_files.LARGEST, npz_files.SMALL, npz_files.RATIO) == (2**30, 2**26, 100)
    assert (mat_files.LARGEST, mat_files.SMALL, mat_files.RATIO) == (2**30, 2**26, 100)
    zeros = archive(tmp_path / "a.npz", "(4096,)", b"\0" * 32768, packed=True)
    with zipfile.ZipFile(zeros) as packed:
        share = 32768 / packed.getinfo("a.npy").compress_size
    monkeypatch.setattr(npz_files, "SMALL", 32767)
    monkeypatch.setattr(npz_files, "RATIO", share * 1.001)
    assert len(read_arrays(zeros, ["a"])["a"]) == 4096
    monkeypatch.setattr(npz_files, "RATIO", share * 0.999)
    assert "more than the file holds" in complaint(read_arrays, zeros, ["a"])
    monkeypatch.setattr(npz_files, "SMALL", 32768)
    assert len(read_arrays(zeros, ["a"])["a"]) == 4096
    monkeypatch.setattr(npz_files, "LARGEST", 32767)
    assert "more than the file holds" in complaint(read_arrays, zeros, ["a"])


# --- pyALDIC-3D ---
def pyaldic(path: Path, **arrays: np.ndarray) -> Path:
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"points3D": PLACES}, "points3D: expected places (frames, points, 3)"),
        ({"points3D": np.zeros((1, 3, 2))}, "points3D: expected places (frames, points, 3)"),
        ({"points3D": np.zeros((1, 3, 4))}, "points3D: expected places (frames, points, 3)"),
        ({"points3D": np.zeros((1, 0, 3))}, "points3D: expected numbers, found none"),
        ({"points3D": np.full((1, 1, 3), "a")}, "points3D: expected numbers, found none"),
        ({"points3D": np.zeros((1, 4, 3)), "V": np.zeros((1, 3))}, "V: is (1, 3), points3D"),
    ],
)
def test_pyaldic_without_places(tmp_path, arrays, words):
    assert words in complaint(read_frames, [pyaldic(tmp_path / "a.npz", **arrays)])


def test_pyaldic_displacements_are_those_of_the_file_where_it_has_them(tmp_path):
    points = np.array([PLACES, PLACES + MOVED])
    own = np.array([0 * PLACES[:, 0], [7.0, 8.0, 9.0, 10.0]])
    _, frame = read_frames([pyaldic(tmp_path / "a.npz", points3D=points, V=own)])
    np.testing.assert_allclose(frame.displacement[:, [0, 2]], MOVED[:, [0, 2]] * [1, -1])
    np.testing.assert_allclose(frame.displacement[:, 1], -own[1])
    np.testing.assert_allclose(frame.points[:, 0], PLACES[:, 0])
    assert set(frame.source.units.values()) == {"mm"}
    assert frame.source.columns["dy"] == "V" and frame.source.columns["x deformed"] == "points3D"


# --- MATLAB ---
@pytest.mark.parametrize(
    ("places", "moved"), [((4, 3), (5, 3)), ((4, 2), (4, 2)), ((4, 4), (4, 4)), ((4, 3), (4, 2))]
)
def test_multidic_of_other_shapes(tmp_path, places, moved):
    from scipy.io import savemat

    cells = {name: np.empty((1, 1), dtype=object) for name in ("p", "u")}
    cells["p"][0, 0], cells["u"][0, 0] = np.zeros(places), np.zeros(moved)
    results = {"Points3D": cells["p"], "Disp": {"DispVec": cells["u"]}}
    savemat(tmp_path / "a.mat", {"DIC3DPPresults": results})
    said = complaint(read_frames, [tmp_path / "a.mat"])
    assert said.endswith(f"a.mat: Points3D and DispVec are {places} and {moved}")


def test_columns_of_multidic(tmp_path):
    (path,) = dic_exports.multidic(tmp_path, [(PLACES, MOVED)])
    _, frame = read_frames([path])
    assert frame.source.columns == {
        "x deformed": "Points3D", "y deformed": "Points3D", "z deformed": "Points3D",
        "dx": "DispVec", "dy": "DispVec", "dz": "DispVec",
    }  # fmt: skip
    assert frame.source.units == {}
    np.testing.assert_allclose(frame.points[:4], PLACES, atol=1e-12)


def ncorr(path: Path, u, v, about=(4.0, 0.1, "mm"), coefficient=None) -> Path:
    from scipy.io import savemat

    fields = {"plot_u_ref_formatted": u, "plot_v_ref_formatted": v}
    if coefficient is not None:
        fields["plot_corrcoef_dic"] = coefficient
    saved = np.empty((1, 1), dtype=[(name, object) for name in fields])
    for name, grid in fields.items():
        saved[name][0, 0] = grid
    said = dict(zip(("spacing", "pixtounits", "units"), about, strict=True))
    savemat(path, {"data_dic_save": {"displacements": saved, "dispinfo": said}})
    return path


def test_ncorr_of_grids_that_do_not_agree(tmp_path):
    path, planar = tmp_path / "a.mat", FrameOptions(planar=True)
    for u, v in (((2, 3), (3, 2)), ((2, 2, 2), (2, 2, 2))):
        said = complaint(read_frames, [ncorr(path, np.ones(u), np.ones(v))], planar)
        assert said == f"{path}: displacements: u and v are {u} and {v}"
    for about, name in (((-1.0, 0.1, "mm"), "spacing"), ((4.0, 1e6, "mm"), "pixtounits")):
        said = complaint(read_frames, [ncorr(path, np.eye(2), np.eye(2), about)], planar)
        assert said == f"{path}: dispinfo.{name}: expected one number, not below zero"


def test_ncorr_takes_what_it_correlated(tmp_path):
    """Places a grid point apart are 5 pixels of 0.1 mm; row 0 is the upper one."""
    path, planar = tmp_path / "a.mat", FrameOptions(planar=True)
    u, v = np.array([[0.0, -0.2], [0.0, 0.0]]), np.array([[0.0, 0.0], [-0.4, 0.0]])
    (frame,) = read_frames([ncorr(path, u, v)], planar)
    np.testing.assert_allclose(frame.points, [[0.5, 0, 0], [0, -0.5, 0]])
    np.testing.assert_allclose(frame.displacement, [[-0.2, 0, 0], [0, 0.4, 0]])
    # Its own coefficient says better where a point did not move.
    right = np.array([[0.0, 0.1], [0.0, 0.1]])
    (frame,) = read_frames([ncorr(path, u, v, coefficient=right)], planar)
    np.testing.assert_allclose(frame.points, [[0.5, 0, 0], [0.5, -0.5, 0]])
    (frame,) = read_frames([ncorr(path, u, v, (0.0, 1.0, "mm"), np.ones((3, 3)))], planar)
    np.testing.assert_allclose(frame.points, [[1, 0, 0], [0, -1, 0]])


def test_istra4d_of_arrays_that_do_not_agree(tmp_path):
    import h5py

    def written(mask: int = 4, dx: int = 4, **left: str) -> Path:
        path = tmp_path / "a.hdf5"
        with h5py.File(path, "w") as file:
            for axis in "xyz":
                file[f"coordinates/coordinate_{axis}"] = np.ones((2, 2))
                file[f"displacements/displacement_{axis}"] = np.ones(dx if axis == "x" else 4)
            if mask:
                file["coordinates/mask"] = np.array([1, 0, 2, 1, 1])[:mask]
            for name in left.values():
                del file[name]
        return path

    for mask in (0, 4):
        (frame,) = read_frames([written(mask)])
        assert len(frame.points) == (3 if mask else 4)
    sizes = "coordinates, displacements and mask are not of one size"
    for path in (written(5), written(0, 3), written(3)):
        assert complaint(read_frames, [path]) == f"{path}: {sizes}"
    for name in ("coordinates/coordinate_x", "displacements/displacement_y"):
        said = complaint(read_frames, [written(name=name)])
        assert "expected coordinates/coordinate_x and so on" in said


def test_variables_in_turn(tmp_path):
    """What is neither a matrix nor packed is passed over; a size is filled up to eight bytes."""
    body = variable(6, [1, 1], part(9, struct.pack("<d", 2.5)))
    path, content = tmp_path / "a.mat", mat(body)
    other = struct.pack("<II", 7, 5) + b"\0" * 8
    named = body.replace(b"X", b"Y")
    path.write_bytes(content + other + part(14, named) + b"\0" * 7)
    assert variable_names(path, content) == ["X", "Y"]
    assert read_variables(path, ["Y"])["Y"].tolist() == [[2.5]]
    path.write_bytes(content[:126] + b"XX" + content[128:])
    assert complaint(read_variables, path, ["X"]) == f"{path}: is not a MAT-file; is it damaged?"


def test_hdf5_members_and_sizes(tmp_path, monkeypatch):
    import h5py

    path = tmp_path / "a.hdf5"
    with h5py.File(path, "w") as file:
        file["group/numbers"] = np.arange(4, dtype="i2")
        file["group/words"] = "text"
        file["empty"] = h5py.Empty("f8")
    with open_hdf5(path) as file:
        assert member(path, file, "group/none") is member(path, file, "group/numbers/x") is None
        numbers = member(path, file, "group/numbers")
        assert array_of(path, numbers, "n").tolist() == [0.0, 1.0, 2.0, 3.0]
        for thing in (file["group"], file["group/words"]):
            said = complaint(array_of, path, thing, "n")
            assert said == f"{path}: n: expected an array of numbers"
        assert complaint(array_of, path, file["empty"], "n").startswith(f"{path}: n: says it holds")
        # Each becomes a number of eight bytes.
        monkeypatch.setattr(hdf5_files, "LARGEST", 32)
        assert len(array_of(path, numbers, "n")) == 4
        monkeypatch.setattr(hdf5_files, "LARGEST", 31)
        said = complaint(array_of, path, numbers, "n")
        assert said == f"{path}: n: says it holds (4,) numbers; is it damaged?"
    path.write_bytes(b"no such thing")
    said = complaint(open_hdf5(path).__enter__)
    assert said.startswith(f"{path}: cannot be read as HDF5; is it damaged? (")


def test_matlab_7_3_by_class_and_by_depth(tmp_path, monkeypatch):
    import h5py

    path = tmp_path / "a.mat"
    with h5py.File(path, "w") as file:

        def write(name: str, data, kind: str, **attributes):
            file[name] = data
            file[name].attrs["MATLAB_class"] = np.bytes_(kind)
            for key, value in attributes.items():
                file[name].attrs[key] = value

        write("grid", np.arange(6.0).reshape(3, 2), "double")
        write("text", np.array([[97], [98], [0]], dtype="u2"), "char")
        write("truth", np.array([[0, 1]], dtype="u1"), "logical")
        write("none", np.zeros(2, dtype="u8"), "double", MATLAB_empty=1)
        write("blank", np.zeros(2, dtype="u8"), "char", MATLAB_empty=1)
        write("object", np.zeros((1, 6), dtype="u4"), "string", MATLAB_object_decode=3)
        references = np.array([[file["grid"].ref, file["text"].ref]], dtype=h5py.ref_dtype)
        write("cells", references, "cell")
        file["inner/a"], file["inner/b"] = np.ones((1, 1)), np.zeros((1, 1))
        deep = file.create_group("deep")
        for _ in range(15):
            deep = deep.create_group("g")
        deep["n"] = np.ones((1, 1))
        # Cells within each other are as deep as structs are.
        inner = file["grid"].ref
        for k in range(17):
            write(f"cell{k}", np.array([[inner]], dtype=h5py.ref_dtype), "cell")
            inner = file[f"cell{k}"].ref
    names = ["grid", "text", "truth", "none", "blank", "object", "cells", "inner", "deep", "x"]
    found = mat_files._variables_73(path, names)
    assert "x" not in found
    assert found["grid"].tolist() == [[0, 2, 4], [1, 3, 5]]
    assert (found["text"], found["blank"], found["object"]) == ("ab", "", None)
    assert found["truth"].dtype == bool and found["truth"].tolist() == [[False], [True]]
    assert found["none"].shape == (0, 0)
    assert found["cells"][0].tolist() == found["grid"].tolist() and found["cells"][1] == "ab"
    assert [sorted(one) for one in found["inner"]] == [["a", "b"]]
    # Sixteen within each other, and no more.
    with h5py.File(path, "a") as file:
        file.move("deep", "top/deep")
    too_many = "has too many parts; is the file damaged?"
    assert len(mat_files._variables_73(path, ["cell15"])["cell15"]) == 1
    assert complaint(mat_files._variables_73, path, ["cell16"]) == f"{path}: cell16: {too_many}"
    assert complaint(mat_files._variables_73, path, ["top"]).endswith(too_many)
    monkeypatch.setattr(mat_files, "MOST_PARTS", 3)
    assert len(mat_files._variables_73(path, ["cells"])["cells"]) == 2
    for most in (2, 1):
        monkeypatch.setattr(mat_files, "MOST_PARTS", most)
        assert complaint(mat_files._variables_73, path, ["cells"]) == f"{path}: cells: {too_many}"


# --- text ---
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
        ("{keys}", "F=FEBLOCK", "line 2: a zone of points as POINT or BLOCK is needed, this is"),
        ("{keys}", "ZONETYPE=FEQUAD", "line 2: a zone of points as POINT or BLOCK is needed"),
        ("= x y z dx", "= x x z dx", "VARIABLES: the variable of x may be one of several"),
        ("x y z", "a b c", "VARIABLES: no places are among them"),
    ],
)
def test_zones_of_tecplot_that_are_none(tmp_path, old, new, words):
    path = tmp_path / "a.dat"
    path.write_text(ZONE.replace(old, new).format(keys="I=2"))
    assert complaint(read_frames, [path]).startswith(f"{path}: {words}")


def test_rows_of_a_zone_are_points_by_its_flags(tmp_path):
    path = tmp_path / "a.dat"
    text = "VARIABLES = x y z dx dy dz {}\nZONE\n1 2 3 4 5 6 0\n7 8 9 10 11 12 1\n"
    for flag, options, first in (
        ("valid", FrameOptions(), 7.0), ("invalid", FrameOptions(), 1.0),
        ("f", FrameOptions(flag_column="f"), 1.0), ("f", FrameOptions(valid_column="f"), 7.0),
    ):  # fmt: skip
        path.write_text(text.format(flag))
        (frame,) = read_frames([path], options)
        assert frame.points[:, 0].tolist() == [first], (flag, options)
        assert frame.dropped == {"flagged as doubtful": 1}
    said = complaint(read_frames, [path], FrameOptions(valid_column="g"))
    assert "the variable of valid 'g' is missing; name one with columns" in said
