"""Write the page of a look at the data before a fit: check.json, figures, report.html."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from ..experiments.kinds import Output
from ..experiments.registry import report_of
from ..files import __version__
from ..runs.fit import Check
from ..writing import write_text
from .content import Exhibit, Report, Section, Table
from .html import write_report


def write_check(check: Check, folder: Path) -> Path:
    """Write check.json, the tests' own figures and report.html; return the page's path.

    Raises
    ------
    OutputError : they cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "check.json", json.dumps(check.result, indent=1) + "\n")
    several = len(check.setup.tests) > 1
    exhibits: list[tuple[str, Exhibit]] = []
    for one in check.setup.tests:
        if (examine := getattr(report_of(one.test.kind), "examine", None)) is not None:
            out = Output.of(folder, one.test.name, several)
            exhibits.append((one.test.name, examine(one, out)))
    header = ["test", "", "doubt", "what was seen"]
    doubts = Table("Doubts", header, [list(row) for row in check.rows()], text=(1, 2, 3))
    facts = [
        (f"{name}: {label}" if several else label, value)
        for name, exhibit in exhibits
        for label, value in exhibit.facts
    ]
    report = Report(
        title=f"{check.setup.project.title}: a look at the data",
        summary=_summary(check),
        facts=facts,
        warnings=[
            words
            for j in check.judgements
            for words in (
                *(f"{j.test}: {d.text}" for d in j.errors),
                *(n.line for n in j.notes),
            )
        ],
        sections=[
            Section("Doubts", [doubts]),
            Section(
                "What was seen",
                [p for _, e in exhibits for p in replace(e, facts=()).all_parts()],
            ),
        ],
        files=[("check.json", "the doubts in plain values")],
        versions={"bubblefit": __version__},
    )
    return write_report(folder, report)


def _summary(check: Check) -> str:
    if not check.sound:
        return "A fit would not begin."
    doubts = sum(len(judgement.doubts) for judgement in check.judgements)
    if doubts:
        return f"A fit would begin, and carry {doubts} of the doubts below with it."
    return "The data are fit to be fitted."
