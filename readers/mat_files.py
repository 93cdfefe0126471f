"""Read variables of MATLAB files (version 5 and 7.3) and members of HDF5 files, safely.

Arrays and text are read as such, cell arrays as lists and struct arrays as lists of dicts, with
the first index fastest; objects become None. As scipy.io and HDF5 crash or hang on some damaged
files, a file is read in a process of its own first. HDF5 needs h5py, an extra
(`pip install "bubblefit[hdf5]"`). Nothing outside the file is read.
"""

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ..errors import InputError
from ..lazy_modules import LazyModule
from ..processes import ends_within
from ..storage.reading import input_errors

h5py: Any = LazyModule("h5py")

SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Time in s within which a file must have been read.
SECONDS = 60.0
#: Largest size of one array, bytes.
LARGEST = 2**30
#: Size in bytes up to which a compressed array is always read.
SMALL = 2**26
#: Largest size of a compressed array over that of the file; numbers are not compressed as much.
RATIO = 100
#: Largest depth of cells and structs within each other.
MAX_DEPTH = 16
#: Largest number of parts of a variable of version 7.3, which may refer to each other.
MAX_PARTS = 10**5


def is_mat(head: bytes) -> bool:
    """Return whether a file begins as MATLAB's do, version 5 or 7.3."""
    return head[:7] == b"MATLAB " and len(head) >= 128


def variable_names(path: Path, head: bytes) -> Collection[str] | None:
    """Return the names of the variables; None of a damaged file."""
    names = _names_73 if head[512:520] == SIGNATURE else _names_5
    try:
        check_readable(path, partial(names, path))
        return names(path)
    except InputError:
        return None


def read_variables(path: Path, names: Collection[str]) -> dict[str, Any]:
    """Read the variables of these names that the file has."""
    with input_errors(path), path.open("rb") as file:
        head = file.read(520)
    if not is_mat(head):
        raise InputError(path, "", "is not a MAT-file of version 5 or 7.3; save it as one")
    read = _variables_73 if head[512:520] == SIGNATURE else _variables_5
    check_readable(path, partial(read, path, names))
    return read(path, names)


def numbers_of(path: Path, fields: Mapping[str, Any], name: str) -> np.ndarray:
    """Return an array of numbers among variables or fields."""
    value = fields.get(name)
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        problem = f"expected an array of numbers; there are: {', '.join(fields)[:200]}"
        raise InputError(path, f"variable {name!r}", problem)
    return value.astype(float)


@contextmanager
def library_errors(path: Path, kind: str) -> Iterator[None]:
    """Turn the errors, of any class, of a library that reads files of a kind into an InputError."""
    try:
        yield
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(path, "", "no such file") from None
    except Exception as error:
        reason = " ".join(str(error).split())[:150]
        problem = f"cannot be read as {kind}; is it damaged? ({reason})"
        raise InputError(path, "", problem) from None


def _names_5(path: Path) -> list[str]:
    """Return the names of the variables of a MAT-file before version 7.3."""
    with library_errors(path, "a MAT-file"):
        return [str(name) for name, _, _ in scipy.io.whosmat(path, appendmat=False)]


def _variables_5(path: Path, names: Collection[str]) -> dict[str, Any]:
    """Return variables of a MAT-file before version 7.3; InputError for too large sizes."""
    with library_errors(path, "a MAT-file"):
        max_size = min(LARGEST, max(SMALL, RATIO * path.stat().st_size))
        for name, shape, _ in scipy.io.whosmat(path, appendmat=False):
            if name in names and 8 * math.prod(shape) > max_size:
                problem = f"says {shape} numbers, more than the file holds; is it damaged?"
                raise InputError(path, f"variable {name!r}", problem)
        variables = scipy.io.loadmat(path, variable_names=[*names], appendmat=False)
        return {name: _value_5(variables[name], 0) for name in names if name in variables}


def _value_5(value: Any, depth: int) -> Any:
    """Return the value of a variable that scipy.io has read."""
    matlab = scipy.io.matlab
    if not isinstance(value, np.ndarray) or depth > MAX_DEPTH:
        return None
    if isinstance(value, (matlab.MatlabObject, matlab.MatlabFunction, matlab.MatlabOpaque)):
        return None
    flat = value.ravel(order="F")
    names = value.dtype.names
    if names:
        return [{name: _value_5(element[name], depth + 1) for name in names} for element in flat]
    if value.dtype == object:
        return [_value_5(element, depth + 1) for element in flat]
    return "".join(flat) if value.dtype.kind == "U" else value


def _names_73(path: Path) -> list[str]:
    """Return the names of the variables of a MAT-file of version 7.3."""
    with open_hdf5(path) as file:
        return [str(name) for name in file]


def _variables_73(path: Path, names: Collection[str]) -> dict[str, Any]:
    """Return variables of a MAT-file of version 7.3, which is one of HDF5."""
    with open_hdf5(path) as file:
        # Shared by all calls: it ends files whose parts refer to each other.
        parts_left = iter(range(MAX_PARTS))
        items = {name: member(path, file, name) for name in names}
        return {
            name: _value_73(path, item, name, 0, parts_left)
            for name, item in items.items()
            if item is not None
        }


def _value_73(
    path: Path,
    item: Any,
    name: str,
    depth: int,
    parts_left: Iterator[int],
) -> Any:
    """Return the value of a variable of version 7.3; `parts_left` ends what has too many."""
    if depth > MAX_DEPTH or next(parts_left, None) is None:
        raise InputError(path, name, "has too many parts; is the file damaged?")
    if isinstance(item, h5py.Group):
        return _struct_73(path, item, name, depth, parts_left)
    if item.dtype == h5py.ref_dtype:
        return _cells_73(path, item, name, depth, parts_left)
    if item.dtype.kind not in "fiub" or "MATLAB_object_decode" in item.attrs:
        return None
    matlab_class = item.attrs.get("MATLAB_class", b"")
    is_bytes = isinstance(matlab_class, bytes)
    matlab_class = matlab_class.decode("latin-1") if is_bytes else str(matlab_class)
    if "MATLAB_empty" in item.attrs:
        return "" if matlab_class == "char" else np.zeros((0, 0))
    value = array_of(path, item, name).T
    if matlab_class == "char":
        return _text(value.ravel(order="F"))
    return value != 0 if matlab_class == "logical" else value


def _struct_73(
    path: Path,
    group: Any,
    name: str,
    depth: int,
    parts_left: Iterator[int],
) -> list[dict[str, Any]]:
    """Return the elements of a struct array, each with its fields."""
    fields = {key: member(path, group, key) for key in group}
    values = {
        key: _value_73(path, field, f"{name}.{key}"[-200:], depth + 1, parts_left)
        for key, field in fields.items()
    }
    if not values or not all(map(_is_list_of_elements, fields.values())):
        return [values]
    count = min(len(value) for value in values.values())
    return [{key: value[i] for key, value in values.items()} for i in range(count)]


def _is_list_of_elements(field: Any) -> bool:
    """Return whether a field holds a reference for each element of a struct array."""
    if not isinstance(field, h5py.Dataset) or field.dtype != h5py.ref_dtype:
        return False
    return "MATLAB_class" not in field.attrs


def _cells_73(
    path: Path,
    item: Any,
    name: str,
    depth: int,
    parts_left: Iterator[int],
) -> list[Any]:
    """Return the values of a cell array."""
    if item.size > MAX_PARTS:
        raise InputError(path, name, "has too many parts; is the file damaged?")
    references = np.asarray(item[()]).T.ravel(order="F")
    return [
        _value_73(path, item.file[reference], name, depth + 1, parts_left) if reference else None
        for reference in references
    ]


def _text(numbers: np.ndarray) -> str:
    """Return an array of codes of characters as text, cut where it is very long."""
    return "".join(chr(int(n)) for n in numbers[:4096] if 0 < n < 0x110000)


def check_readable(path: Path, read: Callable[[], object]) -> None:
    """Check a reading, picklable, in another process: libraries crash on some damaged files."""
    if not ends_within(SECONDS, read):
        problem = "cannot be read: the library for such files fails on it; is it damaged?"
        raise InputError(path, "", problem)


@contextmanager
def open_hdf5(path: Path) -> Iterator[Any]:
    """Open a file, as an `h5py.File`."""
    if not path.is_file():
        raise InputError(path, "", "no such file")
    with library_errors(path, "HDF5"):
        try:
            opened = h5py.File(path, "r")
        except ImportError:
            install = "install it with: pip install 'bubblefit[hdf5]'"
            raise InputError(path, "", f"is an HDF5 file, which needs h5py; {install}") from None
        with opened as file:
            yield file


def member(path: Path, group: Any, name: str) -> Any:
    """Return the object below a group by its path; None where there is none."""
    item = group
    for part in name.split("/"):
        if not isinstance(item, h5py.Group) or part not in item:
            return None
        if isinstance(item.get(part, getlink=True), h5py.ExternalLink):
            raise InputError(path, name, "is a link to another file, which is not followed")
        item = item[part]
    return item


def array_of(path: Path, dataset: Any, name: str) -> NDArray[np.float64]:
    """Read a dataset's numbers, which must lie in this file."""
    if not isinstance(dataset, h5py.Dataset) or dataset.dtype.kind not in "fiub":
        raise InputError(path, name, "expected an array of numbers")
    if dataset.is_virtual or dataset.external:
        raise InputError(path, name, "its numbers are in another file, which is not read")
    if dataset.size is None or dataset.size * max(dataset.dtype.itemsize, 8) > LARGEST:
        raise InputError(path, name, f"says it holds {dataset.shape} numbers; is it damaged?")
    return np.asarray(dataset[()], dtype=float)
