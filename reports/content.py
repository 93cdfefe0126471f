"""Hold the content of a page as plain data: words, tables, charts, maps and pictures.

It is written as page.json (`write_page_data`), from which report.html is made, now or later; two
pages can be laid beside each other (`side_by_side`).
"""

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
    """Hold a table; its numbers get four significant digits.

    Attributes
    ----------
    title : str
        Above the table.
    header : sequence of str
        Titles of the columns, with their units.
    rows : sequence of sequences
        Numbers, texts, and None where there is nothing.
    note : str
        What to know of the table.
    text : sequence of int
        Columns of words, beside the first.
    side : bool
        Whether it stands beside its neighbours where there is room.
    closed : bool
        Whether it is opened by a click, and when printed.
    """

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
    """Hold a figure that lies in the folder as a file, and stands within the page."""

    file: str
    caption: str
    part: Literal["picture"] = "picture"


@dataclass(frozen=True)
class Words:
    """Hold paragraphs.

    Attributes
    ----------
    lines : sequence of str
        A paragraph each.
    marked : bool
        Whether they are a list, with a mark before each.
    warning : bool
        Whether they are set off from the text.
    """

    lines: Sequence[str]
    marked: bool = False
    warning: bool = False
    part: Literal["words"] = "words"


@dataclass(frozen=True)
class Facts:
    """Hold labels and values, as text or numbers, below a heading unless that is ""."""

    pairs: Sequence[tuple[str, object]]
    title: str = ""
    part: Literal["facts"] = "facts"


@dataclass(frozen=True)
class Download:
    """Hold a file that is inside the page: one click saves it."""

    file: str
    text: str
    words: str
    part: Literal["download"] = "download"


@dataclass(frozen=True)
class Listing:
    """Hold a text with fixed width: a citation, a command."""

    text: str
    part: Literal["listing"] = "listing"


Part = Annotated[
    Table | Picture | Words | Facts | Download | Listing | Charts | Maps | Solid,
    Field(discriminator="part"),
]


@dataclass(frozen=True)
class PageSection:
    """Hold a heading and what stands below it; nothing is shown of one without parts."""

    title: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Report:
    """Hold the content of a page, in its order; empty parts are left out.

    Attributes
    ----------
    title : str
        Of the project.
    summary : str
        A sentence or two on the result.
    facts : sequence of pairs
        For the head of the page.
    warnings : sequence of str
        What a reader must know before using the numbers.
    sections : sequence of PageSection
        In order.
    files : sequence of pairs
        Name and content of the files of the output folder.
    versions : mapping of str to str
        By program.
    about : sequence of pairs
        Date, fabric and laboratory.
    """

    title: str
    summary: str = ""
    facts: Sequence[tuple[str, object]] = ()
    warnings: Sequence[str] = ()
    sections: Sequence[PageSection] = ()
    files: Sequence[tuple[str, str]] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    about: Sequence[tuple[str, object]] = ()

    @property
    def parts(self) -> Iterator[Part]:
        """Return the parts of all sections."""
        return (part for section in self.sections for part in section.parts)


@dataclass(frozen=True, eq=False)
class Exhibit:
    """Hold the contribution of one test to a page.

    Attributes
    ----------
    facts : sequence of pairs
        Labels and values.
    figures, files : sequence of pairs
        A file below the output folder, and its caption or content.
    tables : sequence of Table
        After the pictures.
    parts : sequence of Part
        Charts, maps and solids, which stand before the pictures.
    record : sequence of Table
        How it was measured, for the record at the end of the page.
    standards : sequence of Table
        As a standard's report has them.
    summary : str
        The result in a sentence.
    """

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


def side_by_side(left: Named, right: Named) -> Report:
    """Merge two pages.

    Parameters
    ----------
    left, right : str and Report
        Folder within a common one, whose name stands at its parts, and its page.

    Returns
    -------
    Report
        Parts of the same kind, title and heading are one.
    """
    names = left[0], right[0]
    reports = [_with_folder(report, name) for name, report in (left, right)]
    return Report(
        title=f"{names[0]} beside {names[1]}",
        summary=" ".join(f"{n}: {r.summary}" for n, r in zip(names, reports, strict=True)),
        facts=_labelled(names, [report.facts for report in reports]),
        warnings=[
            f"{name}: {words}"
            for name, report in zip(names, reports, strict=True)
            for words in report.warnings
        ],
        sections=_merged_sections(names, *reports),
        versions=reports[0].versions,
        about=_labelled(names, [report.about for report in reports]),
    )


def _merged_sections(names: tuple[str, str], left: Report, right: Report) -> list[PageSection]:
    """Return the sections of two pages, those of the same title as one."""
    titles = dict.fromkeys(section.title for section in (*left.sections, *right.sections))
    return [
        PageSection(title, list(_merged(names, _parts(left, title), _parts(right, title))))
        for title in titles
    ]


def _parts(report: Report, title: str) -> list[Part]:
    """Return the parts of all sections of a title."""
    return [part for section in report.sections if section.title == title for part in section.parts]


def _labelled(
    names: tuple[str, str], pairs_of: Sequence[Sequence[tuple[str, object]]]
) -> list[tuple[str, object]]:
    """Return the pairs of two pages, with the name of the page at each label."""
    return [
        (f"{name}: {label}", value)
        for name, pairs in zip(names, pairs_of, strict=True)
        for label, value in pairs
    ]


def _with_folder(report: Report, name: str) -> Report:
    """Return the report with pictures named from the common folder; others lose their file."""

    def renamed(part: Part) -> Part:
        if not isinstance(part, Picture):
            return part
        is_elsewhere = Path(part.file).is_absolute() or ".." in Path(part.file).parts
        return replace(part, file="" if is_elsewhere else f"{name}/{part.file}")

    sections = [replace(s, parts=[renamed(p) for p in s.parts]) for s in report.sections]
    return replace(report, sections=sections)


def _merged(names: tuple[str, str], left: Sequence[Part], right: Sequence[Part]) -> Iterator[Part]:
    """Yield parts of both pages, merged where kind, title and heading are the same."""
    unmatched = list(right)
    for part in left:
        twin = next((candidate for candidate in unmatched if _is_twin(part, candidate)), None)
        if twin is None:
            yield from _named(names[0], part)
            continue
        unmatched.remove(twin)
        if isinstance(part, Table) and isinstance(twin, Table):
            yield _merged_table(names, part, twin)
        elif isinstance(part, Charts) and isinstance(twin, Charts):
            charts = [
                _merged_chart(names, a, b) for a, b in zip(part.charts, twin.charts, strict=True)
            ]
            yield Charts(part.name, charts, _merged_words(names, part.caption, twin.caption))
        elif part == twin:
            yield part
        else:
            yield from _named(names[0], part)
            yield from _named(names[1], twin)
    for part in unmatched:
        yield from _named(names[1], part)


def _merged_table(names: tuple[str, str], left: Table, right: Table) -> Table:
    """Return a table of the rows of two, in turn, with the name of the page in each."""
    rows = []
    for pair in zip_longest(left.rows, right.rows):
        rows += [[name, *row] for name, row in zip(names, pair, strict=True) if row]
    note = _merged_words(names, left.note, right.note)
    text = (1, *(column + 1 for column in left.text))
    return Table(left.title, ["of", *left.header], rows, note, text)


def _merged_words(names: tuple[str, str], left: str, right: str) -> str:
    """Return words of two pages, once where they are the same."""
    return left if left == right else f"{names[0]}: {left} {names[1]}: {right}"


def _is_twin(left: Part, right: Part) -> bool:
    """Return whether two parts can be merged."""
    if isinstance(left, Table) and isinstance(right, Table):
        return (left.title, list(left.header)) == (right.title, list(right.header))
    if isinstance(left, Charts) and isinstance(right, Charts):
        return left.name == right.name and _have_same_axes(left.charts, right.charts)
    return left.part == right.part and getattr(left, "name", "") == getattr(right, "name", "")


def _have_same_axes(left: Sequence[Chart], right: Sequence[Chart]) -> bool:
    """Return whether charts can be drawn in one another, pair by pair."""
    if [list(c.x_names) for c in left] != [list(c.x_names) for c in right]:
        return False
    return len(left) == len(right) == 1 or [c.title for c in left] == [c.title for c in right]


def _named(name: str, part: Part) -> list[Part]:
    """Return a part below the name of its page."""
    return [Facts((), name), part]


def _merged_chart(names: tuple[str, str], left: Chart, right: Chart) -> Chart:
    """Return a chart of the series of two, those of the right one in another look."""
    series = [*_renamed(names[0], left, 0), *_renamed(names[1], right, 1)]
    title = left.title if left.title == right.title else ""
    top = None
    if left.top is not None and right.top is not None:
        top = max(left.top, right.top)
    return replace(left, title=title, series=series, top=top, alt=f"{left.alt}; {right.alt}")


def _renamed(name: str, chart: Chart, shift: int) -> list[Series]:
    """Return the series of a chart under the name of its page, colours and dashes shifted."""
    return [
        replace(
            series,
            name=f"{series.name}, {name}" if series.name else name,
            colour=series.colour + shift,
            rank=None,
            dashes=series.dashes + shift,
        )
        for series in chart.series
        if not series.faint
    ]
