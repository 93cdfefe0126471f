"""Runs that snap or leave their card's range are marked wherever they stand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import Note, NoteKind
from bubblefit.project.project import read_project
from bubblefit.runs.predictions import predict
from bubblefit.solvers import registry

from ..cylinder_cases import Formula, write_project

SNAPS = Note(NoteKind.SNAP, "snaps, or nearly, before 20 mm of deflection")


class Snapping(Formula):
    """The tubes of 140 kPa snap."""

    def run(self, model, *arguments, **named):
        history = super().run(model, *arguments, **named)
        return replace(history, remarks=(SNAPS,)) if model.pressure > 0.1 else history


def test_marks_stand_wherever_a_run_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(registry.SOLVERS, "formula", Snapping)
    law = HypoelasticLaw.linear(500.0, 150.0, 20.0)
    short = replace(law, strain_range=np.array([0.3, 0.01, 0.3]))
    cards = {"wide": MaterialCard(law, 0.81), "short": MaterialCard(short, 0.81)}
    done = predict(read_project(write_project(tmp_path)), cards=cards, jobs=1)
    done.report(tmp_path / "out")
    expected = [[], ["beyond card range"], ["snap"], ["beyond card range", "snap"]]
    assert [run["marks"] for run in done.result["runs"]] == expected
    table = pd.read_csv(tmp_path / "out" / "runs.csv", keep_default_na=False)
    assert table["marks"].tolist() == ["; ".join(marks) for marks in expected]
    rows = [line for line in done.lines() if "kPa  " in line or line.startswith("high")]
    for row, marks in zip(rows, expected, strict=True):
        assert row.endswith(f"[{', '.join(marks)}]") if marks else "[" not in row
    page = (tmp_path / "out" / "report.html").read_text().replace("\u00a0", " ")
    for words in ("beyond card range, snap</td>", "Marked &#39;snap&#39;: 2"):
        assert words in page
    notes = pd.read_csv(tmp_path / "out" / "notes.csv", keep_default_na=False)
    assert notes.to_dict("records") == done.result["notes"]
    assert (notes["kind"] == "snap").sum() == 2 == (notes["kind"] == "beyond card range").sum()
