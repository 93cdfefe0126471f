"""The folder of a comparison of forms: comparison.csv, laws.png, curves, report.html."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import SolverFailure
from ..experiments.base import CardRun
from ..experiments.exhibit import Output, Shown
from ..experiments.registry import kind_named
from ..fits.store import RESULT, Store
from ..notes import NOTES, NOTES_ARE, write_notes
from ..reports import (
    LawRow,
    Report,
    Section,
    Table,
    pictures,
    plot_laws,
    write_report,
)
from ..reports.named_charts import law_charts
from ..writing import replacing
from .law_words import conclusion, noise, table_of

if TYPE_CHECKING:
    from ..experiments.fittable import PreparedTest
    from .laws import LawComparison

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
    plot_laws(folder / "laws.png", rows, total, result["objective_is"])
    page = Report(
        title=f"{comparison.project.title}: forms of the moduli",
        summary="; ".join(conclusion(result)),
        facts=[("error", result["objective_is"]), ("the data's own noise", total)],
        warnings=[note.line for note in comparison.notes],
        sections=[
            Section("Errors", [
                law_charts(rows, total, result["objective_is"], CAPTION),
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
    return kind_named(own.kind).simulate(own, cards, runs, out).figures


def _outcome(solver: Any, model: Any, law: Any) -> Any:
    try:
        return solver.run(model, law)
    except SolverFailure as failure:
        return failure
