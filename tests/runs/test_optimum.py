"""The optimum of a study's card: bounds of the project, and what studies refuse."""

import bubblefit
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import Verdict
from bubblefit.project.project import read_project
from bubblefit.runs.bootstrap import bootstrap
from bubblefit.runs.optimum import CardOptimum, find_optimum
from bubblefit.runs.plan import plan
from bubblefit.runs.profile import profile
from bubblefit.runs.refinement import vary_nu12
from bubblefit.runs.weight_study import weights

from ..builders.closed_forms import CARD, PROFILED
from ..builders.projects import constant_strips
from ..support.commands import in_process
from ..support.refusals import complaint_with, raised

OTHER_FORM = MaterialCard(HypoelasticLaw(np.ones(12)), 0.8, "cubic")


OVER = {"over": "specimens", "card": CARD, "tests": "one"}


BAD = [
    (bootstrap, OVER | {"over": "frames"}, "--over: .* frames"),
    (bootstrap, OVER | {"over": "tests"}, "--over: .* two tests or more"),
    (bootstrap, OVER | {"samples": 1}, "samples: expected int of 2 or more, got 1"),
    (profile, {"card": PROFILED, "moduli": {"G23": []}}, "--modulus: .* E1, E2, G12, got 'G23'"),
    (profile, {"card": PROFILED, "moduli": {"E1": [-0.1]}}, "--modulus: .* got -0.1"),
    (profile, {"card": PROFILED, "moduli": {"E1": [0.3]}}, "E1 is fitted up to 12 %.*; got 30 %"),
    (profile, {"card": OTHER_FORM}, "of this project's"), (profile, {"card": None}, "fit first"),
    (plan, {"card": CARD, "rank": "G23"}, "--rank: .* worst, E1, E2, G12, got 'G23'"),
    (plan, {"card": CARD, "noise": {"strips": 0.0}}, "--noise: .* above 0, KIND of: "),
    (plan, {"card": CARD, "noise": {"torsion": 1.0}}, "--noise: .* got torsion=1"),
    (plan, {"card": CARD, "strain": (0.1, 0.1)}, "--strain: "),
    (plan, {"card": CARD, "strain": (0.1, 0.0, 0.1)}, "--strain: "),
    (plan, {"card": None}, "fit first"), (vary_nu12, {"card": CARD, "values": [-1e-9]}, "--nu12"),
    (vary_nu12, {"card": CARD, "values": [1.0]}, "--nu12"),
    (weights, {"counted": "strips"}, r"--weights: .* strips, one, two; got"),
    (weights, {"counted": "three"}, r"--weights: .* strips, one, two; got"),
]  # fmt: skip


@pytest.mark.parametrize(("study", "given", "said"), BAD)
def test_impossible_settings_of_studies_are_refused(project, study, given, said):
    raised(InputError, said, study, project, **given)


def test_study_of_a_fit_not_to_be_used_says_so_at_its_top(project, tmp_path, monkeypatch):
    fit = Verdict("not to be used", "it is off", ("it is off",), next_step="measure again")
    monkeypatch.setattr(CardOptimum, "fit_verdict", fit)
    reason = "the fit is not to be used: it is off"
    for study, given in (
        (bootstrap, OVER | {"samples": 2}),
        (profile, {"card": PROFILED, "moduli": {"E1": [0.05]}}),
        (plan, {"card": CARD}),
    ):
        out = tmp_path / study.__name__
        result = study(project, **given, out=out)
        verdict = result.verdict
        plans = study is plan  # of a further test, by which the fit may become usable
        state = "usable within limits" if plans else "not to be used"
        assert (verdict.state, verdict.reasons[0]) == (state, reason)
        assert result.result["verdict"]["reasons"] == list(verdict.reasons)
        assert " ".join(result.lines()).count(reason) == 1
        page = (out / "report.html").read_text()
        assert page.count(reason) == 1 and page.index(reason) < page.index("<h2")
        assert (verdict.next_step == "measure again") != plans


def test_verdict_of_the_fit_in_a_study_is_that_of_its_own_page(project):
    fit = bubblefit.fit(project, "one", starts=1)
    optimum = find_optimum(project, fit.card, "one")
    assert optimum.fit_verdict == fit.verdict


#: Bounds on coefficients (GPa): G12, E2, E1.
COEFFICIENTS = (
    "E1 = [0.02, 2.0]\nE2 = [0.03, 1.0]\nG12 = [0.005, 0.2]",
    "lower = [0.005, 0.03, 0.02]\nupper = [0.2, 1.0, 2.0]",
)


def linear_card(*moduli):
    return MaterialCard(HypoelasticLaw.linear(*moduli, 0.0), 0.8, "a card")


@pytest.mark.parametrize(
    ("moduli", "words"),
    [
        ((2500.0, 190.0, 10.0), ("E1 at 0 % of strain is 2500 MPa, above", "bound of 2000 MPa")),
        ((330.0, 20.0, 10.0), ("E2 at 0 % of strain is 20 MPa, below", "bound of 30 MPa")),
        ((330.0, 190.0, 4.9), ("G12 at 0 % of strain is 4.9 MPa, below", "bound of 5 MPa")),
    ],
)
def test_card_with_modulus_beyond_bound_is_refused(tmp_path, moduli, words):
    project = read_project(constant_strips(tmp_path))
    named = ("project.toml", "--card", *words)
    complaint_with(named, find_optimum, project, linear_card(*moduli), "one")


@pytest.mark.parametrize(
    ("moduli", "words"),
    [
        ((2500.0, 190.0, 10.0), ("beta_11 is 2500 MPa, above", "bound of 2000 MPa")),
        ((330.0, 29.0, 10.0), ("beta_7 is 29 MPa, below", "bound of 30 MPa")),
    ],
)
def test_card_with_coefficient_beyond_bound_is_refused(tmp_path, moduli, words):
    project = read_project(constant_strips(tmp_path, COEFFICIENTS))
    complaint_with(("--card", *words), find_optimum, project, linear_card(*moduli), "one")


def test_card_on_bound_but_for_rounding_is_accepted(tmp_path):
    project = read_project(constant_strips(tmp_path))
    assert find_optimum(project, linear_card(330.0, 190.0, 4.9999), "one").best.law.E1(0.0) > 0


@pytest.mark.parametrize("command", ["profile", "plan", "bootstrap"])
def test_studies_exit_with_2_for_card_beyond_bounds(tmp_path, command):
    constant_strips(tmp_path)
    write_card(linear_card(2500.0, 190.0, 10.0), tmp_path / "far.toml")
    over = ("--over", "specimens") if command == "bootstrap" else ()
    refused = in_process(
        command, "project.toml", "--card", "far.toml", "--test", "one", *over, cwd=tmp_path, code=2
    )
    (line,) = refused.stderr.strip().splitlines()
    assert "E1 at 0 % of strain is 2500 MPa, above the bound of 2000 MPa" in line
