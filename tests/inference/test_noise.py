"""inference/noise.py: noise of a fit against the noise given, by chi square."""

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.experiments.bubble.targets import FieldTarget
from bubblefit.inference.noise import (
    ABOVE_NOISE,
    BELOW_NOISE,
    SIGNIFICANCE,
    Misfit,
    Noise,
    NoiseTest,
    correlated_count,
    noise_tests,
    notes_of_noise,
    small_sample_factor,
)
from bubblefit.processes import may_run_at_once
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.ndimage import gaussian_filter

from ..builders.projects import fit_setup
from ..builders.unknowns import project as project_with_unknowns
from .cases import (
    CONSTANT,
    LAW,
    MODEL,
    NODES,
    correlated_noise_root,
    one_comparison_problem,
    reference,
    two_bubbles,
)

NOISE = 0.05


def fit_of_fields(given):
    fields = zip(MODEL.pressures, reference().displacement, strict=True)
    data = [FieldTarget(p, u, positions=NODES) for p, u in fields]
    objective = FieldObjective(data, "e", noise=given)
    return one_comparison_problem(MODEL, MembraneSolver(), LAW, objective, CONSTANT)


def test_noise_of_tests_side_by_side_is_that_of_one_after_the_other():
    fit = two_bubbles()
    residual = fit.evaluate(fit.unknowns.at(LAW.beta * 1.1), False).residual
    noises = []
    for processes in (1, 2):
        with may_run_at_once(processes):
            noises.append(Noise.from_residual(fit, residual))
    alone, together = noises
    assert alone.level == together.level and list(alone.level) == ["bubble 1", "bubble 2"]
    assert alone.correlated_count == together.correlated_count
    np.testing.assert_array_equal(alone.residual_sigma, together.residual_sigma)


@pytest.mark.parametrize("length", [1e-3, 15.0])
def test_noise_test_rejects_wrong_noise_and_seldom_right_noise(length):
    root, told = correlated_noise_root(length), {0.5: 0, 1.0: 0, 2.0: 0}
    problem, random = fit_of_fields(NOISE), np.random.default_rng(3)
    fields, count = len(MODEL.pressures), 30
    for _ in range(count):
        noise = np.concatenate(
            [(root @ random.standard_normal((len(root), 3))).T.ravel() for _ in range(fields)]
        )
        for times in told:
            tests = noise_tests(problem, NOISE * times * noise / problem.scale)
            kinds = [note.kind for note in notes_of_noise(tests)]
            expected = {0.5: [BELOW_NOISE], 2.0: [ABOVE_NOISE]}
            told[times] += kinds == expected.get(times, kinds) and bool(kinds)
    assert told[1.0] <= 2
    assert told[0.5] == told[2.0] == count


def test_noise_test_counts_values_and_degrees_of_freedom():
    fit = fit_of_fields(NOISE)
    residual = np.random.default_rng(5).standard_normal(len(fit.scale)) * NOISE / fit.scale
    (test,) = noise_tests(fit, residual).values()
    assert test.values == len(residual)
    assert test.degrees_of_freedom == pytest.approx(test.independent - 3)
    assert test.chi_square == pytest.approx(test.independent * test.misfit.ratio**2)
    assert test.probability_of_more + test.probability_of_less == pytest.approx(1.0)
    # Nobody gave it: nothing is tested.
    assert noise_tests(fit_of_fields(None), residual) == {}


def test_unknowns_take_degrees_of_freedom_from_their_priors_too(tmp_path):
    noise = ('match = "points"', 'match = "points"\nnoise = 40.0')
    unknowns = "nu12.prior = 0.05\nthickness.prior = 0.04"
    problem = fit_setup(project_with_unknowns(tmp_path, unknowns, noise)).problem()
    residual = np.random.default_rng(5).standard_normal(len(problem.scale)) * 40 / problem.scale
    tests = noise_tests(problem, residual).values()
    count = sum(test.independent for test in tests)
    free = sum(test.degrees_of_freedom for test in tests)
    assert problem.unknowns.count == 5
    assert free == pytest.approx(count * (1 - 5 / (count + 2)))


def test_notes_of_noise_name_significant_and_relevant_misfits():
    above = NoiseTest(Misfit(4.54, 3.0, "given", "N"), 300, 30.0, 29.0)
    below = NoiseTest(Misfit(1.5, 3.0, "given", "N"), 300, 30.0, 29.0)
    few = NoiseTest(Misfit(4.54, 3.0, "given", "N"), 300, 3.0, 2.0)
    # However many values say it: a twentieth is no matter.
    little = NoiseTest(Misfit(3.15, 3.0, "given", "N"), 10**6, 1e6, 1e6)
    assert little.probability_of_more < SIGNIFICANCE
    notes = notes_of_noise({"warp": above, "fill": below, "bias": few, "other": little})
    assert [(n.kind, n.of) for n in notes] == [
        (ABOVE_NOISE, "warp"), (BELOW_NOISE, "fill"),
    ]  # fmt: skip
    assert "4.54 N RMS, 1.51 times the noise given (3 N; 300 values count as 30 " in notes[0]
    assert above.numbers["probability_of_more"] == above.probability_of_more
    assert above.probability_of_more < SIGNIFICANCE < few.probability_of_more
    assert Misfit(1.0, 0.0, "assumed", "mm").ratio == np.inf


def test_bands_of_few_values_are_those_of_student():
    assert small_sample_factor(10) == 1.0 and small_sample_factor(500) == 1.0
    assert small_sample_factor(2) == pytest.approx(4.303 / 1.96, rel=1e-3)
    # As many unknowns as values: nothing tells the noise, and no modulus is determined.
    assert small_sample_factor(0) == small_sample_factor(-4) > 50


def test_few_points_that_a_fit_follows_closely_leave_wide_bands():
    fields = [
        FieldTarget(p, u[:1], positions=NODES[:1])
        for p, u in zip(MODEL.pressures, reference().displacement, strict=True)
    ]
    objective = FieldObjective(fields, "mm")
    problem = one_comparison_problem(MODEL, MembraneSolver(), LAW, objective, CONSTANT)
    freedom = 3 * len(fields) - problem.unknowns.count
    noise = Noise.from_residual(problem, np.zeros(3 * len(fields)))
    by_noise = objective.least_noise / problem.scale
    assert noise.residual_sigma / by_noise == pytest.approx(small_sample_factor(freedom))
    assert noise.smallest_residual_sigma == pytest.approx(by_noise)


GRID_SIDE, GRID_STEP = 40, 2.5
GRID = GRID_STEP * np.stack(
    np.meshgrid(np.arange(GRID_SIDE), np.arange(GRID_SIDE)), axis=-1
).reshape(-1, 2)


def smoothed_fields(width, count, seed=3):
    """Fields that are alike over a Gaussian of `width` steps: 4 pi width^2 err as one."""
    fields = np.random.default_rng(seed).standard_normal((count, GRID_SIDE, GRID_SIDE))
    if width:
        fields = np.array([gaussian_filter(field, width, mode="wrap") for field in fields])
    return [field.reshape(-1) for field in fields]


@pytest.mark.parametrize("width", [0.0, 0.7, 1.0, 1.5])
def test_correlated_count_of_smoothed_noise_is_area_of_its_kernel(width):
    fields = smoothed_fields(width, 24)
    expected = max(1.0, 4 * np.pi * width**2)
    assert correlated_count(fields, [GRID] * 24) == pytest.approx(expected, rel=0.15)


def test_correlated_count_does_not_depend_on_sizes_of_blocks():
    fields, places = smoothed_fields(1.0, 12), [GRID] * 12
    sizes = np.array([1.0, 100.0] * 6)
    scaled = [size * field for size, field in zip(sizes, fields, strict=True)]
    assert correlated_count(scaled, places) == pytest.approx(
        correlated_count(fields, places), rel=1e-12
    )


def test_alternating_or_missing_residuals_count_as_independent():
    # What changes its sign from point to point counts as independent; so does nothing at all.
    field = (-1.0) ** np.indices((GRID_SIDE, GRID_SIDE)).sum(axis=0).reshape(-1)
    assert correlated_count([field], [GRID]) == correlated_count([], []) == 1.0
    assert correlated_count([np.zeros(5), np.ones(1)], [GRID[:5], GRID[:1]]) == 1.0


def test_correlated_count_of_autoregressive_readings_along_a_curve():
    """Expect 4 = (1 + 0.6) / (1 - 0.6) that err as one, of readings that follow by 0.6."""
    random = np.random.default_rng(2)
    places = np.arange(2000.0)[:, None]
    white = random.standard_normal((6, 2000))
    follow = np.zeros_like(white)
    for k in range(1, 2000):
        follow[:, k] = 0.6 * follow[:, k - 1] + white[:, k]
    fine = places[:60]
    pieces = [piece for one in follow for piece in np.split(one[:1980], 33)]
    assert correlated_count(pieces, [fine] * len(pieces)) == pytest.approx(4.0, rel=0.15)
    for count in (10, 100):
        found = [
            correlated_count([random.standard_normal(count)], [places[:count]]) for _ in range(60)
        ]
        assert np.median(found) == 1.0 and np.mean(found) < 1.15
