"""MATLAB's files: variables as plain data, from version 5 (`mat_version_5`) and 7.3.

A numeric or logical array becomes an array, text a str, a cell array a list, a struct array a list
of dicts; both lists run along the first index first. Objects of MATLAB's classes become None: they
cannot be read without MATLAB.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .hdf5_files import SIGNATURE, check_readable
from .mat_version_5 import names_5, variables_5
from .mat_version_73 import names_73, variables_73


def is_mat(head: bytes) -> bool:
    """Whether a file begins as MATLAB's do, version 5 or 7.3."""
    return head[:7] == b"MATLAB " and len(head) >= 128


def variable_names(path: Path, head: bytes) -> Collection[str] | None:
    """Names of the variables; None where they cannot be told, as of a damaged file."""
    try:
        if head[512:520] == SIGNATURE:
            check_readable(path, lambda: names_73(path))
            return names_73(path)
        return names_5(path)
    except InputError:
        return None


def read_variables(path: Path, wanted: Collection[str]) -> dict[str, Any]:
    """The variables of these names, those that there are.

    Raises
    ------
    InputError : no such file, a damaged one, HDF5 without h5py, counts beyond what it can hold.
    """
    try:
        with path.open("rb") as file:
            head = file.read(520)
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    if not is_mat(head):
        raise InputError(path, "", "is not a MAT-file of version 5 or 7.3; save it as one")
    if head[512:520] == SIGNATURE:
        check_readable(path, lambda: variables_73(path, wanted))
        return variables_73(path, wanted)
    return variables_5(path, wanted)


def numbers_of(path: Path, where: Mapping[str, Any], name: str) -> np.ndarray:
    """An array of numbers among variables or fields.

    Raises
    ------
    InputError : it is missing or holds no numbers.
    """
    value = where.get(name)
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        there = ", ".join(where)[:200]
        problem = f"expected an array of numbers; there are: {there}"
        raise InputError(path, f"variable {name!r}", problem)
    return value.astype(float)
