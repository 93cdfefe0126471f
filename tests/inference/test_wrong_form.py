"""inference/wrong_form.py: discrepancies of a fit, their causes, and whether they matter."""

from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.strips.load_objective import StripObjective
from bubblefit.inference.discrepancy import notes_of_discrepancies
from bubblefit.inference.wrong_form import discrepancies
from scipy.interpolate import BSpline

PLACES = np.linspace(0.1, 3.0, 30)


def judged_strips(off, load, elongation):
    """Six strips of F = 100 x + 20 x^3 (N, mm), read `off` by a load and an elongation."""
    knots, random = np.linspace(0.25, 3.5, 14), np.random.default_rng(2)
    model = SimpleNamespace(load=off * (100 * knots + 20 * knots**3))
    x, count = np.tile(PLACES, 6), np.repeat(np.arange(6), len(PLACES))
    places = x + elongation
    scatter = 0.02 * (np.stack([x**0, x**2], axis=1) * random.standard_normal((6, 2))[count]).sum(1)
    measured = off * (100 * places + 20 * places**3) + load + scatter
    return differences(knots, x, measured, count, np.column_stack([x, x**3]), model)


def differences(knots, places, measured, count, slopes, model):
    """Return what specimens (their numbers in `count`) read alike beside a model's load."""
    objective = StripObjective(knots, places, measured, specimens=count)
    problem = SimpleNamespace(
        comparisons=[SimpleNamespace(name="warp", objective=objective)],
        rows=lambda _: slice(None), scale=objective.scale,
    )  # fmt: skip
    best = SimpleNamespace(jacobian=slopes / objective.scale[:, None], histories=[model])
    return discrepancies(problem, objective.residual(model), None, best, lambda _: 0.0)["warp"]


@pytest.mark.parametrize(
    ("load", "elongation", "words"),
    [(0.0, 0.2, "elongations off by -0.2 mm"), (15.0, 0.0, "loads off by +15 N")],
)
def test_offset_common_to_all_specimens_is_named_as_cause(load, elongation, words):
    one = judged_strips(1.0, load, elongation)
    assert one.is_significant and one.specimen_count == 6
    first, *others = one.causes
    assert words in first.description and first.explained_share > 0.9
    assert all(other.explained_share < first.explained_share for other in others)
    (note,) = notes_of_discrepancies({"warp": one})
    assert words in note


def test_discrepancy_small_beside_the_load_is_no_warning():
    """Beyond chance, but 0.3 N: told of strips that carry 3 N, not of those that carry 3000."""
    small, large = judged_strips(10.0, 0.3, 0.0), judged_strips(0.01, 0.3, 0.0)
    assert small.is_systematic and small.f_ratio > 5 * small.critical_ratio
    assert small.relative_rms < 1e-3 and not small.is_significant
    assert not notes_of_discrepancies({"warp": small})
    assert large.relative_rms > 0.02 and large.is_significant


def test_discrepancy_small_beside_scatter_and_load_is_no_warning():
    """0.3 N alike in all among 14 N of scatter: F is above 100, and no warning comes."""
    random, count = np.random.default_rng(2), np.repeat(np.arange(6), len(PLACES))
    x, own = np.tile(PLACES, 6), PLACES / PLACES.max()
    basis = BSpline.design_matrix(own, np.r_[[0] * 3, np.linspace(0, 1, 4), [1] * 3], 3).toarray()
    curve = own**4
    far = curve - basis @ np.linalg.lstsq(basis, curve, rcond=None)[0]
    far *= 0.3 / np.sqrt(np.mean(far**2))  # beside all that the spline can follow
    load = 500 * PLACES
    slack, left = random.standard_normal((2, 6, 1))
    scatter = (17.0 * slack * own + (0.4 * left) * far).ravel()
    scatter += 0.02 * random.standard_normal(len(scatter))
    measured = np.tile(load + far, 6) + scatter
    knots = np.linspace(0.25, 3.5, 14)
    model = SimpleNamespace(load=500 * knots)
    one = differences(knots, x, measured, count, np.tile(basis, (6, 1)), model)
    assert np.sqrt(np.mean(scatter**2)) == pytest.approx(14.0, rel=0.3)
    assert one.is_systematic and one.f_ratio > 100 and one.rms == pytest.approx(0.3, rel=0.3)
    assert not one.is_significant and not notes_of_discrepancies({"warp": one})
