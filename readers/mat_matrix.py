"""One variable of MATLAB's files of version 5: its parts in turn, and the value that they make."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

#: Cells and structs within each other.
DEEPEST = 16
_DTYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8"}
_DTYPES |= {12: "i8", 13: "u8", 16: "u1", 17: "u2", 18: "u4"}
_CELL, _STRUCT, _CHARACTERS, _FIRST_NUMBER, _LAST_NUMBER = 1, 2, 4, 6, 15


class MatrixParts:
    """A reader along the parts of one matrix.

    content : from behind the matrix' own tag. order : of the bytes, "<" or ">". Every method takes
    what comes next, and raises ValueError or struct.error where the content is damaged.
    """

    def __init__(self, content: bytes, order: str) -> None:
        self.content, self.order, self.at = content, order, 0

    def name(self) -> str:
        """Of the variable, from the parts before its numbers."""
        self.part()
        self.part()
        return self.part()[1].decode("latin-1")

    def part(self) -> tuple[int, bytes]:
        """Type and content of the next part."""
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
        """The value; its name is passed over."""
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
            return "".join(chr(int(n)) for n in numbers[:4096] if 0 < n < 0x110000)
        if not _FIRST_NUMBER <= kind <= _LAST_NUMBER or numbers.size != count:
            raise ValueError(f"{numbers.size} numbers for a shape of {shape[:8]}")
        value = numbers.reshape(shape, order="F")
        return value != 0 if logical else value

    def numbers(self) -> np.ndarray:
        """The numbers of the next part, flat."""
        kind, body = self.part()
        dtype = np.dtype(self.order + _DTYPES[kind]) if kind in _DTYPES else None
        if dtype is None or len(body) % dtype.itemsize:
            raise ValueError(f"numbers of an unknown kind {kind}")
        return np.frombuffer(body, dtype)

    def several(self, count: int, depth: int) -> list[Any]:
        """The next matrices."""
        if count > (len(self.content) - self.at) // 8:
            raise ValueError(f"{count} parts in {len(self.content)} bytes")
        return [MatrixParts(self.part()[1], self.order).matrix(depth + 1) for _ in range(count)]

    def structs(self, count: int, depth: int) -> list[dict[str, Any]]:
        """The elements of a struct array."""
        (length,) = struct.unpack_from(f"{self.order}i", self.part()[1])
        text = self.part()[1]
        if length < 1 or len(text) % length:
            raise ValueError(f"field names of {length} letters")
        starts = range(0, len(text), length)
        names = [text[i : i + length].split(b"\0")[0].decode("latin-1") for i in starts]
        if not names:
            return []
        values = self.several(count * len(names), depth)
        width = len(names)
        return [
            dict(zip(names, values[i * width : (i + 1) * width], strict=True)) for i in range(count)
        ]
