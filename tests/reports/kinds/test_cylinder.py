"""reports/kinds/cylinder: lines, tables and figures of bent cylinders."""

from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.reports.kinds import cylinder
from bubblefit.reports.kinds.cylinder import assumptions, how_sure


def outcome(spreads=None, unsure=(), band=("wall",)):
    ends = [SimpleNamespace(name=name, meaning=f"meaning of {name}") for name in band]
    bent = [SimpleNamespace(load=np.array([10.0, 200.0])) for _ in range(2)]
    return SimpleNamespace(spreads=spreads or {}, bent=bent, unsure=unsure, band=ends)


def cylinders(*assumed):
    return [SimpleNamespace(name=f"tube {k}", assumed=words) for k, words in enumerate(assumed, 1)]


def test_spread_of_cards_is_the_largest_share_of_the_load():
    spreads = {0: np.array([1.0, 20.0, np.nan]), 1: np.array([np.nan, np.nan])}
    (line,) = how_sure(outcome(spreads))
    assert "up to 10 % of the largest (one standard deviation)" in line


def test_runs_without_spread_have_no_sentence():
    assert how_sure(outcome({1: np.array([np.nan])})) == []


def test_walls_of_the_band_and_doubts_are_named():
    lines = how_sure(outcome(unsure=["the knee is uncertain"], band=("slack", "rigid")))
    assert lines[0] == "The knee is uncertain."
    assert "slack: meaning of slack; rigid: meaning of rigid" in lines[1]


def test_assumptions_are_one_list_that_names_tests_unless_all_share_it():
    head, listed = assumptions(cylinders(["collar", "seam"], ["collar"]))
    assert head.lines == ["Assumed, as the project does not say:"] and listed.bulleted
    assert listed.lines == ["the usual collar", "the usual seam, for tube 1"]
    assert assumptions(cylinders([])) == []


@pytest.mark.parametrize(
    ("row", "sentence"),
    [
        (
            ["high", "soft", 40, "38 to 42", 300, "", 20, "none", "", ""],
            "high, soft: stiffness 40 (38 to 42) N/mm, knee at 300 N and 20 mm, limit point none",
        ),
        (
            ["high", "soft", 40, "", 300, "290 to 310", 20, 500, "", 90],
            "high, soft: stiffness 40 N/mm, knee at 300 (290 to 310) N and 20 mm, "
            "limit point at 500 N and 90 mm",
        ),
    ],
)
def test_row_of_stiffness_and_knee_is_a_sentence(row, sentence):
    assert cylinder._sentence(row) == sentence
