"""inference/posterior.py: draws of laws, and information added to them."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.inference import posterior as truncated
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.posterior import Posterior, TruncatedNormal
from bubblefit.inference.unknowns import Unknowns
from bubblefit.materials.forms import polynomial as forms
from bubblefit.materials.law import HypoelasticLaw
from scipy.stats import halfnorm, kstest, norm, truncnorm, uniform

from .cases import CONSTANT_BOUNDS

OFFSET = Nuisance("offset", -2.0, 2.0, "mm")
UNKNOWNS = replace(
    Unknowns.of(forms.CONSTANT, 0.24, [0.1, 0.1, 0.1], CONSTANT_BOUNDS),
    nuisance=NuisanceUnknowns({"linear": (OFFSET,)}),
)
LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0)


def test_drawn_laws_keep_the_bounds_and_follow_the_seed():
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


def test_information_adds_to_precision_and_pulls_centre_to_best():
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


def test_information_beside_an_unknown_known_to_a_millionth():
    best = np.append(UNKNOWNS.at(np.array([12.0, 250.0, 400.0]))[:3], 0.0)
    # An unknown with hardly any information beside one that is known to a millionth.
    flat = Posterior(UNKNOWNS, best, best, np.diag([1e-6, 1e3, 1.0, 1.0]) ** 2)
    known = flat.with_information(np.diag([0.0, 1e4, 0.0]))
    np.testing.assert_allclose(
        np.sqrt(np.diag(known.covariance)), [1e-6, 0.01, 1.0, 1.0], rtol=1e-6
    )
    np.testing.assert_allclose(flat.with_information(np.zeros((3, 3))).covariance, flat.covariance)


RANDOM = np.random.default_rng(8)
EQUAL = np.eye(4) + 0.1
SPREAD = np.diag([1e-6, 1.0, 1e3, 1e6])
ONE_HELD = np.diag([1.0, 4.0, 0.0, 4.0])


@pytest.mark.parametrize("covariance", [EQUAL, SPREAD @ EQUAL @ SPREAD, ONE_HELD])
@pytest.mark.parametrize("least", [[-9.0, -9.0], [0.5, -9.0], [2.0, -2.0], [6.0, -9.0]])
def test_truncated_draws_do_not_depend_on_rounding_of_the_processor(covariance, least):
    """Signs of eigenvectors, and axes of equal eigenvalues, are decided by rounding."""
    sigma = np.sqrt(np.diag(covariance))
    rows = np.array([[0.0, 1.0, 0.0, 0.5], [0.0, -1.0, 0.0, -0.5]]) / np.where(sigma > 0, sigma, 1)
    allowed = np.array([0.0, 0.7 * max(least[0], 0.0), 0.0, 0.6 * max(least[0], 0.0)]) * sigma
    inequalities = rows, np.array(least)

    def draws(scale):
        noise = 1.0 + scale * RANDOM.standard_normal((4, 4))
        disturbed = covariance * (noise + noise.T) / 2
        random = np.random.default_rng(1)
        distribution = TruncatedNormal.of(np.zeros(4), disturbed, inequalities, allowed)
        return distribution.y(distribution.draw(200, random))

    first = draws(0.0)
    for _ in range(5):
        assert (np.abs(draws(1e-13) - first) <= 1e-7 * sigma + 1e-12).all()


def test_values_along_lines_have_quantiles_of_the_normal_distribution():
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
def test_values_along_lines_keep_the_bounds_of_all_unknowns(walks, monkeypatch):
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


COUNT = 4000
COVARIANCE = np.array([[4.0, 1.5], [1.5, 1.0]])


def draws(mean, rows, least, allowed, covariance=COVARIANCE, seed=5, count=COUNT):
    given = [np.asarray(v, dtype=float) for v in (mean, rows, least, allowed)]
    mean, rows, least, allowed = given
    random = np.random.default_rng(seed)
    distribution = TruncatedNormal.of(mean, covariance, (rows, least), allowed)
    drawn = distribution.y(distribution.draw(count, random))
    assert drawn.shape == (count, len(mean))
    assert (drawn @ rows.T >= least - 1e-7).all()
    return drawn


def assert_follows(drawn, distribution):
    assert kstest(drawn, distribution.cdf).pvalue > 0.01


def test_truncated_normal_without_bounds_is_normal():
    drawn = draws([1.0, -2.0], np.zeros((0, 2)), [], [1.0, -2.0])
    assert drawn.mean(axis=0) == pytest.approx([1.0, -2.0], abs=0.12)
    assert np.cov(drawn.T) == pytest.approx(COVARIANCE, rel=0.1)


@pytest.mark.parametrize("walks", [False, True])
def test_truncated_normal_on_a_bound_is_half_normal(walks, monkeypatch):
    if walks:
        monkeypatch.setattr(truncated, "MAX_REJECTION_ROUNDS", 1)
    drawn = draws([0.0, 0.0], [[1.0, 0.0]], [0.0], [0.0, 0.0])
    assert_follows(drawn[:, 0], halfnorm(scale=2.0))
    # The other follows:  y1 | y0  is normal about 1.5 / 4 y0 with 1 - 1.5^2 / 4.
    assert_follows(drawn[:, 1] - 0.375 * drawn[:, 0], norm(scale=np.sqrt(1 - 1.5**2 / 4)))


def test_truncated_normal_far_outside_of_its_bounds():
    between = [[1.0, 0.0], [-1.0, 0.0]]
    # Five standard deviations outside: it lies near the bound.
    drawn = draws([-10.0, 0.0], between, [0.0, -6.0], [0.0, 0.0])
    assert_follows(drawn[:, 0], truncnorm(5.0, 8.0, loc=-10.0, scale=2.0))
    assert drawn[:, 0].mean() < 0.5


def test_truncated_normal_in_a_corner():
    # In a corner.
    mean = [-3.0, 0.0, 4.0]
    drawn = draws(mean, np.eye(3), np.zeros(3), np.zeros(3), np.eye(3), seed=1)
    for k, middle in enumerate(mean):
        assert_follows(drawn[:, k], truncnorm(-middle, np.inf, loc=middle))


def test_truncated_normal_without_room_or_variance_stays():
    between = [[1.0, 0.0], [-1.0, 0.0]]
    # Without room, and without variance, it stays.
    drawn = draws([3.0, 0.0], between, [1.0, -1.0], [1.0, 0.0])
    assert drawn[:, 0] == pytest.approx(np.ones(COUNT), abs=1e-9)
    assert_follows(drawn[:, 1], norm(0.375 * (1.0 - 3.0), np.sqrt(1 - 1.5**2 / 4)))
    drawn = draws([1.0, 1.0], np.zeros((0, 2)), [], [1.0, 1.0], np.zeros((2, 2)), count=3)
    assert (drawn == 1.0).all()
    flat = np.diag([1.0, 0.0])
    drawn = draws([0.0, 0.0], np.eye(2), np.zeros(2), [0.0, 0.0], flat, seed=0, count=100)
    assert drawn[:, 0].std() > 0.4 and not drawn[:, 1].any()


def test_truncated_normal_between_close_bounds():
    """A slab of a thousandth of a standard deviation, askew: along it everything is drawn."""
    across, along = np.array([[0.6, 0.8, 0.0], [0.8, -0.6, 0.0]])
    rows = np.array([across, -across])
    drawn = draws(np.zeros(3), rows, [2.0, -2.001], 2.0 * across, np.eye(3), seed=2)
    assert_follows(drawn @ along, norm)
    assert_follows(drawn[:, 2], norm)
    assert_follows(drawn @ across, uniform(2.0, 0.001))


@pytest.mark.parametrize("width", [1e-6, 1e-8, 3e-9])
def test_truncated_normal_between_oblique_bounds_that_nearly_meet(width):
    """Between x + y = 0 and a width more: rounding of so sharp a curvature is larger than one."""
    rows = np.array([[1.0, 1.0, 0.3], [-1.0, -1.0, -0.3], [0.2, -0.7, 1.0]])
    least, start = [0.0, -width, -50.0], [width / 2, 0.0, 0.0]
    drawn = draws(np.zeros(3), rows, least, start, np.eye(3), seed=4)
    across = drawn @ rows[0]
    assert across.min() >= -1e-9 and across.max() <= width + 1e-9
    along = drawn @ np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    assert along.std() == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("angle", np.linspace(0.1, 3.0, 8))
def test_values_at_a_bound_are_even_quantiles_however_the_bound_is_rounded(angle):
    direction = np.array([np.cos(angle), np.sin(angle), 0.3])
    direction /= np.linalg.norm(direction)
    origin = np.zeros(3)
    bounds = np.outer([1.0, 3.0, 7.0], direction), np.zeros(3)
    distribution = truncated.TruncatedNormal.of(origin, np.eye(3), bounds, origin)
    z = distribution.draw(1000, np.random.default_rng(0))
    values = distribution.values(direction[None, :], z)[:, 0]
    shares = (np.arange(1000) + 0.5) / 1000
    assert np.sort(values) == pytest.approx(halfnorm.ppf(shares), rel=1e-6, abs=1e-9)
