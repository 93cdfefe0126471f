"""inference/nuisance_fit.py: nuisance fitted to a given law, and what the data say of it."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.inference.linear import posteriors_of
from bubblefit.inference.noise import Noise
from bubblefit.inference.nuisance_fit import (
    NuisanceVerdict,
    fit_nuisance,
    notes_of_verdicts,
    verdicts,
)

from .cases import (
    EVERYTHING,
    LAW,
    MODEL,
    NU12,
    THICKNESS,
    Failing,
    bubble_and_strip,
    bubble_problem,
    clean_fit,
)


def test_evaluated_law_keeps_its_coefficients_and_fits_nuisance_alone():
    shift, offset = np.array([0.2, -0.1, 1.0]), 0.003
    fit = clean_fit(MODEL, LAW, EVERYTHING, shift, {"pressure_offset": offset})
    y = EVERYTHING.at(LAW.beta)
    best = fit_nuisance(fit, y)[0]
    assert best.value < 1e-6 and (best.unknowns[:12] == y[:12]).all()
    assert best.unknowns[12:] == pytest.approx([*shift, 1e3 * offset], abs=1e-3)
    # Nothing but the law is unknown, or the solver cannot tell where to go: as it is, from rest.
    plain = bubble_problem(noise=0.02)
    at_rest = plain.evaluate(y[:12], False, warm=False).value
    assert fit_nuisance(plain, y[:12])[0].value == pytest.approx(at_rest, rel=1e-12)
    fit.comparisons[0].solver = Failing(lambda run: True)
    assert fit_nuisance(fit, y)[0] is None


def test_nuisance_of_a_given_law_makes_the_sum_of_norms_least():
    """Least squares, which come first, split what the thickness alone makes up for, 0.8 / 1.3."""
    fit = bubble_and_strip(THICKNESS)
    best, status = fit_nuisance(fit, fit.unknowns.at(LAW.beta * 1.3))
    assert status == "converged"
    assert best.unknowns[12:] == pytest.approx([0.8 / 1.3, 0.0, 0.0], abs=1e-5)


ENDS = np.array([0.1, 0.1, 0.05])


@pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
def test_only_moduli_times_thickness_is_determined(thickness_change):
    """Softer moduli of a thicker sheet change nothing at all, whatever its thickness does."""
    law = replace(LAW, thickness_change=thickness_change)
    point, posterior = evaluated(bubble_and_strip(NU12, replace(THICKNESS, prior=None), law=law))
    j, y = point.jacobian, point.unknowns
    along = j[:, :12] @ y[:12]
    assert np.abs(along).max() > 0.1
    np.testing.assert_allclose(along, y[13] * j[:, 13], rtol=0, atol=1e-9 * np.abs(along).max())
    nu12, thick, *_ = verdicts(posterior, ENDS)
    assert nu12.determined and not thick.determined
    assert "the data say nothing of it (it may be 0.6 to 1 mm)" in thick.words
    said = [str(note) for note in notes_of_verdicts((nu12, thick))]
    assert said == [f"thickness is {thick.words}"]


def evaluated(fit, nuisance=None):
    y = fit.unknowns.at(LAW.beta)
    if nuisance:
        y[12:] = nuisance
    point = fit.evaluate(y, True)
    return point, posteriors_of(fit, point, Noise.from_residual(fit, point.residual))[0]


def test_prior_of_thickness_adds_to_uncertainty_of_moduli():
    posteriors = [evaluated(bubble_and_strip(*shared))[1] for shared in ((THICKNESS,), ())]
    (thick, *_) = verdicts(posteriors[0], ENDS)
    assert thick.sigma == pytest.approx(0.02, rel=1e-3) and not thick.determined
    assert "(known to 0.02 mm before)" in thick.words
    known, free = (np.diag(p.covariance)[:12] ** 0.5 / p.best[:12] for p in posteriors)
    np.testing.assert_allclose(known**2, free**2 + (0.02 / 0.8) ** 2, rtol=1e-3)


@pytest.mark.parametrize(
    ("value", "half_widths"), [(3.0, (1.96, 1.96)), (1.5, (1.5, 1.96)), (9.0, (1.96, 1.0))]
)
def test_band_of_a_parameter_is_cut_at_its_bounds(value, half_widths):
    verdict = NuisanceVerdict(
        name="shift", lower=0.0, upper=10.0, unit="mm", value=value, sigma=1.0, correlation={}
    )
    assert verdict.half_widths == pytest.approx(half_widths)
    assert verdict.band == pytest.approx((value - half_widths[0], value + half_widths[1]))


def test_verdicts_say_bound_sigma_and_correlation():
    fit = bubble_and_strip(replace(NU12, start=0.2, upper=LAW.nu12))
    _, posterior = evaluated(fit, [LAW.nu12, -0.02, 0.1])
    nu12, shift, pressure = verdicts(posterior, ENDS)
    assert nu12.bound_reached == "upper" and nu12.words.startswith(
        "0.24, on its upper bound, 1 sigma 0."
    )
    assert nu12.numbers["on_bound"] == "upper" and nu12.numbers["determined"]
    assert (shift.name, shift.bound_reached, shift.value) == ("bubble: offset_z", "", -0.02)
    assert shift.sigma == pytest.approx(posterior.covariance[13, 13] ** 0.5)
    assert f"1 sigma {shift.sigma:.2g} mm" in shift.words
    assert pressure.unit == "kPa" and pressure.determined and not pressure.shared
    covariance = posterior.covariance
    rho = covariance[12, 13] / np.sqrt(covariance[12, 12] * covariance[13, 13])
    assert abs(rho) <= 1 and all(abs(value) <= 1 for value in nu12.correlation.values())
