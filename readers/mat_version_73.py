"""Variables of MATLAB's files of version 7.3, which are HDF5."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from .hdf5_files import array_of, member, open_hdf5

#: Cells and structs within each other; parts of a variable, which may refer to each other.
DEEPEST, MOST_PARTS = 16, 10**5


def names_73(path: Path) -> list[str]:
    """Names of the variables.

    Raises
    ------
    InputError : a damaged file; HDF5 without h5py.
    """
    with open_hdf5(path) as file:
        return [str(name) for name in file]


def variables_73(path: Path, wanted: Collection[str]) -> dict[str, Any]:
    """The variables of these names, those that there are, as `mat_files` says.

    Raises
    ------
    InputError : a damaged file, counts beyond what it can hold; HDF5 without h5py.
    """
    with open_hdf5(path) as file:
        parts = iter(range(MOST_PARTS))
        there = {name: member(path, file, name) for name in wanted}
        return {
            name: _of_hdf5(path, item, name, 0, parts)
            for name, item in there.items()
            if item is not None
        }


def _of_hdf5(path: Path, item: Any, name: str, depth: int, parts: Iterator[int]) -> Any:
    """The value of a variable of version 7.3.

    parts : runs out when too many have been read.
    """
    import h5py

    if depth > DEEPEST or next(parts, None) is None:
        raise InputError(path, name, "has too many parts; is the file damaged?")
    if isinstance(item, h5py.Group):
        fields = {key: member(path, item, key) for key in item}
        values = {
            key: _of_hdf5(path, field, f"{name}.{key}"[-200:], depth + 1, parts)
            for key, field in fields.items()
        }
        return _structs(values, fields)
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode("latin-1") if isinstance(kind, bytes) else str(kind)
    if item.dtype == h5py.ref_dtype:
        if item.size > MOST_PARTS:
            raise InputError(path, name, "has too many parts; is the file damaged?")
        references = np.asarray(item[()]).T.ravel(order="F")
        return [
            _of_hdf5(path, item.file[one], name, depth + 1, parts) if one else None
            for one in references
        ]
    if item.dtype.kind not in "fiub" or "MATLAB_object_decode" in item.attrs:
        return None
    if "MATLAB_empty" in item.attrs:
        return "" if kind == "char" else np.zeros((0, 0))
    value = array_of(path, item, name).T
    if kind == "char":
        return "".join(chr(int(n)) for n in value.ravel(order="F")[:4096] if 0 < n < 0x110000)
    return value != 0 if kind == "logical" else value


def _structs(values: dict[str, Any], fields: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The elements of a struct array: every field a list of references, and no cell array."""
    import h5py

    listed = [
        isinstance(field, h5py.Dataset)
        and field.dtype == h5py.ref_dtype
        and "MATLAB_class" not in field.attrs
        for field in fields.values()
    ]
    if not (values and all(listed)):
        return [values]
    count = min(len(value) for value in values.values())
    return [{key: value[i] for key, value in values.items()} for i in range(count)]
