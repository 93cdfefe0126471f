"""Content of a report page as plain data: paragraphs, facts, tables, charts, maps and pictures.

A `Report` has sections, and a section has parts (`Part`), each of which the template of the page
shows in its own way. The content is written as page.json (`write_page_data`), from which
report.html is made, at once or later; the contents of two pages can be merged into one
(`side_by_side`). The field `part` of every part names its class in page.json.
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
from ..notes import Verdict
from ..storage.writing import plain_values, write_text
from .charts import Chart, Charts, Series
from .maps import Maps, Solid


@dataclass(frozen=True)
class Table:
    """Hold a table; floating-point numbers are shown with four significant digits.

    Attributes
    ----------
    title : str
        Heading above the table.
    header : sequence of str
        Titles of the columns, with their units.
    rows : sequence of sequences
        Cells row by row: numbers, texts, and None where there is no value.
    note : str
        Paragraph below the table that explains its columns.
    text : sequence of int
        Indices, from 0, of the columns of text, which are aligned to the left; the first column
        need not be named.
    side : bool
        Whether the table stands beside its neighbours where there is room.
    closed : bool
        Whether the table is folded until a reader clicks on it; on paper it is open.
    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[object]]
    note: str = ""
    text: Sequence[int] = ()
    side: bool = False
    closed: bool = False
    part: Literal["table"] = "table"

    def without_empty_columns(self) -> Table:
        """Return the table without the columns in which no row has a value."""
        columns = [
            k for k in range(len(self.header)) if any(row[k] is not None for row in self.rows)
        ]
        return replace(
            self,
            header=[self.header[k] for k in columns],
            rows=[[row[k] for k in columns] for row in self.rows],
            text=[number for number, k in enumerate(columns) if k in self.text],
        )


@dataclass(frozen=True)
class Picture:
    """Hold a figure that is a PNG file of the output folder, and is embedded in the page.

    Attributes
    ----------
    file : str
        Path of the file, relative to the output folder.
    caption : str
        Text below the figure.
    """

    file: str
    caption: str
    part: Literal["picture"] = "picture"


@dataclass(frozen=True)
class Words:
    """Hold running text: paragraphs or a bulleted list.

    Attributes
    ----------
    lines : sequence of str
        Paragraphs, or items of the list.
    bulleted : bool
        Whether the lines are items of a bulleted list rather than paragraphs.
    warning : bool
        Whether the list looks like the warnings at the head of the page; of no effect on
        paragraphs.
    """

    lines: Sequence[str]
    bulleted: bool = False
    warning: bool = False
    part: Literal["words"] = "words"


@dataclass(frozen=True)
class Facts:
    """Hold a list of labels, each with its value, such as "starts" and 12.

    Without pairs it is a heading alone, which names the parts after it.

    Attributes
    ----------
    pairs : sequence of (str, object)
        Label and value; a value is text or a number.
    title : str
        Heading above the list, "" for none.
    """

    pairs: Sequence[tuple[str, object]]
    title: str = ""
    part: Literal["facts"] = "facts"


@dataclass(frozen=True)
class Download:
    """Hold a text file that is embedded in the page, and a link that saves it.

    Attributes
    ----------
    file : str
        Name under which the browser saves the file.
    text : str
        Content of the file.
    words : str
        Text of the link.
    """

    file: str
    text: str
    words: str
    part: Literal["download"] = "download"


@dataclass(frozen=True)
class Listing:
    """Hold a text that is set in letters of fixed width, such as a citation or a command."""

    text: str
    part: Literal["listing"] = "listing"


#: One piece of a section, told from others by its field `part`.
Part = Annotated[
    Table | Picture | Words | Facts | Download | Listing | Charts | Maps | Solid,
    Field(discriminator="part"),
]


@dataclass(frozen=True)
class PageSection:
    """Hold a section of a page: its heading and its parts; without parts it is not shown."""

    title: str
    parts: Sequence[Part]


def notes_section(lines: Sequence[str]) -> PageSection:
    """Return the section of the notes on a result, an item of a list each."""
    return PageSection("What to know of it", [Words(lines, bulleted=True)] if lines else [])


@dataclass(frozen=True)
class Report:
    """Hold the content of a whole page: its head, its sections and its list of files.

    Attributes
    ----------
    title : str
        Heading of the page, most often the title of the project.
    summary : str
        A sentence or two on the result.
    facts : sequence of (str, object)
        Labels and values that stand below the summary.
    warnings : sequence of str
        What a reader must know before using the numbers, a list item each.
    sections : sequence of PageSection
        Sections in the order of the page.
    files : sequence of (str, str)
        Files of the output folder: name, and a description of its content.
    versions : mapping of str to str
        Version of each program that took part, by its name.
    about : sequence of (str, object)
        Labels and values that stand below the title: date, fabric and laboratory.
    verdicts : sequence of (str, Verdict)
        What the page comes to, with the name of what it is of where there are several.
    """

    title: str
    summary: str = ""
    facts: Sequence[tuple[str, object]] = ()
    warnings: Sequence[str] = ()
    sections: Sequence[PageSection] = ()
    files: Sequence[tuple[str, str]] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    about: Sequence[tuple[str, object]] = ()
    verdicts: Sequence[tuple[str, Verdict]] = ()

    @property
    def parts(self) -> Iterator[Part]:
        """Return an iterator over the parts of all sections."""
        return (part for section in self.sections for part in section.parts)


@dataclass(frozen=True, eq=False)
class Exhibit:
    """Hold what the presenter of a kind of test contributes to a page, most often for one test.

    Facts, parts, figures and tables follow each other in this order in the body of the page
    (`all_parts`); the other fields go elsewhere.

    Attributes
    ----------
    facts : sequence of (str, object)
        Labels and values.
    figures : sequence of (str, str)
        Pictures: path of a PNG file relative to the output folder, and caption.
    tables : sequence of Table
        Tables that stand after the pictures.
    files : sequence of (str, str)
        Files for the list at the end of the page: path relative to the output folder, and
        description.
    parts : sequence of Part
        Charts, maps and solids, which stand before the pictures.
    record : sequence of Table
        Details of measurement or evaluation, which stand apart from the body of the page.
    standards : sequence of Table
        Tables as the report of a test standard lays them out, for a section of their own.
    summary : str
        Result in one sentence, for the head of the page; "" for none.
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
        """Return facts, parts, pictures and tables for the body of the page, in this order.

        Parameters
        ----------
        title : str
            Heading above them, such as the name of the test; "" for none.
        """
        facts = [Facts(self.facts, title)] if self.facts or title else []
        pictures = [Picture(file, caption) for file, caption in self.figures]
        return [*facts, *self.parts, *pictures, *self.tables]


PAGE_DATA = "page.json"
#: Number of the layout of page.json; files of another layout are refused.
LAYOUT = 1


@cache
def _adapter() -> TypeAdapter[Report]:
    """Return what makes a report of plain values; it takes time, so that it is made once."""
    return TypeAdapter(Report)


def write_page_data(folder: Path, report: Report) -> Path:
    """Write the content of a page to page.json in a folder, and return the file's path.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    content = {"layout": LAYOUT, **plain_values(report)}
    path = folder / PAGE_DATA
    write_text(path, json.dumps(content, ensure_ascii=False, allow_nan=False) + "\n")
    return path


def read_page_data(folder: Path) -> Report:
    """Read the content of a page from page.json in a folder.

    Raises
    ------
    InputError
        The file is missing or damaged, or has another layout than `LAYOUT`.
    """
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
    """Return the report as it would be read back from page.json, without writing a file.

    A page made at once is then the same as one that is made later from page.json.
    """
    return _adapter().validate_python(plain_values(report))


#: Path of an output folder relative to a common folder, and the content of its page.
NamedReport = tuple[str, Report]


def side_by_side(left: NamedReport, right: NamedReport) -> Report:
    """Merge the contents of two pages into one page that compares them.

    Parameters
    ----------
    left, right : (str, Report)
        Path of the output folder relative to a common folder, and the content of its page. The
        path labels everything that comes from this page.

    Returns
    -------
    Report
        Page that belongs into the common folder. In sections of the same title, tables of the
        same title and columns, and charts of the same name and axes, are merged into one; other
        parts follow each other.
    """
    names = left[0], right[0]
    first, second = (_with_folder(report, name) for name, report in (left, right))
    return Report(
        title=f"{names[0]} beside {names[1]}",
        summary=f"{first.summary} {second.summary}".strip(),
        facts=[*first.facts, *second.facts],
        warnings=[*first.warnings, *second.warnings],
        sections=_merged_sections(names, first, second),
        versions=first.versions,
        about=[*first.about, *second.about],
        verdicts=[*first.verdicts, *second.verdicts],
    )


def _merged_sections(names: tuple[str, str], left: Report, right: Report) -> list[PageSection]:
    """Return the sections of two pages, where sections of the same title become one."""
    titles = dict.fromkeys(section.title for section in (*left.sections, *right.sections))
    return [
        PageSection(title, list(_merged(names, _parts(left, title), _parts(right, title))))
        for title in titles
    ]


def _parts(report: Report, title: str) -> list[Part]:
    """Return the parts of all sections of a report that have this title."""
    return [part for section in report.sections if section.title == title for part in section.parts]


def _with_folder(report: Report, name: str) -> Report:
    """Return the report of a folder, named in its head, with pictures relative to the common one.

    A picture whose path leads out of the output folder loses its file.
    """

    def with_path(part: Part) -> Part:
        if not isinstance(part, Picture):
            return part
        is_elsewhere = Path(part.file).is_absolute() or ".." in Path(part.file).parts
        return replace(part, file="" if is_elsewhere else f"{name}/{part.file}")

    return replace(
        report,
        summary=f"{name}: {report.summary}" if report.summary else "",
        facts=[(f"{name}: {label}", value) for label, value in report.facts],
        warnings=[f"{name}: {words}" for words in report.warnings],
        sections=[replace(s, parts=[with_path(part) for part in s.parts]) for s in report.sections],
        about=[(f"{name}: {label}", value) for label, value in report.about],
        verdicts=[(name, verdict) for _, verdict in report.verdicts],
    )


def _merged(names: tuple[str, str], left: Sequence[Part], right: Sequence[Part]) -> Iterator[Part]:
    """Yield the parts of two sections, merged where `_is_twin` holds, else one after the other."""
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
    """Return a table of the rows of two tables in turn; a first column names the page."""
    rows = []
    for pair in zip_longest(left.rows, right.rows):
        rows += [[name, *row] for name, row in zip(names, pair, strict=True) if row]
    note = _merged_words(names, left.note, right.note)
    text = (1, *(column + 1 for column in left.text))  # 1: the first column of the old table
    return Table(left.title, ["of", *left.header], rows, note, text)


def _merged_words(names: tuple[str, str], left: str, right: str) -> str:
    """Return the texts of two pages, each after the name of its page; one text if they agree."""
    return left if left == right else f"{names[0]}: {left} {names[1]}: {right}"


def _is_twin(left: Part, right: Part) -> bool:
    """Return whether two parts of different pages show the same thing and can be merged."""
    if isinstance(left, Table) and isinstance(right, Table):
        return (left.title, list(left.header)) == (right.title, list(right.header))
    if isinstance(left, Charts) and isinstance(right, Charts):
        return left.name == right.name and _have_same_axes(left.charts, right.charts)
    return left.part == right.part and getattr(left, "name", "") == getattr(right, "name", "")


def _have_same_axes(left: Sequence[Chart], right: Sequence[Chart]) -> bool:
    """Return whether the curves of two figures can share axes, chart by chart."""
    if [list(c.y_names) for c in left] != [list(c.y_names) for c in right]:
        return False
    return len(left) == len(right) == 1 or [c.title for c in left] == [c.title for c in right]


def _named(name: str, part: Part) -> list[Part]:
    """Return a part after a heading that names its page."""
    return [Facts((), name), part]


def _merged_chart(names: tuple[str, str], left: Chart, right: Chart) -> Chart:
    """Return a chart of the series of two charts; those of the right one look different."""
    series = [*_renamed(names[0], left, 0), *_renamed(names[1], right, 1)]
    title = left.title if left.title == right.title else ""
    top = None
    if left.top is not None and right.top is not None:
        top = max(left.top, right.top)
    return replace(left, title=title, series=series, top=top, alt=f"{left.alt}; {right.alt}")


def _renamed(name: str, chart: Chart, shift: int) -> list[Series]:
    """Return the series of a chart with the name of its page added to theirs.

    The indices of colours and dashes are raised by `shift`; faint series are left out.
    """
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
