"""Plans of the next test: information of candidates in closed form, what cannot be computed."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.registry import kinds
from bubblefit.inference.linear import information_of
from bubblefit.inference.reported import UNKNOWN, moduli_sigmas
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.runs import plan as plan_module
from bubblefit.runs.optimum import find_optimum
from bubblefit.runs.plan import plan
from bubblefit.runs.simulation import FAILED

from ..builders.closed_forms import CARD, STRAIN
from ..builders.laws import TABLE_4_2
from ..builders.projects import STRIP_MODULI, known_bubble
from ..builders.unknowns import project as project_with_unknowns

# Packages of kinds have functions of the same names.
bubbles = import_module("bubblefit.experiments.bubble.planning")


strips = import_module("bubblefit.experiments.strips.prepared")


PLANNED_ENDS = (0.1, 0.1, 0.05)


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(bubbles, "USUAL", replace(bubbles.USUAL, elements=32))
    monkeypatch.setattr(bubbles, "CANDIDATES", replace(bubbles.CANDIDATES, angles=()))
    few = replace(strips.CANDIDATES, angles=(), increments=4)
    monkeypatch.setattr(strips, "CANDIDATES", few)


def named(made):
    return {planned.name: planned for planned in made.candidates}


def test_information_of_strips_is_closed_form(project, few, monkeypatch):
    monkeypatch.setattr(bubbles, "CANDIDATES", replace(bubbles.CANDIDATES, angles=(45.0,)))
    made = plan(project, CARD, strain=PLANNED_ENDS)
    sure = find_optimum(project, CARD, None).certainty
    for name in ("E1", "E2"):
        assert made.present.summary[name] == pytest.approx(sure.moduli[name].rms_sigma, rel=1e-9)
    assert made.present.words["G12"] == UNKNOWN
    # Three more specimens as those of the first test, of which there are two.
    more = named(made)["warp strip"]
    assert more.specimens == 3
    strain, law = STRAIN["one"], find_optimum(project, CARD, None).best.law
    off = np.concatenate(
        [20 * (m - float(law.E1(0.0))) * strain for m in STRIP_MODULI["one"]["warp"]]
    )
    scatter = project.tests["one"].strips["warp"].scatter
    noise = max(float(np.sqrt(np.mean(off**2))), scatter)
    levels = np.log1p(2.9 * np.arange(1, 5) / 4 / 20)
    value = noise * np.sqrt(2 * len(levels))
    added = 3 * np.sum((20 * levels) ** 2) / value**2 * float(law.E1(0.0)) ** 2
    before = made.present.summary["E1"] ** -2
    assert more.summary["E1"] == pytest.approx((before + added) ** -0.5, rel=2e-3)
    assert more.summary["E2"] == pytest.approx(made.present.summary["E2"], rel=1e-9)
    assert more.noise == f"{value:.3g} N at 4 values (that of one)"
    sheared = [p.name for p in made.candidates if p.words["G12"] != UNKNOWN]
    others = {name for name in sheared if not name.startswith("bubble")}
    assert (
        others == {"strip at 45 degrees", "torsion of a tube"}
        and "bubble, elliptic rim at 45 degrees" in sheared
    )
    worst = [float(f"{max(p.summary.values()):.2g}") for p in made.candidates]
    assert worst == sorted(worst) and made.candidates[0].name in sheared
    by_warp = plan(project, CARD, strain=PLANNED_ENDS, rank="E1")
    values = [float(f"{p.summary['E1']:.2g}") for p in by_warp.candidates]
    assert values == sorted(values) and by_warp.criterion.startswith("1 sigma of E1,")
    assert by_warp.following is not None and by_warp.following.summary["E1"] < values[0]
    # The card's valid range, but no further than the law; without one, the strains of the tests.
    monkeypatch.setattr(plan_module, "kinds", lambda: {"strips": kinds()["strips"]})
    limited = replace(CARD, law=replace(CARD.law, strain_range=np.array([0.09, 0.2, 0.03])))
    np.testing.assert_allclose(plan(project, limited).ends, [0.09, 0.14, 0.03])
    words = "is beyond the card's valid range of {} %: modulus held there"
    for strain, beyond in (
        (None, []),
        (
            PLANNED_ENDS,
            ["warp strain 10 % " + words.format(9), "shear strain 5 % " + words.format(3)],
        ),
    ):
        notes = plan(project, limited, strain=strain).notes
        assert [note for note in notes if "card's valid range" in note] == beyond
    reached = plan(project, CARD).ends
    np.testing.assert_allclose(reached[:2], np.log([22.9 / 20] * 2), rtol=1e-3)
    # After three more specimens along the warp three more again.
    again = plan(project, CARD, strain=PLANNED_ENDS, rank="E1").following
    assert again.name == "warp strip" and again.specimens == 3
    assert again.summary["E1"] == pytest.approx((before + 2 * added) ** -0.5, rel=2e-3)


def test_unknown_of_all_tests_limits_what_a_further_test_says(tmp_path, few):
    unknown = project_with_unknowns(tmp_path, "thickness.prior = 0.04")  # 5 % of 0.8 mm
    made = plan(unknown, CARD, strain=PLANNED_ENDS)
    for planned in made.candidates:
        assert min(planned.summary.values()) > 0.0499
    assert named(made)["biaxial 2:1"].summary["E1"] == pytest.approx(0.05, rel=0.01)


KNOWN = HypoelasticLaw(1000 * np.array(TABLE_4_2), strain_range=[0.1, 0.1, 0.08])


BUBBLE_CARD = MaterialCard(KNOWN, 0.81, "Table 4.2")


def test_repeated_test_adds_its_information(tmp_path, few):
    # So little noise that what is known before does not count.
    project = read_project(
        known_bubble(tmp_path, ('objective = "e"', 'objective = "e"\nnoise = 1e-3'))
    )
    found = find_optimum(project, BUBBLE_CARD, None)
    (comparison,) = found.problem.comparisons
    unknowns, law = found.problem.unknowns, found.best.law
    once, _ = information_of(comparison, law, unknowns)
    once = once / found.certainty.noise.correlated_count["bubble"]
    once = once * (comparison.objective.least_noise / found.certainty.noise.level["bubble"]) ** 2
    before = (found.certainty.corrected or found.certainty.posterior).covariance
    for options, times in (
        ({}, 1.0),
        # Twice noisier values say a quarter.
        ({"noise": {"bubble": 2 * found.certainty.noise.level["bubble"]}}, 0.25),
        # Four specimens say as much as four tests.
        ({"specimens": 4}, 4.0),
    ):
        made = plan(project, BUBBLE_CARD, **options)
        again = named(made)["the same bubble again"]
        assert ("(given)" in again.noise) == ("noise" in options)
        after = np.linalg.inv(np.linalg.inv(before) + times * once)
        _, sigma = moduli_sigmas(unknowns, law, made.ends, after)
        for name in ("E1", "E2"):
            assert again.summary[name] < made.present.summary[name]
            expected = np.sqrt(np.mean(sigma[name] ** 2))
            # To first order: G12 is not far from its bounds.
            assert again.summary[name] == pytest.approx(expected, rel=0.06)


def test_row_now_is_what_the_fit_reports(tmp_path, few):
    path = known_bubble(tmp_path, ("displacement_offset = false", "displacement_offset = true"),
                 ("pressure_offset = false", "pressure_offset = true"))  # fmt: skip
    project = read_project(path)
    made, found = plan(project, BUBBLE_CARD), find_optimum(project, BUBBLE_CARD, None)
    for name, modulus in made.present.moduli.items():
        value = found.best.law.modulus(name, modulus.strain)
        fit = found.certainty.moduli[name].at(modulus.strain, value)
        np.testing.assert_allclose(modulus.sigma, fit.sigma, rtol=0.02)
        np.testing.assert_allclose(modulus.band, fit.band, rtol=0.02)


def test_failed_candidate_is_left_out_and_named(project, few, monkeypatch):
    made, told = strips._computed, []

    def fails(name, *rest):
        if name == "fill strip":
            raise SolverFailure("no equilibrium", "membrane")
        return made(name, *rest)

    monkeypatch.setattr(strips, "_computed", fails)
    found = plan(project, CARD, strain=PLANNED_ENDS, progress=lambda *event: told.append(event))
    assert "fill strip" not in named(found)
    (failed,) = [note for note in found.notes if note.kind == FAILED]
    assert failed.of == "fill strip" and "no equilibrium" in failed
    assert [event[:2] for event in told] == [(k, len(told)) for k in range(len(told))]
    assert "fill strip" in [name for _, _, name in told]
