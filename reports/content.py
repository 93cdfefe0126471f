"""What a page says: sections of words, tables, charts, maps and pictures; plain data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

from .charts import Charts
from .maps import Maps, Solid


@dataclass(frozen=True)
class Table:
    """A table; numbers are written with four significant digits, text as it is.

    text : columns that are words: set from the left, as the first always is.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[object]]
    note: str = ""
    text: Sequence[int] = ()
    part: Literal["table"] = "table"


@dataclass(frozen=True)
class Picture:
    """A figure that lies in the folder as a file, and stands within the page."""

    file: str
    caption: str
    part: Literal["picture"] = "picture"


@dataclass(frozen=True)
class Words:
    """Paragraphs, or a list with a mark before each; warning: what must not be passed over."""

    lines: Sequence[str]
    marked: bool = False
    warning: bool = False
    part: Literal["words"] = "words"


@dataclass(frozen=True)
class Facts:
    """Label and value pairs, values as text or numbers, below a heading unless that is ""."""

    pairs: Sequence[tuple[str, object]]
    title: str = ""
    part: Literal["facts"] = "facts"


@dataclass(frozen=True)
class Download:
    """A file that is inside the page: one click saves it."""

    file: str
    text: str
    words: str
    part: Literal["download"] = "download"


@dataclass(frozen=True)
class Listing:
    """A text with fixed width: a citation, a command."""

    text: str
    part: Literal["listing"] = "listing"


Part = Annotated[
    Table | Picture | Words | Facts | Download | Listing | Charts | Maps | Solid,
    Field(discriminator="part"),
]


@dataclass(frozen=True)
class Section:
    """A heading and what stands below it; nothing is shown of one without parts."""

    title: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Report:
    """All that a page shows, in its order. Empty parts are left out.

    Parameters
    ----------
    title : of the project.
    summary : a sentence or two: how good is the fit.
    facts : for the head of the page.
    warnings : what a reader must know before using the numbers.
    sections : what follows.
    files : (name, what it is) of the output folder.
    versions : name and version of what computed this.
    """

    title: str
    summary: str = ""
    facts: Sequence[tuple[str, object]] = ()
    warnings: Sequence[str] = ()
    sections: Sequence[Section] = ()
    files: Sequence[tuple[str, str]] = ()
    versions: Mapping[str, str] = field(default_factory=dict)

    @property
    def parts(self) -> Iterator[Part]:
        """Of all sections, in order."""
        return (part for section in self.sections for part in section.parts)

    @property
    def tables(self) -> list[Table]:
        """Of all sections, in order."""
        return [part for part in self.parts if isinstance(part, Table)]

    @property
    def figures(self) -> list[tuple[str, str]]:
        """File and caption of the pictures of all sections, in order."""
        return [(part.file, part.caption) for part in self.parts if isinstance(part, Picture)]


def pictures(shown: Sequence[tuple[str, str]]) -> list[Picture]:
    """Of (file relative to the page, caption)."""
    return [Picture(file, caption) for file, caption in shown]


@dataclass(frozen=True, eq=False)
class Exhibit:
    """The contribution of one test to a page: facts, figures, tables, files that it wrote.

    figures, files : a file below the output folder, and its caption or what it is.
    parts : charts, maps and solids of its own, which stand before the pictures in `figures`.
    record : tables of how it was measured, for the record at the end of the page.
    """

    facts: Sequence[tuple[str, object]] = ()
    figures: Sequence[tuple[str, str]] = ()
    tables: Sequence[Table] = ()
    files: Sequence[tuple[str, str]] = ()
    parts: Sequence[Part] = ()
    record: Sequence[Table] = ()

    def all_parts(self, title: str = "") -> list[Part]:
        """What stands in the body of the page, in order; title : before it, "" for none."""
        facts = [Facts(self.facts, title)] if self.facts or title else []
        return [*facts, *self.parts, *pictures(self.figures), *self.tables]
