"""Two pages side by side: tables of one heading as one, curves in one chart, the rest in turn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path

from .charts import Chart, Charts, Series
from .content import Facts, Part, Picture, Report, Section, Table

Named = tuple[str, Report]


def beside(one: Named, other: Named) -> Report:
    """A page of two, each with the folder by which its parts and pictures are named.

    Pictures are named by their place below the folder that both have in common.
    """
    names = one[0], other[0]
    reports = [_with_folder(report, name) for name, report in (one, other)]
    titles = list(dict.fromkeys(s.title for report in reports for s in report.sections))
    sections = []
    for title in titles:
        parts = [[p for s in r.sections if s.title == title for p in s.parts] for r in reports]
        sections.append(Section(title, list(_merged(names, *parts))))
    summary = " ".join(f"{n}: {r.summary}" for n, r in zip(names, reports, strict=True))
    warnings = [f"{n}: {w}" for n, r in zip(names, reports, strict=True) for w in r.warnings]
    facts = [
        (f"{name}: {label}", value)
        for name, report in zip(names, reports, strict=True)
        for label, value in report.facts
    ]
    title = f"{names[0]} beside {names[1]}"
    return Report(title, summary, facts, warnings, sections, versions=reports[0].versions)


def _with_folder(report: Report, name: str) -> Report:
    """The report with its pictures named from the common folder; those outside stay outside."""

    def moved(part: Part) -> Part:
        if not isinstance(part, Picture):
            return part
        inside = Path(part.file).is_absolute() or ".." in Path(part.file).parts
        return replace(part, file="" if inside else f"{name}/{part.file}")

    return replace(
        report,
        sections=[replace(s, parts=[moved(p) for p in s.parts]) for s in report.sections],
    )


def _merged(names: tuple[str, str], ones: Sequence[Part], others: Sequence[Part]) -> Iterator[Part]:
    """Parts of both: together where they are of one kind, title and heading."""
    left = list(others)
    for part in ones:
        twin = next((own for own in left if _alike(part, own)), None)
        if twin is None:
            yield from _named(names[0], part)
            continue
        left.remove(twin)
        if isinstance(part, Table) and isinstance(twin, Table):
            yield _tables(names, part, twin)
        elif isinstance(part, Charts) and isinstance(twin, Charts):
            yield _charts(names, part, twin)
        elif part == twin:
            yield part
        else:
            yield from _named(names[0], part)
            yield from _named(names[1], twin)
    for part in left:
        yield from _named(names[1], part)


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


def _tables(names: tuple[str, str], one: Table, other: Table) -> Table:
    """Rows that begin alike next to each other."""
    pairs = zip_longest(one.rows, other.rows)
    rows = [[n, *row] for pair in pairs for n, row in zip(names, pair, strict=True) if row]
    note = (
        one.note if one.note == other.note else f"{names[0]}: {one.note} {names[1]}: {other.note}"
    )
    text = (1, *(k + 1 for k in one.text))
    return Table(one.title, ["of", *one.header], rows, note, text)


def _charts(names: tuple[str, str], one: Charts, other: Charts) -> Charts:
    charts = [_chart(names, a, b) for a, b in zip(one.charts, other.charts, strict=True)]
    caption = one.caption
    if other.caption != caption:
        caption = f"{names[0]}: {one.caption} {names[1]}: {other.caption}"
    return Charts(one.name, charts, caption)


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
