"""Draws of laws: posterior, truncated normal, likelihood, discrepancy."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from bubblefit.inference import truncated_normal as truncated
from bubblefit.inference.blocks import Blocks
from bubblefit.inference.discrepancy import DISCREPANCY, Discrepancy, notes_of_discrepancies
from bubblefit.inference.likelihood import FAILED, THRESHOLD, profile_side
from bubblefit.inference.linear import LinearisedFit, posteriors_of
from bubblefit.inference.mesh_limit import FineMeshLimit
from bubblefit.inference.noise import Noise
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.posterior import Posterior
from bubblefit.inference.problem import Evaluation
from bubblefit.inference.sheet_discrepancy import sheet_discrepancy, smooth_shapes
from bubblefit.inference.truncated_normal import truncated_draws
from bubblefit.inference.unknowns import Unknowns
from bubblefit.inference.weighted_problem import WeightedProblem
from bubblefit.materials.forms import polynomial as forms
from bubblefit.materials.law import HypoelasticLaw
from scipy.ndimage import gaussian_filter
from scipy.optimize import minimize
from scipy.stats import halfnorm, kstest, norm, truncnorm, uniform

from .cases import CONSTANT, CONSTANT_BOUNDS, EVERYTHING, NEAR, levenberg_marquardt, problem

OFFSET = Nuisance("offset", -2.0, 2.0, "mm")
UNKNOWNS = replace(
    Unknowns.of(forms.CONSTANT, 0.24, [0.1, 0.1, 0.1], CONSTANT_BOUNDS),
    nuisance=NuisanceUnknowns({"linear": (OFFSET,)}),
)
LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0)
TRUTH = np.append(UNKNOWNS.at(np.array([12.0, 250.0, 400.0]))[:3], 0.3)
SIZES, SIGMA = (300, 200), np.array([0.05, 0.4])


@dataclass
class Linear:
    """A problem  r = J (y - truth) - noise  of two blocks; all that propagation asks of one."""

    unknowns: Unknowns
    blocks: Blocks


PROBLEM = Linear(UNKNOWNS, Blocks(SIZES))
RANDOM = np.random.default_rng(8)
JACOBIAN = RANDOM.standard_normal((sum(SIZES), 4))
ROWS = SIGMA[PROBLEM.blocks.of]
#: The covariance of estimates whose blocks are weighted with the inverse of their norms.
WEIGHT = 1.0 / (SIGMA * np.sqrt(SIZES))[PROBLEM.blocks.of]
GAIN = np.linalg.inv(JACOBIAN.T @ (WEIGHT[:, None] * JACOBIAN)) @ JACOBIAN.T * WEIGHT
FORMULA = (GAIN * ROWS) @ (GAIN * ROWS).T


def noise(rows=ROWS):
    return Noise({}, {}, rows, rows)


def of(problem, best, by):
    return posteriors_of(problem, best, by)[0]


def evaluation(y, drawn):
    residual = JACOBIAN @ (y - TRUTH) - drawn
    return Evaluation(y, y[:3], residual, PROBLEM.blocks.value(residual), JACOBIAN, ())


def best_of(drawn):
    """The least of |r1| + |r2|, by weighting with the inverse norms in turn."""
    y = TRUTH
    for _ in range(12):
        r = JACOBIAN @ (y - TRUTH) - drawn
        w = 1.0 / np.sqrt(PROBLEM.blocks.norms(r))[PROBLEM.blocks.of]
        y = y - np.linalg.lstsq(w[:, None] * JACOBIAN, w * r, rcond=None)[0]
    return np.asarray(y)


EQUAL = np.eye(4) + 0.1
SPREAD = np.diag([1e-6, 1.0, 1e3, 1e6])
ONE_HELD = np.diag([1.0, 4.0, 0.0, 4.0])


@pytest.mark.parametrize("covariance", [EQUAL, SPREAD @ EQUAL @ SPREAD, ONE_HELD])
@pytest.mark.parametrize("least", [[-9.0, -9.0], [0.5, -9.0], [2.0, -2.0], [6.0, -9.0]])
def test_draws_are_the_same_however_the_processor_rounds(covariance, least):
    """Signs of eigenvectors, and axes of equal eigenvalues, are decided by rounding."""
    sigma = np.sqrt(np.diag(covariance))
    rows = np.array([[0.0, 1.0, 0.0, 0.5], [0.0, -1.0, 0.0, -0.5]]) / np.where(sigma > 0, sigma, 1)
    allowed = np.array([0.0, 0.7 * max(least[0], 0.0), 0.0, 0.6 * max(least[0], 0.0)]) * sigma
    inequalities = rows, np.array(least)

    def draws(scale):
        noise = 1.0 + scale * RANDOM.standard_normal((4, 4))
        disturbed = covariance * (noise + noise.T) / 2
        random = np.random.default_rng(1)
        return truncated_draws(np.zeros(4), disturbed, inequalities, allowed, 200, random)

    first = draws(0.0)
    for _ in range(5):
        assert (np.abs(draws(1e-13) - first) <= 1e-7 * sigma + 1e-12).all()


def test_the_covariance_is_that_of_the_fits_to_drawn_noise():
    drawn = ROWS * np.random.default_rng(3).standard_normal((800, len(ROWS)))
    found = np.array([best_of(one) for one in drawn])
    said = of(PROBLEM, evaluation(best_of(drawn[0]), drawn[0]), Noise({}, {}, ROWS, 0.5 * ROWS))
    assert found.std(axis=0) == pytest.approx(np.sqrt(np.diag(said.covariance)), rel=0.08)
    assert said.covariance == pytest.approx(FORMULA, rel=0.1, abs=0.05 * np.abs(FORMULA).max())
    assert said.centre == pytest.approx(said.best, abs=1e-6)


def test_an_exact_fit_weighs_its_blocks_by_the_noise_to_reckon_with():
    exact = of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise())
    assert exact.covariance == pytest.approx(FORMULA)
    t = UNKNOWNS.to_coefficients
    assert exact.coefficients[:3, :3] == pytest.approx(t @ exact.covariance[:3, :3] @ t.T)
    assert exact.labels == (*UNKNOWNS.labels, "offset")
    assert exact.coefficients[3, 3] == exact.covariance[3, 3]
    sigma = np.sqrt(np.diag(exact.coefficients))
    assert exact.correlations * sigma * sigma[:, None] == pytest.approx(exact.coefficients)
    nothing = of(PROBLEM, evaluation(TRUTH, 0 * ROWS), noise(0 * ROWS))
    assert not nothing.covariance.any()
    held = TRUTH - [0.02, 0.0, 0.0, 0.0]
    posterior = of(PROBLEM, evaluation(held, 0 * ROWS), noise())
    assert posterior.centre == pytest.approx(TRUTH, abs=1e-12)
    assert (posterior.best == held).all()


def test_laws_are_drawn_within_the_bounds():
    y = np.append(UNKNOWNS.at(np.array([1.0, 250.0, 400.0]))[:3], 2.0)
    covariance = np.diag([0.02, 1e-4, 1e-4, 0.1]) ** 2
    posterior = Posterior(UNKNOWNS, y, y, covariance)
    drawn = posterior.sample(2000, np.random.default_rng(0))
    a, c = UNKNOWNS.inequalities
    assert (drawn @ a.T >= c - 1e-7).all()
    assert drawn[:, 3].max() <= 2.0 + 1e-9 and drawn[:, 3].std() == pytest.approx(0.0603, rel=0.08)
    laws = posterior.laws(LAW, 50, np.random.default_rng(0))
    assert len(laws) == 50 and all(law.nu12 == LAW.nu12 for law in laws)
    shear = np.array([law.modulus("G12", np.zeros(1))[0] for law in laws])
    assert shear.min() >= 1.0 - 1e-7 and shear.std() > 0.1
    same = posterior.laws(LAW, 50, np.random.default_rng(0))
    assert all((one.beta == two.beta).all() for one, two in zip(laws, same, strict=True))


def test_of_a_finer_model():
    y, error = TRUTH + 0.01, JACOBIAN @ np.full(4, -0.02)
    point = evaluation(y, 0 * ROWS)
    limit = FineMeshLimit(np.full(4, 0.02), point.residual, error)
    own, fine = posteriors_of(PROBLEM, point, noise(), limit)
    assert own.best == pytest.approx(y) and own.centre == pytest.approx(TRUTH)
    assert fine is not None and fine.best == pytest.approx(y + 0.02)
    assert fine.centre == pytest.approx(TRUTH + 0.02)
    assert fine.covariance - own.covariance == pytest.approx(np.full((4, 4), 0.002**2))


def test_values_along_lines_are_those_of_the_normal_distribution_without_chance():
    spread = np.random.default_rng(3).standard_normal((6, 6))
    covariance = spread @ spread.T
    functional = np.array([[0.3, -1.0, 0.2, 2.0, 0.0, 1.0]])
    distribution = truncated.TruncatedNormal.of(
        np.ones(6), covariance, (np.zeros((0, 6)), np.zeros(0)), np.zeros(6)
    )
    values = distribution.values(functional, distribution.draw(1000, np.random.default_rng(0)))
    sigma = float(np.sqrt(functional[0] @ covariance @ functional[0]))
    expected = norm(functional.sum(), sigma)
    shares = np.array([0.025, 0.1587, 0.5, 0.8413, 0.975])
    np.testing.assert_allclose(np.quantile(values, shares), expected.ppf(shares), atol=0.01 * sigma)


@pytest.mark.parametrize("walks", [False, True])
def test_values_along_lines_keep_the_bounds_of_everything_else(walks, monkeypatch):
    """Given y0 >= 0.5, y1 of correlation 0.75 has the mean 0.75 phi(0.5) / (1 - Phi(0.5))."""
    if walks:
        monkeypatch.setattr(truncated, "MAX_REJECTION_ROUNDS", 1)
    covariance = np.array([[1.0, 0.75], [0.75, 1.0]])
    inequalities = np.array([[1.0, 0.0], [0.0, -1.0]]), np.array([0.5, -1.5])
    start = np.array([0.5, 0.0])
    count = 4000
    distribution = truncated.TruncatedNormal.of(np.zeros(2), covariance, inequalities, start)
    drawn = distribution.draw(count, np.random.default_rng(0))
    values = distribution.values(np.eye(2), drawn)
    assert values[:, 0].min() >= 0.5 - 1e-9 and values[:, 1].max() <= 1.5 + 1e-9
    random = np.random.default_rng(1).multivariate_normal(np.zeros(2), covariance, 400_000)
    random = random[(random[:, 0] >= 0.5) & (random[:, 1] <= 1.5)]
    shares = [0.025, 0.16, 0.5, 0.84, 0.975]
    expected = np.quantile(random, shares, axis=0)
    np.testing.assert_allclose(np.quantile(values, shares, axis=0), expected, atol=0.06)


def test_information_adds_up_and_pulls_the_centre_to_the_best():
    random = np.random.default_rng(2)
    roots = random.standard_normal((4, 4)), random.standard_normal((3, 2))
    covariance, more = roots[0] @ roots[0].T, roots[1] @ roots[1].T
    best = np.append(UNKNOWNS.at(np.array([12.0, 250.0, 400.0]))[:3], 0.0)
    centre = best + random.standard_normal(4)
    posterior = Posterior(UNKNOWNS, best, centre, covariance)
    added = np.zeros((4, 4))
    added[:3, :3] = more
    sharper = posterior.with_information(more)
    precision = np.linalg.inv(covariance) + added
    np.testing.assert_allclose(sharper.covariance, np.linalg.inv(precision), rtol=1e-9)
    middle = np.linalg.solve(precision, np.linalg.solve(covariance, centre) + added @ best)
    np.testing.assert_allclose(sharper.centre, middle, rtol=1e-9)
    # An unknown with hardly any information beside one that is known to a millionth.
    flat = Posterior(UNKNOWNS, best, best, np.diag([1e-6, 1e3, 1.0, 1.0]) ** 2)
    known = flat.with_information(np.diag([0.0, 1e4, 0.0]))
    np.testing.assert_allclose(
        np.sqrt(np.diag(known.covariance)), [1e-6, 0.01, 1.0, 1.0], rtol=1e-6
    )
    np.testing.assert_allclose(flat.with_information(np.zeros((3, 3))).covariance, flat.covariance)


COUNT = 4000
COVARIANCE = np.array([[4.0, 1.5], [1.5, 1.0]])


def draws(mean, rows, least, allowed, covariance=COVARIANCE, seed=5, count=COUNT):
    given = [np.asarray(v, dtype=float) for v in (mean, rows, least, allowed)]
    mean, rows, least, allowed = given
    random = np.random.default_rng(seed)
    drawn = truncated_draws(mean, covariance, (rows, least), allowed, count, random)
    assert drawn.shape == (count, len(mean))
    assert (drawn @ rows.T >= least - 1e-7).all()
    return drawn


def follows(drawn, distribution):
    assert kstest(drawn, distribution.cdf).pvalue > 0.01


def test_without_bounds_it_is_the_normal_distribution():
    drawn = draws([1.0, -2.0], np.zeros((0, 2)), [], [1.0, -2.0])
    assert drawn.mean(axis=0) == pytest.approx([1.0, -2.0], abs=0.12)
    assert np.cov(drawn.T) == pytest.approx(COVARIANCE, rel=0.1)


@pytest.mark.parametrize("walks", [False, True])
def test_on_a_bound_it_is_half_of_it(walks, monkeypatch):
    if walks:
        monkeypatch.setattr(truncated, "MAX_REJECTION_ROUNDS", 1)
    drawn = draws([0.0, 0.0], [[1.0, 0.0]], [0.0], [0.0, 0.0])
    follows(drawn[:, 0], halfnorm(scale=2.0))
    # The other follows:  y1 | y0  is normal about 1.5 / 4 y0 with 1 - 1.5^2 / 4.
    follows(drawn[:, 1] - 0.375 * drawn[:, 0], norm(scale=np.sqrt(1 - 1.5**2 / 4)))


def test_between_bounds_far_away_and_in_corners():
    between = [[1.0, 0.0], [-1.0, 0.0]]
    # Five standard deviations outside: it lies near the bound.
    drawn = draws([-10.0, 0.0], between, [0.0, -6.0], [0.0, 0.0])
    follows(drawn[:, 0], truncnorm(5.0, 8.0, loc=-10.0, scale=2.0))
    assert drawn[:, 0].mean() < 0.5
    # In a corner.
    mean = [-3.0, 0.0, 4.0]
    drawn = draws(mean, np.eye(3), np.zeros(3), np.zeros(3), np.eye(3), seed=1)
    for k, middle in enumerate(mean):
        follows(drawn[:, k], truncnorm(-middle, np.inf, loc=middle))
    # Without room, and without variance, it stays.
    drawn = draws([3.0, 0.0], between, [1.0, -1.0], [1.0, 0.0])
    assert drawn[:, 0] == pytest.approx(np.ones(COUNT), abs=1e-9)
    follows(drawn[:, 1], norm(0.375 * (1.0 - 3.0), np.sqrt(1 - 1.5**2 / 4)))
    drawn = draws([1.0, 1.0], np.zeros((0, 2)), [], [1.0, 1.0], np.zeros((2, 2)), count=3)
    assert (drawn == 1.0).all()
    flat = np.diag([1.0, 0.0])
    drawn = draws([0.0, 0.0], np.eye(2), np.zeros(2), [0.0, 0.0], flat, seed=0, count=100)
    assert drawn[:, 0].std() > 0.4 and not drawn[:, 1].any()


def test_between_bounds_that_are_close_to_each_other():
    """A slab of a thousandth of a standard deviation, askew: along it everything is drawn."""
    across, along = np.array([[0.6, 0.8, 0.0], [0.8, -0.6, 0.0]])
    rows = np.array([across, -across])
    drawn = draws(np.zeros(3), rows, [2.0, -2.001], 2.0 * across, np.eye(3), seed=2)
    follows(drawn @ along, norm)
    follows(drawn[:, 2], norm)
    follows(drawn @ across, uniform(2.0, 0.001))


@pytest.mark.parametrize("width", [1e-6, 1e-8, 3e-9])
def test_oblique_bounds_that_nearly_meet(width):
    """Between x + y = 0 and a width more: rounding of so sharp a curvature is larger than one."""
    rows = np.array([[1.0, 1.0, 0.3], [-1.0, -1.0, -0.3], [0.2, -0.7, 1.0]])
    least, start = [0.0, -width, -50.0], [width / 2, 0.0, 0.0]
    drawn = draws(np.zeros(3), rows, least, start, np.eye(3), seed=4)
    across = drawn @ rows[0]
    assert across.min() >= -1e-9 and across.max() <= width + 1e-9
    along = drawn @ np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    assert along.std() == pytest.approx(1.0, abs=0.05)


#: mm: so much that G12 is off its first order.
NOISE = 0.3


@pytest.fixture(scope="module")
def bubble():
    """A fit of constants to noisy fields: problem, optimum, and the fit to first order."""
    fit = problem(CONSTANT, noise=NOISE)
    found = levenberg_marquardt(fit, CONSTANT.at(NEAR), 1e-9, 60)
    return fit, found.best, Noise.from_residual(fit, found.best.residual)


def test_a_profile_is_the_least_over_the_other_unknowns(bubble):
    fit, best, noise = bubble
    linear = LinearisedFit.of(fit, best, noise)
    row = fit.unknowns.modulus_row("G12", 0.0)
    assert row @ best.unknowns == pytest.approx(best.coefficients[0])
    own = WeightedProblem.of(fit, linear.weights / np.sqrt(linear.spread_over_curvature(row)))
    posterior, _ = posteriors_of(fit, best, noise)
    sigma = float(np.sqrt(row @ posterior.covariance @ row))
    side = profile_side(own, own.weighted(best), row, 1.0, sigma)
    assert side.reason == "" and side.ratios[-1] >= THRESHOLD > side.ratios[-2]
    # Few analyses a place, and the objective of the fit itself is left as it was.
    assert side.analyses <= 3 * len(side.values)
    assert fit.evaluate(best.unknowns, False).value == pytest.approx(best.value, rel=1e-9)

    value, ratio = side.values[3], side.ratios[3]
    held = value / row[0]

    def squares(others):
        point = own.evaluate(np.array([held, *others]), False)
        return np.inf if point is None else float(point.residual @ point.residual)

    found = minimize(squares, best.unknowns[1:], method="Nelder-Mead",
                     options={"xatol": 1e-5, "fatol": 1e-3, "maxfev": 60})  # fmt: skip
    seen = own.weighted(best).residual
    assert found.fun - seen @ seen == pytest.approx(ratio, abs=0.03)


def test_bounds_of_a_modulus(bubble):
    unknowns = bubble[0].unknowns
    row = unknowns.modulus_row("E1", 0.05)
    assert unknowns.extreme(row, -1.0) == pytest.approx(50.0, rel=1e-6)
    assert unknowns.extreme(row, 1.0) == pytest.approx(1500.0, rel=1e-6)
    # Nuisance is no part of a modulus.
    whole = EVERYTHING.modulus_row("G12", 0.02)
    assert len(whole) == EVERYTHING.count and not whole[EVERYTHING.size :].any()


def test_a_side_ends_where_no_analysis_does(bubble, monkeypatch):
    fit, best, noise = bubble
    linear = LinearisedFit.of(fit, best, noise)
    row = fit.unknowns.modulus_row("E1", 0.0)
    own = WeightedProblem.of(fit, linear.weights)
    whole, start = own.evaluate, float(row @ best.unknowns)
    sigma = 0.02 * start

    def fails(y, *rest):
        return None if row @ y > start + 0.7 * sigma else whole(y, *rest)

    monkeypatch.setattr(own, "evaluate", fails)
    side = profile_side(own, own.weighted(best), row, 1.0, sigma)
    assert side.reason == FAILED and side.end is None
    assert start + 0.5 * sigma <= side.values[-1] <= start + 0.7 * sigma


SIDE, BLOCKS = 32, 9
PLACES = 4.0 * np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2)
SHAPES = smooth_shapes(PLACES)
NO_DOUBT = [np.zeros(SIDE**2)] * BLOCKS


def smooth_noise(random, width, size=0.02):
    fields = random.standard_normal((BLOCKS, SIDE, SIDE))
    if width:
        fields = np.array([gaussian_filter(one, width, mode="wrap") for one in fields])
    return [size * one.reshape(-1) / one.std() for one in fields]


def judged(blocks, doubts=NO_DOUBT, unknowns=3):
    found = sheet_discrepancy(blocks, doubts, [PLACES] * BLOCKS, unknowns, "mm")
    assert found is not None
    return found


@pytest.mark.parametrize("width", [0.0, 0.7])
def test_noise_is_taken_for_more_in_one_of_a_hundred(width):
    random = np.random.default_rng(4)
    told = 0
    for _ in range(50):
        blocks = smooth_noise(random, width)
        for k in range(3):
            blocks[k] = blocks[k] - SHAPES[:, k] * (SHAPES[:, k] @ blocks[k])
        told += judged(blocks).is_significant
    assert told <= 3  # more in one of 600 such tests, if one of a hundred is told


def test_a_smooth_field_is_found_below_the_noise():
    """0.005 mm of one shape in every block, beside noise of 0.02 mm."""
    random, shape = np.random.default_rng(6), 0.005 * SHAPES[:, 7] * SIDE
    told = [judged([b + shape for b in smooth_noise(random, 0.0)]) for _ in range(6)]
    assert all(one.is_significant for one in told)
    assert np.mean([one.rms for one in told]) == pytest.approx(0.005, rel=0.2)
    # What the mesh may be answerable for is none.
    found = judged([b + shape for b in smooth_noise(random, 0.0)], [shape] * BLOCKS)
    assert not found.is_significant and found.rms < 0.003


def test_blocks_count_alike_whatever_their_size_and_too_few_not_at_all():
    blocks = smooth_noise(np.random.default_rng(1), 0.7)
    scaled = [k * block for k, block in enumerate(blocks, start=1)]
    assert judged(scaled).f_ratio == pytest.approx(judged(blocks).f_ratio, rel=1e-12)
    for few, places, unknowns in (
        (np.arange(20.0), PLACES[:20], 3),
        (np.zeros(SIDE**2), PLACES, 3),
        (smooth_noise(np.random.default_rng(0), 0.0)[0], PLACES, 15),
    ):
        assert sheet_discrepancy([few], [np.zeros(len(few))], [places], unknowns, "mm") is None
    found = {
        "bubble": Discrepancy(22.6, 1.25, 0.036, "mm"),
        "other": Discrepancy(1.2, 1.25, 0.001, "mm"),
        "computed": Discrepancy(61.8, 1.66, 2e-8, "mm", noise_of_mean=4e-4),
    }
    (note,) = notes_of_discrepancies(found)
    assert (note.kind, note.of) == (DISCREPANCY, "bubble")
    assert "0.036 mm " in note and "22.6 times" in note and "1.25 in " in note


def test_the_shapes():
    assert SHAPES.T @ SHAPES == pytest.approx(np.eye(45), abs=1e-12)
    x, y = PLACES.T
    quartic = x**3 * y - 2 * y**4 + x
    inside = SHAPES[:, :15] @ (SHAPES[:, :15].T @ quartic)
    assert inside == pytest.approx(quartic, rel=1e-9, abs=1e-5)
