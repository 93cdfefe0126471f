"""The folder of a plan: plan.csv, plan.png, report.html, notes.csv, and last result.json."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..materials.forms.base import COMPONENTS
from ..runs.plan import ASSUMED, words
from ..runs.series import FILES, write_folder
from .charts import Charts
from .content import Report, Section, Table
from .studies import plan_charts
from .vega import save

if TYPE_CHECKING:
    from ..runs.plan import Plan, Planned

TABLE, FIGURE = "plan.csv", "plan.png"
WITHOUT = "the present tests alone"
CAPTION = "1 sigma of the moduli with one more test, root mean square along each"


def write_plan(plan: Plan, folder: Path) -> Path:
    """Write everything; raises OutputError. The page's path."""
    charts = plan_charts([title for title, _ in _rows(plan)], _sigma(plan), CAPTION)
    figures = {FIGURE: lambda path: save(path, charts)}
    return write_folder(
        folder, {TABLE: plan.table()}, figures, plan.notes, _page(plan, charts), plan.result, 6
    )


def _sigma(plan: Plan) -> dict[str, list[float]]:
    """Return 1 sigma of each modulus in percent, one a test."""
    every = (plan.now, *plan.candidates)
    return {name: [100 * one.summary[name] for one in every] for name in COMPONENTS}


def _page(plan: Plan, charts: Charts) -> Report:
    first = plan.candidates[0]
    told = ", ".join(
        f"{name} {words(plan.now.summary[name])} to {words(first.summary[name])}"
        for name in COMPONENTS
    )
    return Report(
        title=f"{plan.title}: which test next?",
        summary=f"{first.title}: 1 sigma of {told}.",
        facts=[
            ("card", plan.card),
            ("present tests", ", ".join(plan.tests)),
            ("ranked by", plan.criterion),
            *_following(plan),
        ],
        warnings=[note.line for note in plan.notes],
        sections=[
            Section(
                "Which test next",
                [
                    charts,
                    _summaries(plan),
                ],
            ),
            Section("Along the strains", [_at_strains(plan, name) for name in COMPONENTS]),
        ],
        files=[
            (TABLE, "the tables"),
            (FIGURE, "picture of the chart"),
            *FILES,
        ],
    )


def _following(plan: Plan) -> list[tuple[str, object]]:
    if plan.following is None:
        return []
    told = ", ".join(f"{name} {words(s)}" for name, s in plan.following.summary.items())
    return [("best after the first", f"{plan.following.title}: {told}")]


def _rows(plan: Plan) -> list[tuple[str, Planned]]:
    ranked = [(f"{k}. {p.title}", p) for k, p in enumerate(plan.candidates, start=1)]
    return [(WITHOUT, plan.now), *ranked]


def _summaries(plan: Plan) -> Table:
    rows: list[list[object]] = [
        [title, *(words(p.summary[name]) for name in COMPONENTS), p.noise]
        for title, p in _rows(plan)
    ]
    header = ["test", *(f"1 sigma of {name}" for name in COMPONENTS), "noise"]
    return Table("Which test next", header, rows, ASSUMED, text=(4,))


def _at_strains(plan: Plan, name: str) -> Table:
    rows: list[list[object]] = [
        [title, *(words(value) for value in plan.at(p)[name])] for title, p in _rows(plan)
    ]
    header = ["test", *(f"at strain {strain:.3g}" for strain in plan.strains[name])]
    return Table(f"1 sigma of {name}", header, rows)
