"""The folder of a plan: plan.csv, plan.png, report.html, notes.csv, and last result.json."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..materials.forms.base import COMPONENTS
from ..runs.plan import ASSUMED, words
from ..runs.series import FILES, write_folder
from .content import Report, Section, Table
from .named_charts import plan_charts
from .plan import plot_plan

if TYPE_CHECKING:
    from ..runs.plan import Plan, Planned

TABLE, FIGURE = "plan.csv", "plan.png"
WITHOUT = "the present tests alone"
CAPTION = "1 sigma of the moduli with one more test, root mean square along each"


def write_plan(plan: Plan, folder: Path) -> Path:
    """Write everything; raises OutputError. The page's path."""
    figures = {FIGURE: lambda path: plot_plan(path, *_shown(plan), WITHOUT)}
    return write_folder(
        folder, {TABLE: plan.table()}, figures, plan.notes, _page(plan), plan.result, 6
    )


def _shown(plan: Plan) -> tuple[list[str], dict[str, list[float]]]:
    """Titles, and of each modulus 1 sigma in percent."""
    every = (plan.now, *plan.candidates)
    titles = [WITHOUT, *(planned.title for planned in plan.candidates)]
    return titles, {name: [100 * one.summary[name] for one in every] for name in COMPONENTS}


def _page(plan: Plan) -> Report:
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
                    plan_charts([title for title, _ in _rows(plan)], _shown(plan)[1], CAPTION),
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
