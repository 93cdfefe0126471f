"""runs/verdict.py: verdicts, and answers that quote the digits of moduli.csv."""

import io
import json
import re
from dataclasses import replace
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.fits import modulus_lines
from bubblefit.experiments.base import DIRECTIONS_MISSED
from bubblefit.experiments.bubble.findings import FLAT_SHEET
from bubblefit.experiments.cycles.evaluation import SLIP
from bubblefit.experiments.doubts import DOUBTFUL
from bubblefit.experiments.forward import BEYOND_CARD, UNSTABLE, Simulation
from bubblefit.inference.discrepancy import DISCREPANCY, LIKELY_CAUSE, Discrepancy, describe
from bubblefit.inference.noise import ABOVE_NOISE, Misfit, notes_of_misfits
from bubblefit.inference.reported import (
    BOUND,
    BOUND_WORDS,
    MARGIN,
    UNCERTAIN,
    UNKNOWN,
    ReportedModulus,
)
from bubblefit.materials.exports.base import band_table
from bubblefit.materials.forms.base import COMPONENTS, form_named
from bubblefit.materials.forms.symmetry import symmetric
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import Note
from bubblefit.project.project import read_project
from bubblefit.reports.fit_page import band_words
from bubblefit.runs.bootstrap import bootstrap
from bubblefit.runs.certainty import MESH
from bubblefit.runs.plan import plan
from bubblefit.runs.profile import profile
from bubblefit.runs.simulation import SimulatedTests
from bubblefit.runs.verdict import (
    NOT_CONVERGED,
    USABLE,
    answers,
    largest_error,
    state_of_predictions,
    usable_ranges,
    verdict_of,
    verdict_of_parameters,
)
from bubblefit.wording import percent

from ..builders.projects import constant_strips, known_bubble

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
    assert "bubblefit compare" in verdict.next_step
    # There are no laws to compare.
    wrong_form = verdict_of_parameters([], [Note(DISCREPANCY, "words")], {})
    for of_deck in (parameters, wrong_form):
        assert of_deck.next_step.startswith("look for wrong data (bubblefit check), then for what")


def test_parameters_of_decks_are_known_within_a_fifth_of_their_value():
    bands = {"C10": (500.0, 99.0), "C01": (0.5, 0.09), "D1": (-2.0, 0.41), "K": (3.0, 2.0)}
    verdicts = [
        SimpleNamespace(name=name, value=value, half_widths=(0.5 * half_width, half_width))
        for name, (value, half_width) in bands.items()
    ]
    verdict = verdict_of_parameters(verdicts, [], {})
    assert verdict.sentence.endswith(": C10, C01") and verdict.unknown == "D1, K"
    assert verdict.state == "usable within limits"
    assert verdict_of_parameters(verdicts[:2], [], {}).state == "usable"
    assert verdict_of_parameters(verdicts[2:], [], {}).state == "not to be used"


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


def test_error_that_is_no_number_is_the_largest():
    assert largest_error({}) is None
    assert largest_error({"a": 0.1, "b": 0.2}) == 0.2
    assert np.isnan(largest_error({"a": 0.1, "b": np.nan, "c": 0.2}))


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


MODULI = ("E1", "E2", "G12")


#: Strips, of which nothing shears: G12 has the band of its bounds; a bubble with a mesh error.
PROJECTS = {"strips": constant_strips, "bubble": known_bubble}


@pytest.fixture(scope="module", params=PROJECTS)
def reported(request, tmp_path_factory):
    """The project, its fit, and the folder of the fit."""
    folder = tmp_path_factory.mktemp(request.param)
    project = read_project(PROJECTS[request.param](folder)).with_fit(jobs=1)
    fit = bf.fit(project, starts=1)
    fit.report(folder / "out")
    return project, fit, folder / "out"


@pytest.fixture(scope="module")
def table(reported):
    return pd.read_csv(reported[2] / "moduli.csv")


def at(table, name, strain, column):
    own = table[table["modulus"] == name]
    return float(np.interp(strain, own["strain"], own[column]))


def rms(table, name):
    return float(np.sqrt(np.mean(table[table["modulus"] == name]["sigma_relative"] ** 2)))


def words_of(table, name, strain, value):
    """Return what a row of the terminal's table has to say of a value, from moduli.csv."""
    lower, upper, sigma = (
        at(table, name, strain, column) for column in ("lower_MPa", "upper_MPa", "sigma_relative")
    )
    low, high = (
        "*" * (at(table, name, strain, f"at_{end}_bound") > 0.5) for end in ("lower", "upper")
    )
    known = at(table, name, strain, "determined") > 0.5
    on_bound = "*" * bool((low and value <= lower) or (high and value >= upper))
    return [
        f"{value:.4g}{on_bound}",
        percent(sigma) if known else UNKNOWN,
        f"{lower:.4g}{low} to {upper:.4g}{high}",
    ]


def test_terminal_page_json_and_card_have_digits_of_table(reported, table):
    _, fit, folder = reported
    result = json.loads((folder / "result.json").read_text())
    page = (folder / "report.html").read_text()
    card = bf.read_card(folder / "material.toml")
    lines, rows = modulus_lines(fit), answers(fit.best, fit.thickness)
    assert (BOUND_WORDS in lines) == ("*" in "".join(lines[4:-1]))
    numbers = {name: iter(result["reported"][name]) for name in MODULI}
    for line, row in zip(lines[4:], rows, strict=False):
        name, strain = row.modulus, row.strain
        words = words_of(table, name, strain, float(fit.law.modulus(name, strain)))
        assert re.split(r"\s{2,}", line.split(" % ", 1)[1].strip())[:3] == words
        assert band_words(row) in page
        known = next(numbers[name])
        assert known["strain"] == strain and known["determined"] == row.determined
        # Between the strains of the table moduli are those of the law, and bands straight.
        for key, column in (("MPa", "MPa"), ("sigma", "sigma_relative")):
            assert known[key] == pytest.approx(at(table, name, strain, column), rel=2e-3)
        for end, column in zip(known["band"], ("lower_MPa", "upper_MPa"), strict=True):
            assert end == pytest.approx(at(table, name, strain, column), rel=1e-6)
        assert known["at_lower_bound"] == (at(table, name, strain, "at_lower_bound") > 0.5)
        of_card = [float(end[0]) for end in card.certainty.band(card.law, name, [strain])]
        assert of_card == pytest.approx(known["band"], rel=1e-5)
    for name in MODULI:
        own = table[table["modulus"] == name]
        known = result["uncertainty"]["largest_relative_sigma"][name]
        assert known == pytest.approx(own["sigma_relative"].max(), rel=1e-6)
    exported = pd.read_csv(io.StringIO(band_table(card, "MPa")), comment="#")
    for row in exported.itertuples(index=False):
        name, strain, value, lower, upper = row
        assert lower <= value * (1 + 1e-8) and value <= upper * (1 + 1e-8)
        assert lower == pytest.approx(at(table, name, strain, "lower_MPa"), rel=1e-3)
        assert upper == pytest.approx(at(table, name, strain, "upper_MPa"), rel=1e-3)


def test_band_is_no_narrower_than_sigma_and_encloses_modulus(table):
    assert (table["noise_relative"] <= table["sigma_relative"] * (1 + 1e-9)).all()
    width = table["upper_MPa"] - table["lower_MPa"]
    assert (width >= 2 * table["sigma_relative"] * table["MPa"] * (1 - 1e-9)).all()
    assert (table["lower_MPa"] <= table["MPa"]).all() and (table["MPa"] <= table["upper_MPa"]).all()
    both = table["at_lower_bound"] & table["at_upper_bound"]
    expected = (table["sigma_relative"] < 1.0) & ~both
    assert (table["determined"] == expected).all()


def test_studies_quote_moduli_of_fit(reported, table):
    project, fit, _ = reported
    ranked = plan(project, fit.card, specimens=1)
    for name, words in ranked.present.words.items():
        expected = rms(table, name)
        assert ranked.present.summary[name] == pytest.approx(expected, rel=2e-3)
        assert words in (percent(expected), UNKNOWN)
        for strain, sigma in zip(
            ranked.strains[name], ranked.sigma_at_strains(ranked.present)[name], strict=True
        ):
            assert sigma == pytest.approx(at(table, name, strain, "sigma_relative"), rel=5e-3)
    over = "specimens" if "one" in fit.tests else "frames"
    again = bootstrap(project, over, 2, fit.card)
    for name, (_, of_fit) in again.sigma.items():
        assert of_fit == pytest.approx(rms(table, name), rel=2e-3)
    (line,) = [line for line in again.lines() if line.startswith("1 sigma")]
    assert f"(fit {percent(rms(table, 'E1'))})" in line
    own = again.table()
    for column, of_table in (
        ("fit_MPa", "MPa"), ("fit_lower_MPa", "lower_MPa"), ("fit_upper_MPa", "upper_MPa"),
        ("fit_sigma_relative", "sigma_relative"),
    ):  # fmt: skip
        expected = [at(table, n, s, of_table) for n, s in own[["modulus", "strain"]].to_numpy()]
        np.testing.assert_allclose(own[column], expected, rtol=5e-3)
    found = profile(project, {"E1": [], "E2": [0.01]}, fit.card)
    for one in found.profiles:
        band = [at(table, one.modulus, one.strain, c) for c in ("lower_MPa", "upper_MPa")]
        assert one.band == pytest.approx(band, rel=2e-3)
        assert one.band[0] <= one.best <= one.band[1]
        assert one.best == pytest.approx(at(table, one.modulus, one.strain, "MPa"), rel=2e-3)
        sigma = at(table, one.modulus, one.strain, "sigma_relative")
        assert one.numbers["fit_sigma_MPa"] == pytest.approx(sigma * one.best, rel=5e-3)
        assert "(the fit's band {:.4g} to {:.4g})".format(*one.band) in one.words
