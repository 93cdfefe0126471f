"""HDF5 files read with suspicion: nothing outside the file, no more numbers than it can hold.

Needs h5py, which is not among bubblefit's own dependencies (`pip install "bubblefit[hdf5]"`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import ends

SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Bytes of one array at most: a frame of a million points has 48 MB.
LARGEST = 2**30
#: Within which a file must be read once.
SECONDS = 60.0


def check_readable(path: Path, read: Callable[[], object], seconds: float = SECONDS) -> None:
    """Try a reading in another process: HDF5 loops or crashes on some damaged files.

    read : what is about to be done, picklable; what it raises is left to the caller's own reading.
    """
    if not ends(read, seconds):
        problem = "cannot be read as HDF5: its library fails on it; is it damaged?"
        raise InputError(path, "", problem)


@contextmanager
def open_hdf5(path: Path) -> Iterator[Any]:
    """Open a file, as an `h5py.File`."""
    try:
        import h5py
    except ImportError:
        problem = (
            "is an HDF5 file, which needs h5py; install it with: pip install 'bubblefit[hdf5]'"
        )
        raise InputError(path, "", problem) from None
    if not path.is_file():
        raise InputError(path, "", "no such file")
    try:
        with h5py.File(path, "r") as file:
            yield file
    except InputError:
        raise
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, MemoryError) as error:
        why = " ".join(str(error).split())[:150]
        raise InputError(path, "", f"cannot be read as HDF5; is it damaged? ({why})") from None


def member(path: Path, group: Any, name: str) -> Any:
    """Return the object below a group by its path; None where there is none."""
    import h5py

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
    import h5py

    if not isinstance(dataset, h5py.Dataset) or dataset.dtype.kind not in "fiub":
        raise InputError(path, name, "expected an array of numbers")
    if dataset.is_virtual or dataset.external:
        raise InputError(path, name, "its numbers are in another file, which is not read")
    if dataset.size is None or dataset.size * max(dataset.dtype.itemsize, 8) > LARGEST:
        raise InputError(path, name, f"says it holds {dataset.shape} numbers; is it damaged?")
    return np.asarray(dataset[()], dtype=float)
