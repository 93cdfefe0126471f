"""Variables of MATLAB's files of version 5, with bounds on every count.

They are read here and not by scipy.io, which allocates and loops by what a damaged header says; the
layout is that of MathWorks' "MAT-File Format".
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..reading import content_of
from .mat_matrix import MatrixParts

#: Bytes that one compressed variable may have when it is unpacked: at most, always, and by what it
#: has packed (numbers do not pack a hundredfold).
LARGEST, SMALL, RATIO = 2**30, 2**26, 100
_MATRIX, _COMPRESSED = 14, 15


def names_5(path: Path) -> list[str]:
    """Names of the variables.

    Raises
    ------
    InputError : a damaged file.
    """
    return [name for name, _, _ in _variables(path)]


def variables_5(path: Path, wanted: Collection[str]) -> dict[str, Any]:
    """The variables of these names, those that there are, as `mat_files` says.

    Raises
    ------
    InputError : a damaged file, counts beyond what it can hold.
    """
    found = {}
    for name, order, body in _variables(path, wanted):
        try:
            found[name] = MatrixParts(body, order).matrix(0)
        except (ValueError, struct.error, MemoryError, RecursionError, OverflowError) as error:
            problem = f"cannot be read; is the file damaged? ({str(error)[:100]})"
            raise InputError(path, f"variable {name!r}", problem) from None
    return found


def _variables(
    path: Path, wanted: Collection[str] | None = None
) -> Iterator[tuple[str, str, bytes]]:
    """Name, byte order and content of the variables; without `wanted`, of the names only."""
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
