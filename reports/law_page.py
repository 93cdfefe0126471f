"""The folder of a comparison of forms: comparison.csv, laws.png, curves, report.html."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..errors import SolverFailure
from ..experiments.kinds import CardRun, Output, Shown
from ..experiments.registry import report_of
from ..files import replacing
from ..notes import NOTES, NOTES_ARE, write_notes
from ..runs.compare import AS_GOOD, LawComparison, noise
from ..runs.folder import RESULT, Store
from .content import Report, Section, Table, pictures
from .html import write_report
from .studies import LawRow, law_charts
from .vega import save

if TYPE_CHECKING:
    from ..experiments.kinds import PreparedTest


def table_of(comparison: LawComparison) -> pd.DataFrame:
    """A row a form: errors of the fit and at what was left out, in all and by comparison."""
    rows = []
    for form in comparison.forms:
        units = {c.name: c.objective.unit for c in form.fit.problem.comparisons}
        fitted = {f"rms {name}, {units[name]}": e for name, e in form.rms.items()}
        left = {
            f"left out {name}, {units[name]}": float(np.mean(form.left_out(name)))
            for name in form.compared
        }
        rows.append(
            {
                "moduli": form.name,
                "coefficients": form.coefficients,
                "fitted": form.fitted,
                "cross_validated": form.validated,
                **fitted,
                **left,
            }
        )
    return pd.DataFrame(rows)


def lines_of(result: Mapping[str, Any]) -> list[str]:
    """A table for the terminal."""
    lines = [
        f"error: {result['objective_is']}",
        f"{'moduli':<12}{'coefficients':>13}{'fitted':>12}{'cross-validated':>18}",
    ]
    for form in result["forms"]:
        error = form["cross_validated"]
        validated = "a fold failed" if error is None else f"{error:.4g}"
        lines.append(
            f"{form['form']:<12}{form['coefficients']:>13}{form['fitted']:>12.4g}{validated:>18}"
        )
    lines.append(f"the data's own noise: {result['noise']:.4g}")
    return [*lines, *conclusion(result)]


def conclusion(result: Mapping[str, Any]) -> list[str]:
    """Which form is best, and which is the simplest that is as good."""
    if result["simplest_as_good"] is None:
        return []
    return [
        f"least at specimens left out: {result['least_cross_validated']}; simplest within "
        f"{100 * AS_GOOD:.0f} % of it: {result['simplest_as_good']}"
    ]


COMPARISON = "comparison.csv"
CAPTION = "Error of the fit, and at specimens left out of it; the line is the data's own noise"


def write_comparison(comparison: LawComparison, folder: Path) -> Path:
    """Write everything; raises OutputError."""
    result, table = comparison.result, table_of(comparison)
    with replacing(folder / COMPARISON) as path:
        table.to_csv(path, index=False, float_format="%.9g")
    write_notes(folder, comparison.notes)
    first = comparison.forms[0]
    rows = [
        LawRow(f.name, f.coefficients, f.fitted, f.validated, f.left_out())
        for f in comparison.forms
    ]
    total = sum(noise(first).values())
    charts = law_charts(rows, total, result["objective_is"], CAPTION)
    save(folder / "laws.png", charts)
    page = Report(
        title=f"{comparison.project.title}: forms of the moduli",
        summary="; ".join(conclusion(result)),
        facts=[("error", result["objective_is"]), ("the data's own noise", total)],
        warnings=[note.line for note in comparison.notes],
        sections=[
            Section("Errors", [
                charts,
                Table(
                    "Errors",
                    list(table.columns),
                    table.to_numpy(dtype=object).tolist(),
                    "fitted: to all points; left out: at what the fits of the folds were not given",
                ),
            ]),
            Section("The forms side by side", pictures([
                shown
                for test in first.fit.setup.tests
                for shown in _side_by_side(comparison, test, folder)
            ])),
        ],
        files=[
            (COMPARISON, "the table"),
            ("laws.png", "picture of the errors"),
            (NOTES, NOTES_ARE),
            (RESULT, "all numbers, for programs"),
        ],
    )  # fmt: skip
    written = write_report(folder, page)
    Store(folder).finish(result)
    return written


def _side_by_side(comparison: LawComparison, test: PreparedTest, folder: Path) -> Sequence[Shown]:
    """What a kind of test draws of several cards: here those of the forms."""
    several = len(comparison.forms[0].fit.setup.tests) > 1
    own = test.test
    cards = {f.name: f.fit.card for f in comparison.forms}
    runs = {
        (f.name, part): CardRun(model, _outcome(f.fit.setup.make_solver(), model, f.fit.law))
        for f in comparison.forms
        for part, model in own.models().items()
    }
    out = Output.of(folder, own.name, several)
    return report_of(own.kind).simulate(own, cards, runs, out).figures


def _outcome(solver: Any, model: Any, law: Any) -> Any:
    try:
        return solver.run(model, law)
    except SolverFailure as failure:
        return failure
