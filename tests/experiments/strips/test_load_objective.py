"""experiments/strips/load_objective.py: residuals of loads, and how many are independent."""

import numpy as np
import pytest
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.load_objective import (
    PLACES_OF_SPECIMEN,
    SPECIMENS_OF_POLYNOMIAL,
    LoadObjective,
    StripObjective,
    correlated_loads,
    independent_loads,
)
from scipy.interpolate import CubicSpline

from .cases import (
    CUBIC_UNKNOWNS,
    STRIP_LAW,
    STRIP_MODELS,
    WHOLE,
    exact_history,
    near_law,
    noisy_strip,
    strip_problem,
)

# Residuals


def test_objective_of_strips_is_the_sum_of_rms_errors():
    """Eqs 3.4 to 3.7: RMS of the differences, in N, direction by direction."""
    fit = strip_problem(law=STRIP_LAW)
    point = fit.evaluate(near_law(CUBIC_UNKNOWNS, STRIP_LAW), False)
    total = 0.0
    for experiment, history in zip(fit.comparisons, point.histories, strict=True):
        difference = history.load - experiment.objective.measured
        rms = np.sqrt(np.sum(difference**2) / len(difference))
        assert rms > 1.0
        assert experiment.objective.rms(history) == pytest.approx(rms)
        total += rms
    assert point.value == pytest.approx(total)


def test_loads_between_increments_lie_on_a_spline_from_the_origin():
    model, history = STRIP_MODELS["warp"], exact_history("warp", STRIP_LAW)
    end = model.elongations[-1]
    u = np.array([0.0, 0.111, 0.7, 0.71, 2.9, end])
    objective = LoadObjective(model.elongations, u, np.zeros(6))
    spline = CubicSpline([0.0, *model.elongations], [0.0, *history.load])
    assert objective.modelled(history) == pytest.approx(spline(u))
    assert objective.modelled(history)[0] == pytest.approx(0.0, abs=1e-9)
    # The model's end is inside it, also where another sum of the same steps is larger by rounding.
    objective = LoadObjective(model.elongations, [0.0, end * (1 + 1e-12)], np.zeros(2))
    assert objective.sample[1] == pytest.approx([*[0.0] * 9, 1.0], abs=1e-9)
    assert objective.unit == "N"


def test_derivatives_of_residuals_by_a_compliance_are_those_of_differences():
    model, history = STRIP_MODELS["warp"], exact_history("warp", STRIP_LAW)
    load = 0.9 * history.load
    objective = StripObjective(model.elongations, model.elongations, load)
    objective.compliance = "give", 0.0
    step = 1e-7
    ahead, behind = (objective.residual(history, {"give": c}) for c in (1e-3 + step, 1e-3 - step))
    column = objective.nuisance_columns(["give"], {"give": 1e-3}, history)[:, 0]
    assert column == pytest.approx((ahead - behind) / (2 * step), rel=1e-5)
    corrected = objective.at({"give": 1e-3})
    assert corrected.elongation == pytest.approx(np.array(model.elongations) - 1e-3 * load)
    assert corrected.rms(history) != pytest.approx(objective.rms(history), rel=0.01)


def test_specimens_count_as_specimens_and_single_errors_by_themselves():
    factors = np.array([0.9, 0.97, 1.0, 1.02, 1.11])
    assert independent_loads(noisy_strip(factors[:, None] * WHOLE)) == pytest.approx(4.0, rel=1e-6)
    noise = 5.0 * np.random.default_rng(4).standard_normal((6, len(WHOLE)))
    assert independent_loads(noisy_strip(WHOLE + noise)) > 0.6 * 5 * len(WHOLE)


def test_independent_loads_give_the_scatter_of_specimens():
    """Draw 300 sets of five specimens, each stiffer by its own factor and a little uneven."""
    random = np.random.default_rng(6)
    shape = WHOLE / np.sqrt(WHOLE @ WHOLE)
    said, found = [], []
    for _ in range(300):
        factor = 1.0 + 0.05 * random.standard_normal((5, 1))
        loads = factor * WHOLE + 1.0 * random.standard_normal((5, len(WHOLE)))
        own = noisy_strip(loads)
        # The best factor of all loads, and one sigma of it as a fit reckons it.
        found.append(float(np.mean(loads @ shape)))
        said.append(own.scatter * np.sqrt(correlated_loads(own, loads.size, None) / 5))
    assert np.sqrt(np.mean(np.square(said))) == pytest.approx(np.std(found), rel=0.15)


def test_independent_loads_of_single_curves_are_assumed():
    """One curve, or a polynomial: a few places of it; as many times as specimens are said."""
    one = noisy_strip(WHOLE[None] + 1.0)
    assert (
        independent_loads(one) == PLACES_OF_SPECIMEN
        and independent_loads(one, 4) == 3 * PLACES_OF_SPECIMEN
    )
    polynomial = Strip("warp", 20.0, 23.0, one.polynomial)
    assert independent_loads(polynomial) == (SPECIMENS_OF_POLYNOMIAL - 1) * PLACES_OF_SPECIMEN
    assert (
        independent_loads(polynomial, 1) == independent_loads(polynomial, 2) == PLACES_OF_SPECIMEN
    )
    # Noise that is given is that of single loads; where specimens are told, they count.
    assert correlated_loads(one, 30, 2.0) == correlated_loads(one, 1, None) == 1.0
    assert correlated_loads(one, 30, None) == 30 / PLACES_OF_SPECIMEN
    assert correlated_loads(one, 30, 2.0, specimen_count=3) == 30 / (2 * PLACES_OF_SPECIMEN)
    # Specimens that agree to the last digit.
    assert independent_loads(noisy_strip(np.tile(WHOLE, (3, 1)))) >= 2.0
