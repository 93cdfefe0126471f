"""NumPy's .npz archives: arrays of plain numbers, never pickles, no larger than they say."""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

from ..errors import InputError

SIGNATURE = b"PK\x03\x04"
#: Bytes of one array: at most, always, and by what it has packed (numbers do not pack a
#: hundredfold).
LARGEST, SMALL, RATIO = 2**30, 2**26, 100


def array_names(path: Path) -> list[str]:
    """Return names of the arrays; none of what is no archive."""
    try:
        with zipfile.ZipFile(path) as archive:
            return [name[:-4] for name in archive.namelist() if name.endswith(".npy")]
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        return []


def read_arrays(path: Path, wanted: Collection[str]) -> dict[str, np.ndarray]:
    """Read the arrays of these names, those that there are.

    Raises InputError: no such file, no archive, objects instead of numbers, a header that says more
    than the file holds.
    """
    found = {}
    try:
        with zipfile.ZipFile(path) as archive:
            there = {one.filename: one for one in archive.infolist()}
            for name in wanted:
                one = there.get(f"{name}.npy")
                if one is not None:
                    found[name] = _array(path, archive, one, name)
    except FileNotFoundError:
        raise InputError(path, "", "no such file") from None
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise InputError(path, "", f"is not a whole .npz archive ({str(error)[:100]})") from None
    except (ValueError, NotImplementedError, RuntimeError, TypeError, MemoryError) as error:
        why = " ".join(str(error).split())[:100]
        raise InputError(path, "", f"cannot be read; is it damaged? ({why})") from None
    return found


def _array(path: Path, archive: zipfile.ZipFile, one: zipfile.ZipInfo, name: str) -> np.ndarray:
    with archive.open(one) as stream:
        version = npy.read_magic(stream)
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, fortran, dtype = read(stream)
        if dtype.kind not in "fiubU":
            problem = "holds Python objects or records, which are not read: save plain numbers"
            raise InputError(path, f"array {name!r}", problem)
        size = math.prod(shape) * dtype.itemsize
        most = min(LARGEST, one.file_size, max(SMALL, RATIO * one.compress_size))
        if min(shape, default=0) < 0 or size > most:
            problem = f"says {shape} numbers, more than the file holds; is it damaged?"
            raise InputError(path, f"array {name!r}", problem)
        content = stream.read(size)
    if len(content) < size:
        raise InputError(path, f"array {name!r}", "ends early; is the file damaged?")
    return np.frombuffer(content, dtype).reshape(shape, order="F" if fortran else "C")
