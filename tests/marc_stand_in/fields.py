"""Lines of an extended-format deck, cut into their columns."""

from __future__ import annotations

import re
from pathlib import Path

INTEGER, REAL, NAME = 10, 20, 32
LONGEST = 160
#: Exit number for an error in the data (public lists of Marc's exit numbers: 13, input errors).
DATA_ERROR = 13

_INTEGER = re.compile(r" *[+-]?\d+\Z")
# Fortran takes an exponent without its letter: 1.000000000000000-3.
_REAL = re.compile(r" *([+-]?(?:\d+\.\d*|\.\d+))(?:[EeDd]([+-]?\d+)|([+-]\d+))?\Z")
_NAME = re.compile(r"[a-z0-9_]{1,32}\Z")


class DeckError(Exception):
    """Marc would not run this deck."""

    def __init__(self, problem: str, line: int = 0, number: int = DATA_ERROR) -> None:
        self.problem, self.line, self.number = problem, line, number
        super().__init__(f"{problem} (line {line})" if line else problem)


class Line:
    """One line, sliced by columns."""

    def __init__(self, number: int, text: str) -> None:
        self.number, self.text = number, text

    def fail(self, problem: str) -> DeckError:
        return DeckError(problem, self.number)

    @property
    def keyword(self) -> str:
        """Columns 1 to 20."""
        return self.text[:20].rstrip()

    @property
    def blank(self) -> bool:
        return not self.text.strip()

    def integer(self, end: int) -> int:
        """The i10 that ends in column `end`; an empty field is 0, as in Fortran."""
        field = self.text[end - INTEGER : end]
        if not field.strip():
            return 0
        if len(field) < INTEGER or not _INTEGER.match(field):
            raise self.fail(f"columns {end - 9} to {end}: {field!r} is not an integer in its place")
        return int(field)

    def real(self, end: int) -> float:
        """The e20 that ends in column `end`."""
        field = self.text[end - REAL : end]
        found = _REAL.match(field)
        if len(field) < REAL or not found:
            raise self.fail(f"columns {end - 19} to {end}: {field!r} is not a real in its place")
        mantissa, lettered, bare = found.groups()
        return float(f"{mantissa}e{lettered or bare or 0}")

    def nothing_after(self, column: int) -> None:
        if self.text[column:].strip():
            raise self.fail(f"unexpected beyond column {column}: {self.text[column:].strip()!r}")

    def integers(self, count: int) -> list[int]:
        """Exactly `count` i10 from column 1."""
        self._long_enough(count * INTEGER)
        values = [self.integer(INTEGER * (i + 1)) for i in range(count)]
        self.nothing_after(count * INTEGER)
        return values

    def reals(self, count: int) -> list[float]:
        """Exactly `count` e20 from column 1."""
        values = [self.real(REAL * (i + 1)) for i in range(count)]
        self.nothing_after(count * REAL)
        return values

    def name(self, start: int = 0, width: int = NAME) -> str:
        """A name from column `start` + 1, in `width` columns."""
        name = self.text[start : start + width].rstrip()
        if not _NAME.match(name):
            raise self.fail(f"columns {start + 1} on: {name!r} is not a name of a-z, 0-9 and _")
        return name

    def expect(self, values: list[int], expected: list[int | None]) -> None:
        """Fields that have to have a value (None: any)."""
        for i, (value, wanted) in enumerate(zip(values, expected, strict=True)):
            if wanted is not None and value != wanted:
                raise self.fail(f"field {i + 1} is {value}, expected {wanted}")

    def _long_enough(self, columns: int) -> None:
        if len(self.text) < columns:
            raise self.fail(f"ends in column {len(self.text)}, expected {columns}")


class Deck:
    """The lines of a file that are no comments, one after the other."""

    def __init__(self, path: Path) -> None:
        try:
            text = path.read_text(encoding="ascii")
        except UnicodeDecodeError as error:
            raise DeckError(f"byte {error.start} is not ASCII") from None
        self.lines = []
        for number, line in enumerate(text.splitlines(), 1):
            if "\t" in line:
                raise DeckError("a tab", number)
            if len(line) > LONGEST:
                raise DeckError(f"{len(line)} columns, {LONGEST} at most", number)
            if not line.startswith("$"):
                self.lines.append(Line(number, line))
        self.at = 0

    @property
    def ended(self) -> bool:
        return self.at >= len(self.lines)

    def peek(self) -> Line:
        if self.ended:
            last = self.lines[-1].number if self.lines else 0
            raise DeckError("the file ends here, and a block is not finished", last)
        return self.lines[self.at]

    def next(self) -> Line:
        line = self.peek()
        self.at += 1
        return line

    def blank(self) -> None:
        """The next line, which has to be empty."""
        line = self.next()
        if not line.blank:
            raise line.fail(f"expected an empty line, found {line.text.strip()!r}")
