"""CalculiX result files: text and binary, all digits, and nothing partial taken for whole."""

import struct
from pathlib import Path

import meshio
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.solvers.calculix.frd import FrdFile

from ...support.refusals import complaint

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]], float)
QUADS = [(1, 2, 3, 4), (2, 5, 6, 3)]


def frames(count):
    random = np.random.default_rng(3)
    return [
        (float(i + 1), random.normal(size=(6, 3)), random.normal(size=(6, 8))) for i in range(count)
    ]


def write(path, given, flag, end=True, skip=()):
    out = bytearray(b"    1C\n    1UUSER\n")

    def rows(values):
        for n, row in enumerate(values, 1):
            if flag == 1:
                for first in range(0, len(row), 6):
                    head = f" -1{n:10d}" if first == 0 else " -2" + 10 * " "
                    out.extend(
                        (head + "".join(f"{v:12.5E}" for v in row[first : first + 6])).encode()
                    )
                    out.extend(b"\n")
            else:
                out.extend(struct.pack(f"<i{len(row)}{'f' if flag == 2 else 'd'}", n, *row))
        if flag == 1:
            out.extend(b" -3\n")

    binary = flag > 1
    place = 3 if binary else 1
    out.extend(f"    2C{'':18}{6:12d}{place:38d}\n".encode())
    flag, results = place, flag
    rows(POINTS)
    out.extend(f"    3C{'':18}{2:12d}{place:38d}\n".encode())
    for n, quad in enumerate(QUADS, 1):
        if binary:
            out.extend(struct.pack("<8i", n, 9, 0, 1, *quad))
        else:
            out.extend(f" -1{n:10d}{9:5d}{0:5d}{1:5d}\n -2".encode())
            out.extend("".join(f"{i:10d}" for i in quad).encode() + b"\n")
    if not binary:
        out.extend(b" -3\n")
    flag = results
    for step, (time, *fields) in enumerate(given, 1):
        if step in skip:
            continue
        for name, values in zip(("DISP", "SDV"), fields, strict=True):
            out.extend(f"    1PSTEP{'':14}{step:12d}{7:12d}{step:12d}\n".encode())
            head = f"  100CL{step + 100:5d}{time:12.9f}{len(values):12d}{'':20}{0:2d}{step:5d}"
            out.extend(f"{head:73}{flag:2d}\n".encode())
            extra = name == "DISP"
            out.extend(f" -4  {name:8}{values.shape[1] + extra:5d}{1:5d}\n".encode())
            for k in range(values.shape[1]):
                out.extend(f" -5  D{k + 1:<7}{1:5d}{2:5d}{k + 1:5d}{0:5d}\n".encode())
            if extra:
                out.extend(f" -5  ALL     {1:5d}{2:5d}{0:5d}{0:5d}{1:5d}ALL\n".encode())
            rows(values)
    if end:
        out.extend(b" 9999\n")
    Path(path).write_bytes(out)
    return path


@pytest.mark.parametrize(("flag", "digits"), [(1, 5e-6), (2, 1e-7), (3, 0)])
def test_every_field_of_every_increment(tmp_path, flag, digits):
    given = frames(3)
    file = FrdFile(write(tmp_path / "job.frd", given, flag))
    np.testing.assert_array_equal(file.mesh.points, POINTS)
    assert [(kind, tuple(nodes)) for kind, nodes in file.mesh.elements] == [(9, q) for q in QUADS]
    for _ in range(2):  # frames can be read again
        found = list(file.frames())
        assert [(f.time, f.step, f.increment) for f in found] == [(1, 1, 7), (2, 2, 7), (3, 3, 7)]
        for frame, (_, u, state) in zip(found, given, strict=True):
            np.testing.assert_allclose(frame.fields["DISP"], u, rtol=digits)
            np.testing.assert_allclose(frame.fields["SDV"], state, rtol=digits)


@pytest.mark.parametrize("flag", [1, 3])
def test_a_file_cut_anywhere_is_refused(tmp_path, flag):
    whole = write(tmp_path / "whole.frd", frames(2), flag).read_bytes()
    assert len(list(FrdFile(tmp_path / "whole.frd").frames())) == 2
    part = tmp_path / "part.frd"
    # A prime stride meets every kind of place; the end mark byte by byte.
    for size in (*range(0, len(whole), 17), *range(len(whole) - 12, len(whole))):
        part.write_bytes(whole[:size])
        assert "part.frd" in complaint(lambda: list(FrdFile(part).frames()))


@pytest.mark.parametrize("flag", [1, 3])
def test_damage_is_an_input_error_or_leaves_finite_numbers(tmp_path, flag):
    whole = write(tmp_path / "whole.frd", frames(2), flag).read_bytes()
    random, part, refused = np.random.default_rng(1), tmp_path / "part.frd", 0
    for _ in range(400):
        bad = bytearray(whole)
        bad[random.integers(len(bad))] = random.integers(256)
        part.write_bytes(bad)
        try:
            for frame in FrdFile(part).frames():
                assert all(np.isfinite(v).all() for v in frame.fields.values())
        except InputError:
            refused += 1
    # A changed digit is a number like any other.
    assert refused > 20


def test_what_is_no_result_file_is_said_to_be_none(tmp_path):
    for content in (b"", b"garbage\n", bytes(100)):
        (tmp_path / "job.frd").write_bytes(content)
        assert "not a CalculiX result file" in complaint(FrdFile, tmp_path / "job.frd")
    assert "No such file" in complaint(FrdFile, tmp_path / "none.frd")
    # Missing steps are no error.
    found = FrdFile(write(tmp_path / "job.frd", frames(4), 3, skip=(2,))).frames()
    assert [f.step for f in found] == [1, 3, 4]
    given = frames(1)
    given[0][1][2, 1] = np.nan
    for flag in (1, 3):
        with pytest.raises(InputError, match="finite"):
            list(FrdFile(write(tmp_path / "job.frd", given, flag)).frames())


def test_meshio_reads_it(tmp_path):
    given = frames(3)
    mesh = meshio.read(write(tmp_path / "job.frd", given, 3))
    (cells,) = mesh.cells
    assert (cells.type, cells.data.tolist()) == ("quad", [[0, 1, 2, 3], [1, 4, 5, 2]])
    np.testing.assert_array_equal(mesh.point_data["DISP"], given[2][1])
    assert mesh.field_data["time"] == [3.0]
    # Through to another format and back.
    meshio.write(tmp_path / "job.vtu", mesh)
    np.testing.assert_array_equal(meshio.read(tmp_path / "job.vtu").point_data["DISP"], given[2][1])
    with pytest.raises(InputError, match="truncated"):
        meshio.read(write(tmp_path / "job.frd", frames(1), 3, end=False))
