"""inference/reported.py: band and sigma of a modulus within the bounds of a fit."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.inference.posterior import Posterior
from bubblefit.inference.reported import (
    BOUND,
    UNKNOWN,
    ReportedModulus,
    moduli_error,
    notes_on_box,
    reported_moduli,
    sigma_words,
    sigma_words_of,
    uncertain_words,
)
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.law import HypoelasticLaw
from hypothesis import given, settings
from hypothesis import strategies as st

from .cases import CONSTANT

RANGES = {"E1": (50.0, 1500.0), "E2": (50.0, 1500.0), "G12": (1.0, 100.0)}
STRAINS = {name: np.array([0.0, 0.05]) for name in RANGES}
ENDS = [0.1, 0.1, 0.1]
CUBIC = Unknowns.of(form_named("cubic", {}, ENDS), 0.24, ENDS, LawBounds.of_moduli(RANGES))


def reported(moduli, relative, law=None):
    """Return what is reported of constants G12, E2, E1, each with a relative standard deviation."""
    y = CONSTANT.at(np.array(moduli))
    law = law or HypoelasticLaw.linear(*moduli[::-1])
    posterior = Posterior(CONSTANT, y, y, np.diag(y * np.array(relative)) ** 2)
    return reported_moduli(posterior, law, STRAINS)


def test_unbounded_modulus_has_sigma_and_band_of_the_normal_distribution():
    found = reported([12.0, 250.0, 400.0], [0.08, 0.02, 0.01])
    for name, value, sigma in (("G12", 12.0, 0.08), ("E2", 250.0, 0.02), ("E1", 400.0, 0.01)):
        modulus = found[name]
        assert modulus.sigma == pytest.approx([sigma] * 2, rel=5e-3)
        ends = value * (1 + 1.96 * sigma * np.array([-1.0, 1.0]))
        assert (ends - value) / (modulus.band[:, 0] - value) == pytest.approx([1.0] * 2, rel=5e-3)
        assert modulus.determined.all()
        assert not (modulus.at_lower_bound | modulus.at_upper_bound).any()


def test_modulus_on_its_bound_has_half_a_normal_distribution_and_says_so():
    least = CONSTANT.modulus_limits("G12", np.zeros(1), -1.0)[0]
    found = reported([least, 250.0, 400.0], [0.2, 0.02, 0.01])["G12"]
    assert found.lower == pytest.approx([least] * 2) and found.at_lower_bound.all()
    assert found.on_lower_bound.all() and not found.at_upper_bound.any()
    assert found.upper / least - 1 == pytest.approx([2.241 * 0.2] * 2, rel=0.01)
    # Of half a normal distribution 84 % are within 1.41 standard deviations.
    assert found.sigma == pytest.approx([1.41 * 0.2 / 2] * 2, rel=0.01)
    found = reported([least * (1 + 3 * 0.2), 250.0, 400.0], [0.2 / 1.6, 0.02, 0.01])["G12"]
    assert not (found.at_lower_bound | found.on_lower_bound).any()


def test_band_from_bound_to_bound_is_not_determined_however_small_its_sigma():
    found = reported([12.0, 250.0, 1000.0], [0.08, 0.02, 10.0])["E1"]
    assert found.at_lower_bound.all() and found.at_upper_bound.all()
    assert not found.on_lower_bound.any() and not found.on_upper_bound.any()
    assert (found.sigma < 1.0).all() and not found.determined.any()
    assert sigma_words_of(found.numbers) == (UNKNOWN, UNKNOWN)
    assert uncertain_words("E1", found, "with noise").startswith("E1 is not determined at any ")


def test_sigma_from_the_limit_on_is_shown_without_percentage():
    assert [sigma_words(s) for s in (0.083, 0.994, 1.0, 95.91, np.nan)] == [
        "8.3 %", "99 %", UNKNOWN, UNKNOWN, UNKNOWN,
    ]  # fmt: skip
    assert sigma_words(0.1, True) == UNKNOWN


def test_law_outside_its_distribution_lies_on_an_end_that_is_no_bound():
    """A mesh error that is not taken out: the band reaches from the law to the finer moduli."""
    law = HypoelasticLaw.linear(600.0, 250.0, 12.0)
    found = reported([12.0, 250.0, 400.0], [0.08, 0.02, 0.01], law)["E1"]
    assert found.upper == pytest.approx([600.0] * 2) and not found.at_upper_bound.any()
    assert (found.sigma > 0.5 * (600.0 - 404.0) / 600.0).all()


@settings(max_examples=10, deadline=None)
@given(
    values=st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3),
    sigma=st.floats(-3.0, 1.5),
    shift=st.floats(-3.0, 3.0),
    seed=st.integers(0, 10**6),
)
def test_value_lies_in_its_band_and_the_band_holds_the_sigma_range(values, sigma, shift, seed):
    """Whatever is known of a cubic law, with its centre outside of the bounds or inside."""
    least, largest = CUBIC.bounds.at_control_strains(CUBIC.form)
    shares = np.repeat(values, 4)  # anywhere within the bounds, or on them
    y = CUBIC.at(CUBIC.from_values @ (least + (largest - least) * shares))
    root = np.random.default_rng(seed).standard_normal((12, 12)) * 10.0**sigma
    posterior = Posterior(CUBIC, y, y + shift * root[:, 0], root @ root.T)
    law = CUBIC.law(HypoelasticLaw(np.zeros(12), 0.24, np.array(ENDS)), y)
    strains = {name: np.linspace(0.0, 0.1, 5) for name in RANGES}
    for name, modulus in reported_moduli(posterior, law, strains).items():
        low, high = RANGES[name]
        assert (modulus.lower >= low - 1e-6 * high).all() and (modulus.upper <= high + 1e-6).all()
        inside = (modulus.lower <= modulus.value) & (modulus.value <= modulus.upper)
        assert inside.all()
        assert (modulus.upper - modulus.lower >= 2 * modulus.sigma * modulus.value - 1e-9).all()
        between = modulus.at(np.array([0.03, 0.07]), law.modulus(name, np.array([0.03, 0.07])))
        room = between.upper - between.lower - 2 * between.sigma * between.value
        assert (room >= -1e-9).all()
        assert ((between.lower <= between.value) & (between.value <= between.upper)).all()
        # An end that is marked is one of what the bounds allow there.
        room = 0.071 * (modulus.upper - modulus.lower)
        least, most = (CUBIC.modulus_limits(name, strains[name], sign) for sign in (-1.0, 1.0))
        assert ((modulus.lower - least <= room) | ~modulus.at_lower_bound).all()
        assert ((most - modulus.upper <= room) | ~modulus.at_upper_bound).all()


def test_reported_between_strains_is_interpolated_about_the_law():
    modulus = ReportedModulus(
        np.array([0.0, 0.1]), np.array([10.0, 20.0]), np.array([8.0, 18.0]), np.array([13.0, 24.0]),
        np.array([0.1, 0.1]), np.array([True, False]), np.array([False, True]),
    )  # fmt: skip
    found = modulus.at(np.array([0.0, 0.025, 0.1]), np.array([10.0, 12.0, 20.0]))
    assert found.lower == pytest.approx([8.0, 10.5, 18.0])
    assert found.upper == pytest.approx([13.0, 15.75, 24.0])
    assert found.sigma == pytest.approx([0.1, 1.25 / 12.0, 0.1])
    assert found.at_lower_bound.tolist() == [True, True, False]
    assert modulus.rms_sigma == pytest.approx(0.1)
    lost = replace(modulus, sigma=np.array([0.1, 1.5]))
    assert lost.numbers["not_determined"] == 0.5
    assert sigma_words_of(lost.numbers) == ("80 %", UNKNOWN)


def test_moduli_error_looks_at_every_strain_reached():
    breaks = [[0.03, 0.06]] * 3
    known = HypoelasticLaw.trilinear([300.0] * 3, [220.0] * 3, [4.0] * 3, breaks)
    e1, e2, g12 = [300.0, 330.0, 300.0], [231.0, 220.0, 220.0], [4.0, 4.0, 5.0]
    law = HypoelasticLaw.trilinear(e1, e2, g12, breaks)
    whole = moduli_error(law, known, np.array([0.1, 0.1, 0.1]))
    assert whole == pytest.approx({"E1": 0.1, "E2": 0.05, "G12": 0.25})
    part = moduli_error(law, known, np.array([0.02, 0.02, 0.05]))
    assert part == pytest.approx({"E1": 0.0, "E2": 0.05, "G12": 0.0})


def test_value_lies_on_bound_within_a_millionth_of_the_width():
    values = np.array([2.0 + 1e-6, 2.0 + 3e-6, 4.0 - 1e-6, 4.0 - 3e-6, 3.0])
    notes = notes_on_box("abcde", values, np.full(5, 2.0), np.full(5, 4.0))
    assert [str(note)[:19] for note in notes] == ["a lies on its lower", "c lies on its upper"]
    assert {note.kind for note in notes} == {BOUND}
