"""Variables of MAT-files part by part, and the limits of what a damaged one may say."""

import struct
from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.mat_files import (
    MatrixParts,
    is_mat,
    numbers_of,
    read_variables,
    variable_names,
)

from ..complaints import complaint
from .test_hostile_frames import mat, part, variable


def value(kind: int, shape: list[int], rest: bytes, order: str = "<"):
    return MatrixParts(variable(kind, shape, rest), order).matrix(0)


def doubles(*numbers: float) -> bytes:
    return part(9, struct.pack(f"<{len(numbers)}d", *numbers))


@pytest.mark.parametrize("kind", [6, 7, 15])
def test_numbers_run_along_the_first_index_first(kind: int):
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


def test_empty_cells_fill_a_variable_to_its_last_byte():
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
    assert complaint(read_variables, path, ["X"]) == (
        f"{path}: ends within a variable; is it damaged?"
    )
    path.write_bytes(b"MATLAB 4".ljust(140))
    assert complaint(read_variables, path, ["X"]) == (f"{path}: is not a MAT-file; is it damaged?")
    path.write_bytes(b"x" * 200)
    assert complaint(read_variables, path, ["X"]) == (
        f"{path}: is not a MAT-file of version 5 or 7.3; save it as one"
    )
    path.unlink()
    assert complaint(read_variables, path, ["X"]).endswith(
        "cannot be read: No such file or directory"
    )


def test_numbers_among_other_things():
    where = {"a": np.array([[True, False]]), "b": "text", "c": np.array(["x"])}
    assert numbers_of(Path("a.mat"), where, "a").tolist() == [[1.0, 0.0]]
    for name in "bcd":
        assert complaint(numbers_of, Path("a.mat"), where, name) == (
            f"a.mat: variable '{name}': expected an array of numbers; there are: a, b, c"
        )
