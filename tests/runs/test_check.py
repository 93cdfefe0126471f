"""Checks before a fit: the moduli that the bounds lead one to expect."""

from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.inference.unknowns import LawBounds
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs.check import NOTHING, PredictionCheck, expected_of

from ..builders.projects import constant_strips

LAW = HypoelasticLaw.linear(600.0, 120.0, 15.0)


LEAST = {"E1": 5.0, "E2": 6.0, "G12": 0.5}


def test_expected_moduli_follow_from_bounds():
    def expected(bounds):
        return dict(expected_of(SimpleNamespace(bounds=bounds, law=LAW)).moduli)

    ranges = {"E1": (20.0, 2000.0), "E2": (20.0, 1000.0), "G12": (0.5, 200.0)}
    assert expected(LawBounds.of_moduli(ranges)) == ranges
    free = list(LAW.form.free)
    lower, upper = 0.5 * LAW.beta[free], 2.0 * LAW.beta[free]
    found = expected(LawBounds(LEAST, None, lower, upper))
    soft = expected(LawBounds(LEAST, None, -upper, lower))
    for name, value in (("E1", 600.0), ("E2", 120.0), ("G12", 15.0)):
        np.testing.assert_allclose(found[name], (0.5 * value, 2.0 * value))
        np.testing.assert_allclose(soft[name], (LEAST[name], 0.5 * value))
    none = expected(LawBounds(LEAST, None, -upper, -lower))
    assert none == {name: (least, least) for name, least in LEAST.items()}


@pytest.mark.parametrize(
    ("count", "words"),
    [(0, ""), (1, " and 1 file with measured loads"), (3, " and 3 files with measured loads")],
)
def test_files_of_tests_that_are_predicted_are_counted(count, words):
    file = SimpleNamespace(dropped={"incomplete": 2}, source=SimpleNamespace(notes=["N, not kN"]))
    test = SimpleNamespace(name="bent", data_files=lambda: [file] * count, seen=["a choice"])
    (row, *notes) = PredictionCheck(None, (test,)).rows()
    text = f"its section and its models{words} were read; it is predicted, not fitted"
    assert row == ("bent", "fine", "", text)
    left_out = ["N, not kN", f"rows of the files left out: {2 * count} incomplete"]
    expected = [*left_out * bool(count), "a choice"]
    assert notes == [("bent", "note", "", words) for words in expected]


def test_each_test_has_a_row_in_what_a_check_shows(tmp_path):
    check = bf.check(bf.read_project(constant_strips(tmp_path)))
    findings = check.findings
    assert set(findings) == {"one", "two"}
    shown = {name: [row[1:] for row in check.rows() if row[0] == name] for name in findings}
    for name, rows in findings.items():
        assert set(rows or [("fine", "", NOTHING)]) <= set(shown[name])
