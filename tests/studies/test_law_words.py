"""What a comparison of forms says."""

from __future__ import annotations

import json
from pathlib import Path

from bubblefit.studies.fold_record import written_folds
from bubblefit.studies.law_words import conclusion, lines_of

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
    assert written_folds(path, "this") == ()
    assert written_folds(path, "another") is None
    path.write_text(json.dumps({"of": "this", "folds": [{"colour": 1}]}))
    assert written_folds(path, "this") is None
    path.write_text("{")
    assert written_folds(path, "this") is None and written_folds(tmp_path / "none", "this") is None
