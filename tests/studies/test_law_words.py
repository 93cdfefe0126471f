"""What a comparison of forms says."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.materials.forms.polynomial import Polynomial
from bubblefit.notes import Note, NoteKind
from bubblefit.reports import law_page as law_words
from bubblefit.reports.law_page import conclusion, lines_of, table_of
from bubblefit.runs.compare import LOST, FoldError, FormFit, LawComparison, written_folds

RESULT = {
    "objective_is": "sum of RMS errors, N",
    "noise": 81.234,
    "forms": [
        {"form": "constant", "coefficients": 3, "fitted": 150.04, "cross_validated": 161.27},
        {"form": "cubic", "coefficients": 12, "fitted": 60.5, "cross_validated": None},
    ],
    "least_cross_validated": "constant",
    "simplest_as_good": "constant",
}


def test_lines_for_the_terminal() -> None:
    assert lines_of(RESULT) == [
        "error: sum of RMS errors, N",
        "moduli       coefficients      fitted   cross-validated",
        "constant                3         150             161.3",
        "cubic                  12        60.5     a fold failed",
        "the data's own noise: 81.23",
        "least at specimens left out: constant; simplest within 5 % of it: constant",
    ]


def test_without_a_fold_that_ended_there_is_no_conclusion() -> None:
    assert conclusion({**RESULT, "simplest_as_good": None}) == []


def test_folds_of_another_fit_are_not_taken(tmp_path: Path) -> None:
    path = tmp_path / "validation.json"
    path.write_text(json.dumps({"of": "this", "folds": []}))
    assert written_folds(path, "this") == {}
    first = {"fold": 1, "value": 0.5, "rms": {}}
    path.write_text(json.dumps({"of": "this", "folds": [first]}))
    assert written_folds(path, "this") == {1: FoldError(**first)}
    assert written_folds(path, "another") == {}
    path.write_text(json.dumps({"of": "this", "folds": [{"colour": 1}]}))
    assert written_folds(path, "this") == {}
    path.write_text("{")
    assert written_folds(path, "this") == {} and written_folds(tmp_path / "none", "this") == {}


class Form(FormFit):
    """A form whose fit to all points is made up."""

    coefficients, fitted, rms = 0, 3.0, {"warp": 2.0, "fill": 4.0}  # type: ignore[assignment]


def form(name: str, coefficients: int, *folds: float | None) -> Form:
    """Its errors in the folds; by part a half and a quarter of them."""
    unit = SimpleNamespace(unit="N")
    law = SimpleNamespace(form=Polynomial(0))
    problem = SimpleNamespace(
        comparisons=[SimpleNamespace(name=part, objective=unit) for part in ("warp", "fill", "b")]
    )
    fit: Any = SimpleNamespace(
        law=law, problem=problem, objective=9.0, notes=[Note(NoteKind.SNAP, "snaps", "warp")],
        project=SimpleNamespace(title="made"),
        setup=SimpleNamespace(tests=[], objective_is="error"),
        best=SimpleNamespace(ranked=[SimpleNamespace(objective=9.0)]),
    )  # fmt: skip
    errors = tuple(
        FoldError(k, value, {} if value is None else {"warp": value / 2, "fill": value / 4})
        for k, value in enumerate(folds)
    )
    own = Form(name, fit, errors, ("warp", "fill"))
    object.__setattr__(own, "coefficients", coefficients)
    return own


@pytest.fixture
def no_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    every = {"warp": 0.5, "fill": 0.25, "b": 7.0}
    monkeypatch.setattr(law_words, "noise_of", lambda problem: every)


@pytest.mark.usefixtures("no_noise")
def test_the_simplest_form_that_is_as_good() -> None:
    """Within a twentieth of the least error; a form that lost a fold is not judged."""
    forms = [
        form("cubic", 12, 99.0, 101.0),
        form("linear", 6, 104.0, 105.8),
        form("constant", 3, 105.0, 105.2),
        form("quadratic", 9, 1.0, None),
    ]
    result = LawComparison(tuple(forms), 2).result
    assert result["least_cross_validated"] == "cubic"
    assert result["simplest_as_good"] == "linear"
    assert (result["noise"], result["noise_by_part"]) == (0.75, {"warp": 0.5, "fill": 0.25})
    assert result["units"] == {"warp": "N", "fill": "N"}
    first, *_, last = result["forms"]
    assert first["cross_validated"] == 100.0 and first["folds"] == [99.0, 101.0]
    assert first["cross_validated_by_part"] == {"warp": 50.0, "fill": 25.0}
    assert last["cross_validated"] is None and last["folds"] == [1.0, None]
    assert last["cross_validated_by_part"] == {"warp": None, "fill": None}
    table = table_of(LawComparison(tuple(forms), 2))
    assert table["cross_validated"].tolist()[:3] == pytest.approx([100.0, 104.9, 105.1])
    assert math.isnan(table["cross_validated"][3]) and np.isnan(table["left out warp, N"][3])
    assert table["left out fill, N"].tolist()[:2] == pytest.approx([25.0, 26.225])
    assert table["rms fill, N"].tolist() == [4.0] * 4
    lost = LawComparison(tuple(forms[3:]), 2).result
    assert lost["least_cross_validated"] is None and lost["simplest_as_good"] is None


def test_a_fold_that_was_lost_is_told_by_its_number() -> None:
    forms = form("constant", 3, 1.0, 2.0), form("cubic", 12, None, 1.0, None)
    said = [(note.kind, note.line) for note in LawComparison(forms, 2).notes]
    assert said == [
        (NoteKind.SNAP, "constant, warp: snaps"),
        (NoteKind.SNAP, "cubic, warp: snaps"),
        (NoteKind.FOLD, f"cubic, fold 1: {LOST}"),
        (NoteKind.FOLD, f"cubic, fold 3: {LOST}"),
    ]
