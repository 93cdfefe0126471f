"""Variables of MATLAB's files, version 5 and 7.3, and members of HDF5 files, read with suspicion.

Arrays, text, cell arrays as lists, struct arrays as lists of dicts, by the first index first;
objects become None. Version 5 is parsed here, after MathWorks' "MAT-File Format": scipy.io 1.17
crashes or hangs on hostile files (tests/readers/test_hostile_frames.py). HDF5 needs h5py, an extra
(`pip install "bubblefit[hdf5]"`); nothing outside the file is read.
"""

import struct
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import Later, content_of, ends, reading

h5py: Any = Later("h5py")

SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Within which a file of HDF5 must be read once.
SECONDS = 60.0
#: Bytes of one array at most, a compressed one's always, and by what it has packed (numbers do
#: not pack a hundredfold).
LARGEST, SMALL, RATIO = 2**30, 2**26, 100
#: Cells and structs within each other; parts of a variable of 7.3, which may refer to each other.
DEEPEST, MOST_PARTS = 16, 10**5
_MATRIX, _COMPRESSED = 14, 15
_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8"}
_DTYPES |= {12: "i8", 13: "u8", 16: "u1", 17: "u2", 18: "u4"}
_CELL, _STRUCT, _CHARACTERS, _FIRST_NUMBER, _LAST_NUMBER = 1, 2, 4, 6, 15


def is_mat(head: bytes) -> bool:
    """Return whether a file begins as MATLAB's do, version 5 or 7.3."""
    return head[:7] == b"MATLAB " and len(head) >= 128


def variable_names(path: Path, head: bytes) -> Collection[str] | None:
    """Return the names of the variables; None of a damaged file."""
    try:
        if head[512:520] == SIGNATURE:
            check_readable(path, partial(_names_73, path))
            return _names_73(path)
        return [name for name, _, _ in _parts_5(path)]
    except InputError:
        return None


def read_variables(path: Path, wanted: Collection[str]) -> dict[str, Any]:
    """Read the variables of these names, those that there are."""
    with reading(path), path.open("rb") as file:
        head = file.read(520)
    if not is_mat(head):
        raise InputError(path, "", "is not a MAT-file of version 5 or 7.3; save it as one")
    if head[512:520] == SIGNATURE:
        check_readable(path, partial(_variables_73, path, wanted))
        return _variables_73(path, wanted)
    found = {}
    for name, order, body in _parts_5(path, wanted):
        try:
            found[name] = MatrixParts(body, order).matrix(0)
        except (ValueError, struct.error, MemoryError, RecursionError, OverflowError) as error:
            problem = f"cannot be read; is the file damaged? ({str(error)[:100]})"
            raise InputError(path, f"variable {name!r}", problem) from None
    return found


def numbers_of(path: Path, where: Mapping[str, Any], name: str) -> np.ndarray:
    """Return an array of numbers among variables or fields."""
    value = where.get(name)
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        problem = f"expected an array of numbers; there are: {', '.join(where)[:200]}"
        raise InputError(path, f"variable {name!r}", problem)
    return value.astype(float)


def _parts_5(path: Path, wanted: Collection[str] | None = None) -> Iterator[tuple[str, str, bytes]]:
    """Yield name, byte order and content of the variables, the latter whole where `wanted`."""
    try:
        content = content_of(path)
        order = {b"IM": "<", b"MI": ">"}[content[126:128]]
    except (OSError, KeyError):
        raise InputError(path, "", "is not a MAT-file; is it damaged?") from None
    at = 128
    while at + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}II", content, at)
        body = content[at + 8 : at + 8 + size]
        at += 8 + size + (0 if kind == _COMPRESSED else -size % 8)
        if len(body) < size:
            raise InputError(path, "", "ends within a variable; is it damaged?")
        try:
            if kind == _COMPRESSED:
                first = zlib.decompressobj().decompress(body, 4096)
                name = MatrixParts(first[8:], order).name()
                if wanted is not None and name in wanted:
                    whole = zlib.decompressobj()
                    first = whole.decompress(body, min(LARGEST, max(SMALL, RATIO * size)))
                    if whole.unconsumed_tail:
                        raise ValueError(f"{len(first)} bytes and more of {size}")
                yield name, order, first[8:]
            elif kind == _MATRIX:
                name = MatrixParts(body, order).name()
                yield name, order, body
        except (ValueError, struct.error, zlib.error) as error:
            problem = f"holds a variable that cannot be read; is it damaged? ({str(error)[:100]})"
            raise InputError(path, "", problem) from None


class MatrixParts:
    """Read the parts of one matrix in turn; ValueError or struct.error where it is damaged."""

    def __init__(self, content: bytes, order: str) -> None:
        self.content, self.order, self.at = content, order, 0

    def name(self) -> str:
        """Return the variable's name, from the parts before its numbers."""
        self.part()
        self.part()
        return self.part()[1].decode("latin-1")

    def part(self) -> tuple[int, bytes]:
        """Return type and content of the next part."""
        kind, size = struct.unpack_from(f"{self.order}II", self.content, self.at)
        if kind >> 16:
            size, kind, start, step = kind >> 16, kind & 0xFFFF, self.at + 4, 8
        else:
            start, step = self.at + 8, 8 + size + -size % 8
        body = self.content[start : start + size]
        if len(body) < size:
            raise ValueError("a part is longer than the variable")
        self.at += step
        return kind, body

    def matrix(self, depth: int) -> Any:
        """Return the value; its name is passed over."""
        if depth > DEEPEST:
            raise ValueError("nested too deeply")
        if not self.content:
            return np.zeros((0, 0))
        flags = struct.unpack_from(f"{self.order}I", self.part()[1])[0]
        kind, logical = flags & 0xFF, bool(flags & 0x200)
        if kind > _LAST_NUMBER or kind in (3, 5):
            return None
        shape = [int(n) for n in np.frombuffer(self.part()[1], f"{self.order}i4")]
        count = int(np.prod(shape, dtype=object))
        if len(shape) < 2 or min(shape) < 0:
            raise ValueError(f"no shape: {shape[:8]}")
        self.part()
        if kind == _CELL:
            return self.several(count, depth)
        if kind == _STRUCT:
            return self.structs(count, depth)
        numbers = self.numbers()
        if kind == _CHARACTERS:
            return _text(numbers)
        if not _FIRST_NUMBER <= kind <= _LAST_NUMBER or numbers.size != count:
            raise ValueError(f"{numbers.size} numbers for a shape of {shape[:8]}")
        value = numbers.reshape(shape, order="F")
        return value != 0 if logical else value

    def numbers(self) -> np.ndarray:
        """Return the numbers of the next part, flat."""
        kind, body = self.part()
        dtype = np.dtype(self.order + _DTYPES[kind]) if kind in _DTYPES else None
        if dtype is None or len(body) % dtype.itemsize:
            raise ValueError(f"numbers of an unknown kind {kind}")
        return np.frombuffer(body, dtype)

    def several(self, count: int, depth: int) -> list[Any]:
        """Return the next matrices."""
        if count > (len(self.content) - self.at) // 8:
            raise ValueError(f"{count} parts in {len(self.content)} bytes")
        return [MatrixParts(self.part()[1], self.order).matrix(depth + 1) for _ in range(count)]

    def structs(self, count: int, depth: int) -> list[dict[str, Any]]:
        """Return the elements of a struct array."""
        (length,) = struct.unpack_from(f"{self.order}i", self.part()[1])
        text = self.part()[1]
        if length < 1 or len(text) % length:
            raise ValueError(f"field names of {length} letters")
        starts = range(0, len(text), length)
        names = [text[i : i + length].split(b"\0")[0].decode("latin-1") for i in starts]
        if not names:
            return []
        values = iter(self.several(count * len(names), depth))
        return [{name: next(values) for name in names} for _ in range(count)]


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
            isinstance(field, h5py.Dataset) and field.dtype == h5py.ref_dtype
            and "MATLAB_class" not in field.attrs for field in fields.values()
        ]  # fmt: skip
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
    """Try a reading, picklable, in another process: HDF5 loops or crashes on some damaged files."""
    if not ends(read, SECONDS):
        problem = "cannot be read as HDF5: its library fails on it; is it damaged?"
        raise InputError(path, "", problem)


@contextmanager
def open_hdf5(path: Path) -> Iterator[Any]:
    """Open a file, as an `h5py.File`."""
    if not path.is_file():
        raise InputError(path, "", "no such file")
    try:
        with h5py.File(path, "r") as file:
            yield file
    except ImportError:
        install = "install it with: pip install 'bubblefit[hdf5]'"
        raise InputError(path, "", f"is an HDF5 file, which needs h5py; {install}") from None
    except InputError:
        raise
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, MemoryError) as error:
        why = " ".join(str(error).split())[:150]
        raise InputError(path, "", f"cannot be read as HDF5; is it damaged? ({why})") from None


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
