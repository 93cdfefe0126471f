"""What is done to a valid file to make it a hostile one: a few changes, each of a few numbers."""

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from hypothesis import strategies as st

#: Numbers as text that count, measure or index where they stand.
NUMBERS = [
    b"-1", b"0", b"2", b"7", b"999999999999", b"-999999999999", b"1e308", b"-1e308", b"1e999",
    b"nan", b"NaN", b"inf", b"-inf", b"1e-320", b"0x10", b"1_000", b"1,5", b"9" * 400, b"9" * 5000,
    b"1e400000", b"--1", b"+", b"1.2.3", b"", b"true", b'"1"', b"[1]", b"18446744073709551616",
]  # fmt: skip
#: Counts as bytes: 2^31-1, -1, 2^63-1, 10^12, zeros.
BYTES = [
    b"\xff\xff\xff\x7f", b"\xff" * 4, b"\xff" * 8, b"\xff" * 7 + b"\x7f", b"\x7f\xff\xff\xff",
    b"\0\x10\xa5\xd4\xe8\0\0\0", b"\0" * 4, b"\0" * 8, b"\0" * 64, b"\x01\0\0\0",
]  # fmt: skip
PIECES = [
    b"\n", b"\r", b"\r\n", b"\n\n", b"\0", b"\xef\xbb\xbf", b"\xff\xfe", b'"', b"'", b"''", b'"""',
    b",", b";", b"\t", b"=", b"[", b"]", b"[[", b"{", b"}", b"#", b"\xe4\xf6", b"\xe2\x80\xa8",
    b"\x1b[31m", b"%s%n", b"{index}", b"../../x", b"/dev/zero", b"nan", b" " * 80, b"[" * 3000,
    b"a" * 70000, b"1," * 3000, b"=beg=50800 (x)\n", b"=end=\n", b"****\n", b"----\n", b"++++\n",
    b" 9999\n", b" -1", b" -3\n", b"    1PSTEP\n", b"  100C", b"    2C", b"    3C", b"ZONE\n",
    b"VARIABLES = ", b"\x0b", b"\x0c", b"\xc2\x85", b"Load (N)", b"Extension", b"_",
]  # fmt: skip
WORDS = [b"x", b"nan", b"", b"E1", b"true", b"1", b"a.b", b"\xff", b"x" * 300]
#: Whole files: empty ones, and heads with nothing behind them.
WHOLE = [
    b"", b"MATLAB 5.0 MAT-file" + b" " * 107 + b"IM" + b"\x0e\0\0\0\xff\xff\xff\x7f",
    b"PK\x03\x04" + b"\0" * 40, b"\x89HDF\r\n\x1a\n" + b"\0" * 90,
    b"\xff\xfe" + "x;y;dx;dy;dz\n1;2;3;4".encode("utf-16-le"),
]  # fmt: skip
ENCODINGS = ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig", "utf-32", "cp500"]
LINE_ENDS = [b"\r\n", b"\r", b"\n\r", b"\n\n", b"\x0b", b"\0\n"]
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][\w.]*")


class Change(NamedTuple):
    """One change: which, where in the file (0 to 1), how much of it, and what of a list."""

    kind: str
    where: float
    length: int
    choice: int

    def place(self, count: int) -> int:
        return min(round(self.where * count), count - 1)

    def of(self, options: Sequence) -> bytes:
        return options[self.choice % len(options)]


def _cut(content: bytes, change: Change, new: bytes, length: int) -> bytes:
    start = round(change.where * len(content))
    return content[:start] + new + content[start + length :]


def _flip(content: bytes, change: Change) -> bytes:
    if not content:
        return content
    at = change.place(len(content))
    return content[:at] + bytes([content[at] ^ (1 << change.choice % 8)]) + content[at + 1 :]


def _token(pattern: re.Pattern[bytes], options: Sequence[bytes]) -> Callable:
    def change_token(content: bytes, change: Change) -> bytes:
        found = list(pattern.finditer(content[:200000]))
        if not found:
            return content
        one = found[change.place(len(found))]
        return content[: one.start()] + change.of(options) + content[one.end() :]

    return change_token


def _lines(content: bytes, change: Change) -> bytes:
    lines = content.split(b"\n")
    at = change.place(len(lines))
    other = (at + 1 + change.length) % len(lines)
    what = change.choice % 4
    if what == 0:
        lines[at:at] = [lines[at]] * (1 + change.length)
    elif what == 1:
        del lines[at : at + 1 + change.length % 4]
    elif what == 2:
        lines[at], lines[other] = lines[other], lines[at]
    else:
        lines[at] = lines[at] + lines[other]
    return b"\n".join(lines)


KINDS: dict[str, Callable[[bytes, Change], bytes]] = {
    "flip": _flip,
    "cut off": lambda content, change: content[: round(change.where * len(content))],
    "remove": lambda content, change: _cut(content, change, b"", change.length),
    "insert": lambda content, change: _cut(content, change, change.of(PIECES), 0),
    "replace": lambda content, change: _cut(
        content, change, change.of(PIECES), len(change.of(PIECES))
    ),
    "bytes": lambda content, change: _cut(content, change, change.of(BYTES), len(change.of(BYTES))),
    "number": _token(_NUMBER, NUMBERS),
    "word": _token(_WORD, WORDS),
    "lines": _lines,
    "line ends": lambda content, change: content.replace(b"\n", change.of(LINE_ENDS)),
    "whole": lambda content, change: change.of(WHOLE),
    "encoding": lambda content, change: content.decode("latin-1").encode(
        change.of(ENCODINGS), errors="replace"
    ),
}
#: How often each is drawn: what spoils the whole file seldom.
WEIGHED = [*KINDS, "number", "number", "number", "flip", "word", "lines", "bytes"]
CHANGES = st.lists(
    st.builds(
        Change, st.sampled_from(WEIGHED), st.floats(0, 1), st.integers(0, 60), st.integers(0, 1000)
    ),
    min_size=1,
    max_size=4,
)


def mutated(content: bytes, changes: Sequence[Change]) -> bytes:
    for change in changes:
        content = KINDS[change.kind](content, change)
    return content
