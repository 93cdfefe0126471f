"""inference/nuisance_fit.py: a given law evaluated with fitted nuisance."""

import numpy as np
import pytest
from bubblefit.inference.nuisance_fit import evaluate_law

from .cases import EVERYTHING, LAW, MODEL, Failing, bubble_problem, clean_fit


def test_evaluated_law_keeps_its_coefficients_and_fits_nuisance_alone():
    shift, offset = np.array([0.2, -0.1, 1.0]), 0.003
    fit = clean_fit(MODEL, LAW, EVERYTHING, shift, {"pressure_offset": offset})
    y = EVERYTHING.at(LAW.beta)
    best = evaluate_law(fit, y)
    assert best.value < 1e-6 and (best.unknowns[:12] == y[:12]).all()
    assert best.unknowns[12:] == pytest.approx([*shift, 1e3 * offset], abs=1e-3)
    # Nothing but the law is unknown, or the solver cannot tell where to go: as it is, from rest.
    plain = bubble_problem(noise=0.02)
    at_rest = plain.evaluate(y[:12], False, warm=False).value
    assert evaluate_law(plain, y[:12]).value == pytest.approx(at_rest, rel=1e-12)
    fit.comparisons[0].solver = Failing(lambda run: True)
    assert evaluate_law(fit, y) is None
