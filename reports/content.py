"""Hold the content of a page as plain data: words, tables, charts, maps and pictures.

It is written as page.json (`write_page_data`), from which report.html is made, now or later; two
pages can be laid beside each other (`beside`)."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import zip_longest
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, TypeAdapter, ValidationError

from ..errors import InputError
from ..storage.plain_values import plain_values
from ..storage.writing import write_text
from .charts import Chart, Charts, Series
from .maps import Maps, Solid


@dataclass(frozen=True)
class Table:
    """A table; numbers get four significant digits; text : columns of words, beside the first.
    side : stands beside its neighbours where there is room. closed : opened by a click, and when
    printed."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[object]]
    note: str = ""
    text: Sequence[int] = ()
    side: bool = False
    closed: bool = False
    part: Literal["table"] = "table"


@dataclass(frozen=True)
class Picture:
    """A figure that lies in the folder as a file, and stands within the page."""

    file: str
    caption: str
    part: Literal["picture"] = "picture"


@dataclass(frozen=True)
class Words:
    """Paragraphs, or a list with a mark before each; warning : set off from the text."""

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
    """The content of a page, in its order; empty parts are left out.
    title : of the project. about : date, fabric and laboratory. summary : a sentence or two on the
    result. facts : for the head of the page. warnings : what a reader must know before using the
    numbers. files : name and content of the files of the output folder. versions : by program."""

    title: str
    summary: str = ""
    facts: Sequence[tuple[str, object]] = ()
    warnings: Sequence[str] = ()
    sections: Sequence[Section] = ()
    files: Sequence[tuple[str, str]] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    about: Sequence[tuple[str, object]] = ()

    @property
    def parts(self) -> Iterator[Part]:
        return (part for section in self.sections for part in section.parts)


@dataclass(frozen=True, eq=False)
class Exhibit:
    """The contribution of one test to a page.
    figures, files : a file below the output folder, and its caption or content.
    parts : charts, maps and solids of its own, which stand before the pictures in `figures`.
    record : tables of how it was measured, for the record at the end of the page. standards :
    tables as a standard's report has them.
    summary : the result in a sentence."""

    facts: Sequence[tuple[str, object]] = ()
    figures: Sequence[tuple[str, str]] = ()
    tables: Sequence[Table] = ()
    files: Sequence[tuple[str, str]] = ()
    parts: Sequence[Part] = ()
    record: Sequence[Table] = ()
    standards: Sequence[Table] = ()
    summary: str = ""

    def all_parts(self, title: str = "") -> list[Part]:
        """Return the parts for the body of the page, in order, below a title unless that is ""."""
        facts = [Facts(self.facts, title)] if self.facts or title else []
        pictures = [Picture(file, caption) for file, caption in self.figures]
        return [*facts, *self.parts, *pictures, *self.tables]


PAGE_DATA = "page.json"
#: Number of the file's layout; a page of another layout is not made again.
LAYOUT = 1


@cache
def _adapter() -> TypeAdapter[Report]:
    return TypeAdapter(Report)


def write_page_data(folder: Path, report: Report) -> Path:
    """Write page.json. Raises OutputError: it cannot be written."""
    content = {"layout": LAYOUT, **plain_values(report)}
    path = folder / PAGE_DATA
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    return path


def read_page_data(folder: Path) -> Report:
    """Read a folder's page.json; raises InputError: missing, damaged, or of another layout."""
    path = folder / PAGE_DATA
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        layout = content.pop("layout")
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, AttributeError, TypeError):
        raise InputError(path, "", "is damaged: expected the data of a page") from None
    if layout != LAYOUT:
        problem = f"is of another version's layout: expected {LAYOUT}, got {layout!r}"
        raise InputError(path, "layout", problem)
    try:
        return _adapter().validate_python(content)
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(path, ".".join(map(str, first["loc"])), first["msg"]) from None


def round_trip(report: Report) -> Report:
    """Return the report as read back from page.json, so that pages made later are the same."""
    return _adapter().validate_python(plain_values(report))


Named = tuple[str, Report]


def beside(one: Named, other: Named) -> Report:
    """Merge two pages, each with the folder, in a common one, that names its parts."""
    names = one[0], other[0]
    reports = [_with_folder(report, name) for name, report in (one, other)]
    titles = list(dict.fromkeys(s.title for report in reports for s in report.sections))
    sections = []
    for title in titles:
        parts = [[p for s in r.sections if s.title == title for p in s.parts] for r in reports]
        sections.append(Section(title, list(_merged(names, *parts))))
    both = list(zip(names, reports, strict=True))
    summary = " ".join(f"{name}: {report.summary}" for name, report in both)
    warnings = [f"{name}: {words}" for name, report in both for words in report.warnings]
    about, facts = (
        [(f"{name}: {label}", value) for name, r in both for label, value in getattr(r, pairs)]
        for pairs in ("about", "facts")
    )
    title = f"{names[0]} beside {names[1]}"
    versions = reports[0].versions
    return Report(title, summary, facts, warnings, sections, versions=versions, about=about)


def _with_folder(report: Report, name: str) -> Report:
    """Return the report with pictures named from the common folder; others lose their file."""

    def moved(part: Part) -> Part:
        if not isinstance(part, Picture):
            return part
        inside = Path(part.file).is_absolute() or ".." in Path(part.file).parts
        return replace(part, file="" if inside else f"{name}/{part.file}")

    sections = [replace(s, parts=[moved(p) for p in s.parts]) for s in report.sections]
    return replace(report, sections=sections)


def _merged(names: tuple[str, str], ones: Sequence[Part], others: Sequence[Part]) -> Iterator[Part]:
    """Yield parts of both, merged where kind, title and heading are the same."""
    left = list(others)
    for part in ones:
        twin = next((own for own in left if _alike(part, own)), None)
        if twin is None:
            yield from _named(names[0], part)
            continue
        left.remove(twin)
        if isinstance(part, Table) and isinstance(twin, Table):
            pairs = zip_longest(part.rows, twin.rows)
            rows = [[n, *row] for pair in pairs for n, row in zip(names, pair, strict=True) if row]
            note = _both(names, part.note, twin.note)
            text = (1, *(k + 1 for k in part.text))
            yield Table(part.title, ["of", *part.header], rows, note, text)
        elif isinstance(part, Charts) and isinstance(twin, Charts):
            charts = [_chart(names, a, b) for a, b in zip(part.charts, twin.charts, strict=True)]
            yield Charts(part.name, charts, _both(names, part.caption, twin.caption))
        elif part == twin:
            yield part
        else:
            yield from _named(names[0], part)
            yield from _named(names[1], twin)
    for part in left:
        yield from _named(names[1], part)


def _both(names: tuple[str, str], one: str, other: str) -> str:
    return one if one == other else f"{names[0]}: {one} {names[1]}: {other}"


def _alike(one: Part, other: Part) -> bool:
    if isinstance(one, Table) and isinstance(other, Table):
        return (one.title, list(one.header)) == (other.title, list(other.header))
    if isinstance(one, Charts) and isinstance(other, Charts):
        if [list(c.x_names) for c in one.charts] != [list(c.x_names) for c in other.charts]:
            return False
        same = [c.title for c in one.charts] == [c.title for c in other.charts]
        return one.name == other.name and (same or len(one.charts) == len(other.charts) == 1)
    return one.part == other.part and getattr(one, "name", "") == getattr(other, "name", "")


def _named(name: str, part: Part) -> list[Part]:
    return [Facts((), name), part]


def _chart(names: tuple[str, str], one: Chart, other: Chart) -> Chart:
    def own(name: str, chart: Chart, second: bool) -> list[Series]:
        return [
            replace(
                s,
                name=f"{s.name}, {name}" if s.name else name,
                colour=s.colour + second,
                rank=None,
                dashes=s.dashes + second,
            )
            for s in chart.series
            if not s.faint
        ]

    tops = [top for top in (one.top, other.top) if top is not None]
    series = [*own(names[0], one, False), *own(names[1], other, True)]
    title = one.title if one.title == other.title else ""
    top = max(tops) if len(tops) == 2 else None
    return replace(one, title=title, series=series, top=top, alt=f"{one.alt}; {other.alt}")
