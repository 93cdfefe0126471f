"""Variables of MATLAB's files, version 5 and 7.3, and members of HDF5 files, read with suspicion.

Arrays, text, cell arrays as lists, struct arrays as lists of dicts, by the first index first;
objects become None. scipy.io and HDF5 crash or hang on some damaged files: both are tried in a
process of their own first. HDF5 needs h5py, an extra (`pip install "bubblefit[hdf5]"`); nothing
outside the file is read.
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
from ..files import Later, ends, reading

h5py: Any = Later("h5py")

SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Within which a file must be read once.
SECONDS = 60.0
#: Bytes of one array at most, a compressed one's always, and by what it has packed (numbers do
#: not pack a hundredfold).
LARGEST, SMALL, RATIO = 2**30, 2**26, 100
#: Cells and structs within each other; parts of a variable of 7.3, which may refer to each other.
DEEPEST, MOST_PARTS = 16, 10**5


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


def read_variables(path: Path, wanted: Collection[str]) -> dict[str, Any]:
    """Read the variables of these names, those that there are."""
    with reading(path), path.open("rb") as file:
        head = file.read(520)
    if not is_mat(head):
        raise InputError(path, "", "is not a MAT-file of version 5 or 7.3; save it as one")
    read = _variables_73 if head[512:520] == SIGNATURE else _variables_5
    check_readable(path, partial(read, path, wanted))
    return read(path, wanted)


def numbers_of(path: Path, where: Mapping[str, Any], name: str) -> np.ndarray:
    """Return an array of numbers among variables or fields."""
    value = where.get(name)
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        problem = f"expected an array of numbers; there are: {', '.join(where)[:200]}"
        raise InputError(path, f"variable {name!r}", problem)
    return value.astype(float)


@contextmanager
def library_errors(path: Path, what: str) -> Iterator[None]:
    """Turn the errors of a library that reads `what`, of any class, into an InputError."""
    try:
        yield
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(path, "", "no such file") from None
    except Exception as error:
        why = " ".join(str(error).split())[:150]
        problem = f"cannot be read as {what}; is it damaged? ({why})"
        raise InputError(path, "", problem) from None


def _names_5(path: Path) -> list[str]:
    with library_errors(path, "a MAT-file"):
        return [str(name) for name, _, _ in scipy.io.whosmat(path, appendmat=False)]


def _variables_5(path: Path, wanted: Collection[str]) -> dict[str, Any]:
    with library_errors(path, "a MAT-file"):
        most = min(LARGEST, max(SMALL, RATIO * path.stat().st_size))
        for name, shape, _ in scipy.io.whosmat(path, appendmat=False):
            if name in wanted and 8 * math.prod(shape) > most:
                problem = f"says {shape} numbers, more than the file holds; is it damaged?"
                raise InputError(path, f"variable {name!r}", problem)
        found = scipy.io.loadmat(path, variable_names=[*wanted], appendmat=False)
        return {name: _plain(found[name], 0) for name in wanted if name in found}


def _plain(value: Any, depth: int) -> Any:
    """Return the value of a variable that scipy.io has read."""
    own = scipy.io.matlab
    if not isinstance(value, np.ndarray) or depth > DEEPEST:
        return None
    if isinstance(value, (own.MatlabObject, own.MatlabFunction, own.MatlabOpaque)):
        return None
    flat = value.ravel(order="F")
    names = value.dtype.names
    if names:
        return [{name: _plain(one[name], depth + 1) for name in names} for one in flat]
    if value.dtype == object:
        return [_plain(one, depth + 1) for one in flat]
    return "".join(flat) if value.dtype.kind == "U" else value


def _names_73(path: Path) -> list[str]:
    with open_hdf5(path) as file:
        return [str(name) for name in file]


def _variables_73(path: Path, wanted: Collection[str]) -> dict[str, Any]:
    with open_hdf5(path) as file:
        parts = iter(range(MOST_PARTS))
        there = {name: member(path, file, name) for name in wanted}
        found = {name: item for name, item in there.items() if item is not None}
        return {name: _of_hdf5(path, item, name, 0, parts) for name, item in found.items()}


def _of_hdf5(path: Path, item: Any, name: str, depth: int, parts: Iterator[int]) -> Any:
    """Return the value of a variable of version 7.3; `parts` runs out when too many are read."""
    if depth > DEEPEST or next(parts, None) is None:
        raise InputError(path, name, "has too many parts; is the file damaged?")
    if isinstance(item, h5py.Group):
        fields = {key: member(path, item, key) for key in item}
        values = {
            key: _of_hdf5(path, field, f"{name}.{key}"[-200:], depth + 1, parts)
            for key, field in fields.items()
        }
        # The elements of a struct array: each field is a list of references.
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
        return _text(value.ravel(order="F"))
    return value != 0 if kind == "logical" else value


def _text(numbers: np.ndarray) -> str:
    return "".join(chr(int(n)) for n in numbers[:4096] if 0 < n < 0x110000)


def check_readable(path: Path, read: Callable[[], object]) -> None:
    """Check a reading, picklable, in another process: libraries crash on some damaged files."""
    if not ends(read, SECONDS):
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
    here = group
    for part in name.split("/"):
        if not isinstance(here, h5py.Group) or part not in here:
            return None
        if isinstance(here.get(part, getlink=True), h5py.ExternalLink):
            raise InputError(path, name, "is a link to another file, which is not followed")
        here = here[part]
    return here


def array_of(path: Path, dataset: Any, name: str) -> NDArray[np.float64]:
    """Read a dataset's numbers, which must lie in this file."""
    if not isinstance(dataset, h5py.Dataset) or dataset.dtype.kind not in "fiub":
        raise InputError(path, name, "expected an array of numbers")
    if dataset.is_virtual or dataset.external:
        raise InputError(path, name, "its numbers are in another file, which is not read")
    if dataset.size is None or dataset.size * max(dataset.dtype.itemsize, 8) > LARGEST:
        raise InputError(path, name, f"says it holds {dataset.shape} numbers; is it damaged?")
    return np.asarray(dataset[()], dtype=float)
