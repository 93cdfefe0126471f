"""The verdict of a fit: its state, the reasons in their order, what is usable, what is next."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.bubble.findings import FLAT_SHEET
from bubblefit.experiments.cycles.doubts import SLIP
from bubblefit.experiments.doubts import DOUBTFUL
from bubblefit.experiments.fitted import DIRECTIONS_MISSED
from bubblefit.experiments.forward import Simulation
from bubblefit.experiments.run_records import BEYOND_CARD, UNSTABLE
from bubblefit.inference.discrepancy import DISCREPANCY, LIKELY_CAUSE, Discrepancy, describe
from bubblefit.inference.noise import ABOVE_NOISE, Misfit, notes_of_misfits
from bubblefit.inference.reported import BOUND, MARGIN, UNCERTAIN, ReportedModulus
from bubblefit.materials.forms.base import COMPONENTS, form_named
from bubblefit.materials.forms.symmetry import symmetric
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import Note
from bubblefit.runs.certainty import MESH
from bubblefit.runs.simulation import SimulatedTests
from bubblefit.runs.verdict import (
    NOT_CONVERGED,
    USABLE,
    state_of_predictions,
    usable_ranges,
    verdict_of,
    verdict_of_parameters,
)

ALL = frozenset(COMPONENTS)


GOOD = dict.fromkeys(COMPONENTS, 0.1)


def best_with(half_widths, ends=(0.1, 0.1, 0.1)):
    """A best fit whose bands and sigmas are so wide: a number, or a function of the strain."""
    law = HypoelasticLaw.linear(600.0, 120.0, 15.0)
    moduli = {}
    for name, component in COMPONENTS.items():
        strain = np.linspace(0, ends[component], 101)
        off = half_widths[name]
        off = off(strain) if callable(off) else off + 0 * strain
        value, inside = law.modulus(name, strain), np.zeros(101, dtype=bool)
        lower, upper = value * np.array([1 - off, 1 + off])
        moduli[name] = ReportedModulus(strain, value, lower, upper, off, inside, inside)
    sure = SimpleNamespace(moduli=moduli)
    return SimpleNamespace(valid=np.array(ends), certainty=sure, law=law)


def judge(half_widths=GOOD, kinds=(), comparisons=("bubble",), fitted=ALL, ends=(0.1, 0.1, 0.1)):
    notes = [Note(kind, "words") for kind in kinds]
    misfit_of = dict.fromkeys(comparisons, Misfit(0.05, 0.05, "assumed", "mm"))
    return verdict_of(best_with(half_widths, ends), notes, misfit_of, fitted)


@pytest.mark.parametrize(
    ("off", "usable", "unknown", "words"),
    [
        (lambda x: 0.1 + 0 * x, (0.0, 0.1), None, "±20 % up to 10\u00a0% strain, E2"),
        (lambda x: 11 * x, (0.0, 0.018), (0.091, 0.1), "E1 from 9.1 to 10\u00a0% strain; any"),
        (lambda x: 2.0 - 19 * x, (0.095, 0.1), (0.0, 0.052), "E1 up to 5.2\u00a0% strain; any"),
        # A crossing is no stretch of strains.
        (lambda x: abs(x - 0.049) * 50 + 0.1, None, (0.067, 0.1), "±20 % at no strain, E2 up to"),
    ],
)
def test_modulus_is_usable_where_it_is_certain(off, usable, unknown, words):
    half_widths = {**GOOD, "E1": off}
    found = usable_ranges(best_with(half_widths))["E1"]
    assert found.usable == (usable and pytest.approx(usable, abs=6e-4))
    assert found.unknown == (unknown and pytest.approx(unknown, abs=1.1e-3))
    verdict = judge(half_widths)
    assert words in "\n".join(verdict.lines) and not verdict.reasons
    assert (verdict.state == "usable") == (usable == (0.0, 0.1))


def test_reasons_are_ordered_and_make_a_fit_unusable():
    # Faults of the data look like a wrong form, which comes last.
    limits = [BOUND, MARGIN, MESH, LIKELY_CAUSE, ABOVE_NOISE, UNSTABLE, DOUBTFUL, SLIP, DISCREPANCY]
    verdict = judge(kinds=[*reversed(limits), UNCERTAIN])
    # Two kinds of bounds are one reason.
    expected = [kind.objection.reason for kind in limits if kind is not MARGIN]
    assert list(verdict.reasons) == expected and verdict.state == "usable within limits"
    first, against, unknown, step = verdict.lines
    assert first.startswith("Usable within limits: E1 is known to ±20 % up to 10")
    assert against.startswith("Against it: bounds are reached; the error of the mesh")
    assert unknown == "Not known: any modulus beyond the strains that the tests reach."
    assert step == f"Next: {BOUND.objection.advice}."
    assert verdict.next_step == BOUND.objection.advice

    worst = judge(kinds=[BOUND, FLAT_SHEET, NOT_CONVERGED])
    assert worst.state == "not to be used"
    assert worst.lines == [
        "Not to be used: the fit has not converged; the sheet of a real bubble is taken for flat, "
        "so that its moduli are not to be believed; bounds are reached.",
        "Next: let it run longer: raise max_analyses in [fit], and fit again.",
    ]
    assert worst.numbers["sentence"] == worst.sentence
    assert worst.numbers["state"] == worst.state and worst.numbers["within"] == 0.2
    assert worst.numbers["reasons"] == list(worst.reasons)


def test_shear_modulus_is_not_usable_where_directions_are_missed():
    verdict = judge(kinds=[DIRECTIONS_MISSED, ABOVE_NOISE])
    assert verdict.state == "usable within limits" and verdict.sentence.endswith("G12 at no strain")
    assert verdict.reasons[0] == "the law cannot follow the directions of the strips"
    assert "spline-ratio" in verdict.next_step and "angle to the yarns" in verdict.next_step


def test_isotropic_law_that_misses_directions_has_no_shear_modulus_of_its_own_to_drop():
    best = best_with(GOOD)
    form = symmetric(form_named("constant", {}, [0.1] * 3), "isotropic", 0.3)
    best.law = SimpleNamespace(form=form)
    verdict = verdict_of(best, [Note(DIRECTIONS_MISSED, "words")], {}, ALL)
    assert verdict.state == "usable within limits" and [*verdict.moduli] == ["E1"]
    assert verdict.reasons == ("the law cannot follow the directions of the strips",)
    assert verdict.sentence == "E is known to ±20 % up to 10\u00a0% strain"


def test_fit_with_moduli_certain_nowhere_is_not_to_be_used():
    verdict = judge(dict.fromkeys(COMPONENTS, 0.5))
    assert verdict.state == "not to be used"
    assert "no modulus is known to ±20 % at any strain" in verdict.sentence
    law = SimpleNamespace(form=form_named("constant", {}, [0.1] * 3))
    unknown = SimpleNamespace(valid=np.full(3, 0.1), law=law, certainty=None)
    verdict = verdict_of(unknown, [], {}, ALL)
    assert verdict.state == "usable within limits" and "no derivatives" in verdict.lines[1]
    assert verdict.sentence == "the moduli have no bands" and "derivatives" in verdict.next_step


@pytest.mark.parametrize(
    ("half_widths", "comparisons", "fitted", "ends", "step"),
    [
        (GOOD, ["bubble"], ALL, (0.1, 0.1, 0.1), "bubblefit validate"),
        ({**GOOD, "G12": 0.5}, ["bubble"], ALL, (0.1, 0.1, 0.1), "45 degrees"),
        ({**GOOD, "G12": 0.5}, ["warp", "fill"], ALL, (0.1, 0.1, 1e-6), "45 degrees"),
        ({**GOOD, "G12": 0.5}, ["strips: bias"], ALL, (0.1, 0.1, 0.1), "would narrow G12"),
        ({**GOOD, "G12": 0.5}, ["s: 15 degrees"], ALL, (0.1, 0.1, 0.1), "would narrow G12"),
        # A law whose shear is given, and a strap, of which no test strains the fill.
        ({**GOOD, "G12": 0.5}, ["bubble"], {"E1", "E2"}, (0.1, 0.1, 0.1), "bubblefit validate"),
        ({"E1": 0.1, "E2": 9, "G12": 9}, ["strap"], ALL, (0.1, 1e-6, 1e-6), "bubblefit validate"),
        ({"E1": 0.5, "E2": 9, "G12": 9}, ["strap"], ALL, (0.1, 1e-6, 1e-6), "would narrow E1"),
    ],
)
def test_next_step_fits_the_project(half_widths, comparisons, fitted, ends, step):
    verdict = judge(half_widths, (), comparisons, fitted, ends)
    assert step in verdict.next_step


def test_misfit_of_many_times_the_noise_is_a_reason():
    misfits = {
        "bubble": Misfit(1.4, 0.05, "assumed", "mm"),
        "near": Misfit(0.2, 0.05, "assumed", "mm"),
        "tested": Misfit(1.4, 0.05, "given", "mm"),
        "exact": Misfit(1.4, 0.0, "assumed", "mm"),
    }
    (note,) = notes_of_misfits(misfits)
    assert note.line.startswith("bubble: the fit leaves 1.4 mm RMS, 28 times the noise (0.05 mm, ")
    assert verdict_of(best_with(GOOD), [note], misfits, ALL).reasons == (
        "the fit leaves more than the noise of the data",
    )


@pytest.mark.parametrize(
    ("share", "state"), [(0.04, "usable within limits"), (0.21, "not to be used")]
)
def test_verdict_says_by_how_much_a_fit_misses_what_it_was_made_of(share, state):
    misfit_of = {
        "strips: warp": Misfit(0.9, 1.0, "assumed", "N", share=0.5),
        "strips: bias": Misfit(33.0, 1.0, "assumed", "N", share=share),
        "strips: fill": Misfit(36.0, 1.0, "assumed", "N", share=0.01),
    }
    notes = notes_of_misfits(misfit_of)
    verdict = verdict_of(best_with(GOOD), notes, misfit_of, ALL)
    assert verdict.state == state and verdict.reasons == (
        f"the fit is off by {100 * share:.0f} % of the loads of strips: bias (RMS), 33 times their "
        "noise",
    )
    parameters = verdict_of_parameters([], notes, misfit_of)
    assert parameters.reasons == verdict.reasons


def test_modulus_on_its_bound_is_not_usable():
    best = best_with(GOOD)
    modulus = best.certainty.moduli["G12"]
    is_bounded = modulus.strain > 0.05
    best.certainty.moduli["G12"] = replace(
        modulus, upper=np.where(is_bounded, modulus.value, modulus.upper), at_upper_bound=is_bounded
    )
    assert usable_ranges(best)["G12"].usable == pytest.approx((0.0, 0.05))
    verdict = verdict_of(best, [Note(BOUND, "words")], {}, ALL)
    assert verdict.sentence.endswith("G12 up to 5\u00a0% strain")


@pytest.mark.parametrize("known", [False, True])
def test_unknown_sheet_is_not_advised_where_first_shape_is_known(known):
    discrepancy = Discrepancy(30.0, 2.0, 0.5, "mm", has_known_sheet=known)
    assert ("[bubble.sheet]" in describe(discrepancy)) == (not known)


@pytest.mark.parametrize(
    ("errors", "reasons", "state"),
    [
        ((), (), "usable"),
        ((0.05, USABLE), (), "usable"),
        ((0.05, 0.21), (), "usable within limits"),
        ((0.21, 0.3), (), "not to be used"),
        ((np.nan,), (), "not to be used"),
        ((0.05,), ("1 run is marked 'unstable'",), "usable within limits"),
        ((), ("1 run is marked 'unstable'",), "usable within limits"),
    ],
)
def test_prediction_is_usable_by_its_error_and_its_marks(errors, reasons, state):
    assert state_of_predictions(dict(enumerate(errors)), reasons) == state


def simulated(errors, notes=(), failures=None):
    simulations = {"strips": Simulation({}, errors=errors)}
    return SimulatedTests(None, "simulate", "membrane", simulations, failures or {}, 2, notes)


def test_simulation_says_which_card_is_far_off_and_which_runs_are_marked():
    notes = [Note(kind, "words") for kind in (UNSTABLE, BEYOND_CARD, UNSTABLE)]
    verdict = simulated({"soft": 0.05, "stiff": 0.34}, notes).verdict
    assert verdict.state == "usable within limits"
    assert verdict.sentence.endswith("errors of at most 34 % of the largest measured value")
    assert verdict.reasons == (
        "stiff is off by 34 % of the largest measured value, more than the 20 % that count as "
        "usable",
        "an analysis is marked 'beyond card range'",
        "an analysis is marked 'unstable'",
    )
    assert "charts" in verdict.next_step
    assert simulated({"stiff": 0.34}).verdict.state == "not to be used"
    assert simulated({}).verdict.lines == ["Usable: 2 of 2 analyses ended."]
    assert simulated({}, failures={"stiff": "no"}).verdict.state == "usable within limits"
