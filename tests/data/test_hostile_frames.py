"""Damaged and hostile exports of image correlation: refused in one line, at once, never run."""

from __future__ import annotations

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
from bubblefit.readers.fields import read_fields
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.hdf5_files import check_readable
from bubblefit.readers.mat_files import read_variables
from hypothesis import example, given, settings
from hypothesis import strategies as st

from .. import dic_exports
from ..complaints import complaint
from ..dic_exports import EXPORTS

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

    def __init__(self, path: Path) -> None:
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


def test_a_struct_without_fields_does_not_loop(tmp_path):
    path = tmp_path / "a.mat"
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


def assert_same(read, value) -> None:
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


# --- plain tables in any dialect -----------------------------------------------------------------

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
