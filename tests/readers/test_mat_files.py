"""Variables of MAT-files part by part, and the limits of what a damaged one may say."""

import struct
from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.mat_files import (
    is_mat,
    numbers_of,
    read_variables,
    variable_names,
)

from ..complaints import complaint
from .test_hostile_frames import doubles, mat, part, value, variable


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
