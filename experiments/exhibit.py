"""What a test puts on a page, and where it writes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # whoever reads a project need not wait for figures
    from ..reports import Table
    from ..reports.content import Part

#: A file below the output folder, and its caption or what it is.
Shown = tuple[str, str]
#: Bytes of a test's name in the names of its files.
LONGEST = 80


@dataclass(frozen=True, eq=False)
class Exhibit:
    """What a test puts on a page: facts, figures, tables, files that it wrote.

    parts : charts, maps and solids of its own, which stand before the pictures in `figures`.
    record : tables of how it was measured, for the record at the end of the page.
    """

    facts: Sequence[tuple[str, object]] = ()
    figures: Sequence[Shown] = ()
    tables: Sequence[Table] = ()
    files: Sequence[Shown] = ()
    parts: Sequence[Part] = ()
    record: Sequence[Table] = ()

    def all_parts(self, title: str = "") -> list[Part]:
        """What stands in the body of the page, in order; title : before it, "" for none."""
        from ..reports import Facts, pictures

        facts = [Facts(self.facts, title)] if self.facts or title else []
        return [*facts, *self.parts, *pictures(self.figures), *self.tables]


@dataclass(frozen=True)
class Output:
    """Where a test writes: below `folder`, names with `prefix` where several tests share it."""

    folder: Path
    prefix: str = ""

    @classmethod
    def of(cls, folder: Path, test: str, several: bool) -> Output:
        """Of a test by its name: before every file's where there are several tests.

        What the name of a file should not hold becomes a dash, and what is too long is cut; a few
        digits then tell such names apart.
        """
        plain = "".join(c if c.isalnum() or c in "._" else "-" for c in test)
        plain = plain.encode()[:LONGEST].decode(errors="ignore").strip("-.")
        if plain != test.replace(" ", "-"):
            plain += f"-{hashlib.sha256(test.encode()).hexdigest()[:6]}"
            plain = plain.strip("-")
        return cls(folder, f"{plain}-" if several else "")

    def name(self, file: str) -> str:
        """The file's name below the folder."""
        return self.prefix + file

    def path(self, file: str) -> Path:
        """The file."""
        return self.folder / self.name(file)
