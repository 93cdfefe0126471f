"""Forms side by side: every number of result.json, table and page, and going on with it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import OutputError
from bubblefit.notes import rows
from bubblefit.reports import law_page
from bubblefit.reports.charts import Charts
from bubblefit.reports.content import Report, Table
from bubblefit.runs.compare import FoldError, LawComparison, compare_laws

from ..projects import ELONGATION, MODULI, constant_strips

FORMS = ("constant", "linear")
PARTS = {"one: warp": "warp", "one: fill": "fill"}


class Run:
    """A comparison in a folder, what it told, and what was written of it without a picture."""

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch) -> None:
        self.out = folder / "out"
        self.path = constant_strips(folder, ("starts = 2", "jobs = 1"))
        self.events: list[Any] = []
        self.pages: list[Report] = []
        self.drawn: list[tuple[Any, ...]] = []
        patch.setattr(law_page, "save", lambda *args: self.drawn.append(args))
        patch.setattr(law_page, "_side_by_side", lambda *_: [("loads.png", "loads")])
        patch.setattr(bf.Fit, "report", lambda *_: None)
        patch.setattr(law_page, "write_report", self.page)

    def page(self, folder: Path, report: Report) -> Path:
        self.pages.append(report)
        return folder / "report.html"

    def compare(self, **options: Any) -> LawComparison:
        self.events.clear()
        return compare_laws(
            bf.read_project(self.path), ["one"], FORMS, folds=5, starts=1, fold_starts=1,
            out=self.out, progress=self.events.append, **options,
        )  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Any:
    with pytest.MonkeyPatch.context() as patch:
        yield Run(tmp_path_factory.mktemp("laws"), patch)


@pytest.fixture(scope="module")
def compared(run: Run) -> LawComparison:
    done = run.compare()
    told = [event for event in run.events if isinstance(event, str | FoldError)]
    assert told[0] == "constant" and told[3] == "linear" and len(told) == 6
    return done


def difference(direction: str) -> float:
    """RMS in N of what one specimen foretells of the other, in closed form."""
    strain = np.log1p(ELONGATION[ELONGATION <= 2.9] / 20)
    return float(20 * abs(np.subtract(*MODULI["one"][direction])) * np.sqrt(np.mean(strain**2)))


def test_every_number(compared: LawComparison) -> None:
    result = compared.result
    first, second = result.pop("forms")
    noise = {
        name: 10 * abs(np.subtract(*MODULI["one"][direction]))
        * np.sqrt(np.sum(np.log1p(ELONGATION / 20) ** 2) * 2 / (2 * len(ELONGATION) - 1))
        for name, direction in PARTS.items()
    }  # fmt: skip
    assert result == {
        "command": "compare",
        "title": "made",
        "tests": ["one"],
        "objective_is": "sum of the strips' RMS errors, N",
        "units": {"one: warp": "N", "one: fill": "N"},
        "fold_starts": 1,
        "noise": pytest.approx(sum(noise.values()), rel=1e-3),
        "noise_by_part": pytest.approx(noise, rel=1e-3),
        "least_cross_validated": result["least_cross_validated"],
        "simplest_as_good": "constant",
        "as_good_within": 0.05,
        "notes": rows(compared.notes),
    }
    left = {name: difference(direction) for name, direction in PARTS.items()}
    total = sum(left.values())
    fit = compared.forms[0].fit
    assert first == {
        "form": "constant",
        "coefficients": 3,
        "objective": fit.objective,
        "fitted": pytest.approx(fit.objective),  # every strip can be left out
        "rms": pytest.approx({n: d / 2 for n, d in left.items()}, rel=1e-3),
        "cross_validated": pytest.approx(total, rel=1e-3),
        "cross_validated_by_part": pytest.approx(left, rel=1e-3),
        "folds": pytest.approx([total, total], rel=1e-3),
        "starts_objective": [fit.objective],
    }
    assert second["coefficients"] == 6 and second["form"] == "linear"
    # A modulus that is linear in strain can be the constant one, and differs like it.
    assert second["cross_validated"] == pytest.approx(total, rel=0.05)


def test_table_and_page(compared: LawComparison, run: Run) -> None:
    compared.report(run.out)
    result = json.loads((run.out / "result.json").read_text())
    assert result == compared.result
    found, ((path, charts),) = run.pages[-1], run.drawn
    (chart,) = charts.charts
    label, noise = chart.y_label, chart.level
    assert path == run.out / "laws.png" and label == "sum of the strips' RMS errors, N"
    assert noise == pytest.approx(result["noise"])
    folds = [s.y for s in chart.series if s.name == "single folds"]
    for own, form in zip(folds, result["forms"], strict=True):
        assert own == pytest.approx(form["folds"], rel=1e-5)
    assert found.title == "made: forms of the moduli"
    best = result["least_cross_validated"]
    assert (
        found.summary == f"least at specimens left out: {best}; simplest within 5 % of it: constant"
    )
    assert found.facts == [("error", label), ("the data's own noise", noise)]
    assert found.figures == [("loads.png", "loads")]
    assert next(part for part in found.parts if isinstance(part, Charts)) is charts
    forms = result["forms"]
    for series, key in zip(chart.series, ("fitted", "cross_validated"), strict=False):
        assert series.y == pytest.approx([form[key] for form in forms], rel=1e-5)
    assert chart.x_names == tuple(f"{f['form']} ({f['coefficients']})" for f in forms)
    assert chart.level == noise
    assert found.files == [
        ("comparison.csv", "the table"),
        ("laws.png", "picture of the errors"),
        ("notes.csv", "what a reader of the numbers should know, note by note"),
        ("result.json", "all numbers, for programs"),
    ]
    assert found.warnings == [note.line for note in compared.notes]
    of = {note.of.split(",")[0] for note in compared.notes}
    assert of == {"constant", "linear"} and len(found.warnings) >= 4
    columns = [
        "moduli", "coefficients", "fitted", "cross_validated", "rms one: warp, N",
        "rms one: fill, N", "left out one: warp, N", "left out one: fill, N",
    ]  # fmt: skip
    cells = [
        [
            form["form"], form["coefficients"], form["fitted"], form["cross_validated"],
            *form["rms"].values(), *form["cross_validated_by_part"].values(),
        ]
        for form in result["forms"]
    ]  # fmt: skip
    assert found.tables == [
        Table(
            "Errors", columns, cells,
            "fitted: to all points; left out: at what the fits of the folds were not given",
        )
    ]  # fmt: skip
    table = pd.read_csv(run.out / "comparison.csv")
    assert list(table.columns) == columns
    for row, own in zip(table.to_numpy(dtype=object).tolist(), cells, strict=True):
        assert row[:2] == own[:2] and row[2:] == pytest.approx(own[2:])


def test_going_on_validates_nothing_twice(compared: LawComparison, run: Run) -> None:
    before = [form.folds for form in compared.forms]
    with pytest.raises(OutputError, match="--resume"):
        run.compare()
    again = run.compare(resume=True)
    assert [form.folds for form in again.forms] == before
    assert not any(isinstance(event, FoldError) for event in run.events)
    # Folds of another fit are made anew.
    path = run.out / "linear" / "validation.json"
    path.write_text(json.dumps({"of": "another", "folds": []}))
    again = run.compare(resume=True)
    assert [form.folds for form in again.forms] == before
    assert sum(isinstance(event, FoldError) for event in run.events) == 2
    written = json.loads(path.read_text())
    assert path.read_text() == json.dumps(written, indent=1) + "\n" and len(written["folds"]) == 2
    # Cut off after its first fold, only the second is made.
    path.write_text(json.dumps({**written, "folds": written["folds"][:1]}))
    again = run.compare(resume=True)
    assert [form.folds for form in again.forms] == before
    (fold,) = [event for event in run.events if isinstance(event, FoldError)]
    assert fold.to_json() == written["folds"][1]


def test_what_is_replaced_is_not_gone_on_with(run: Run, compared: LawComparison) -> None:
    """Cut off while it replaced all, it does not take an earlier fit for one of its own."""
    other = run.path.read_text().replace("seed = 7", "seed = 8")
    assert other != run.path.read_text()
    run.path.write_text(other)

    def stop(event: Any) -> None:
        if event == "constant":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compare_laws(bf.read_project(run.path), ["one"], FORMS, folds=5, starts=1, fold_starts=1,
                     out=run.out, progress=stop, overwrite=True)  # fmt: skip
    again = run.compare(resume=True)
    assert [form.fit.project.fit.seed for form in again.forms] == [8, 8]
