"""inference/problem.py: residuals and derivatives of a fit of one or several comparisons."""

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.inference.objective import Blocks
from bubblefit.inference.problem import FitProblem, WeightedProblem
from bubblefit.inference.unknowns import Unknowns
from bubblefit.processes import may_run_at_once
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.projects import fit_setup
from ..support.refusals import complaint
from .cases import (
    BUBBLE_OF_80_MM,
    BUBBLE_OF_100_MM,
    CONSTANT,
    CUBIC,
    EVERYTHING,
    LAW,
    NU12,
    PRESSURE,
    RANGE,
    THICKNESS,
    Failing,
    bubble_and_strip,
    bubble_problem,
    differentiated,
    noisy_bubble_comparison,
    two_bubbles,
)


@pytest.mark.parametrize("unknowns", [CUBIC, EVERYTHING, CONSTANT], ids=["12", "16", "3"])
def test_jacobian_of_a_bubble_against_differences(unknowns):
    fit = bubble_problem(unknowns, noise=0.02)
    fit.comparisons[0].solver = MembraneSolver(1e-10)
    coefficients = LAW.beta[list(unknowns.free)] * 1.02
    y = unknowns.at(coefficients)
    if unknowns.nuisance.names:
        y[unknowns.size :] = [0.3, -0.2, 0.5, 1.5]
    differentiated(fit, y)


def test_watch_hears_of_every_analysis_with_its_status():
    heard = []
    fit = bubble_problem(watch=lambda y, value, status, solver: heard.append((value, status)))
    fit.comparisons[0].solver = Failing(lambda run: run == 2)
    y = CUBIC.at(LAW.beta)
    fit.evaluate(y, True)
    assert fit.evaluate(y, False) is None
    assert len(heard) == fit.analyses == 2
    assert heard[0][1] == "ok" and heard[1] == (None, "on purpose")


def test_comparisons_side_by_side_give_what_they_give_one_after_the_other():
    """With warm starts, after a failure of the first, a change of the data, and from anew."""

    def analyses(processes):
        fit = two_bubbles()
        first, second = fit.comparisons
        first.solver = Failing(lambda run: run == 4)
        first.seconds = second.seconds = 1.0  # so that they run side by side from the beginning
        y = fit.unknowns.at(LAW.beta * 1.02)
        y[12:] = [0.5, 1.5, -0.3, -2.0]
        with may_run_at_once(processes):
            points = [fit.evaluate(y * factor, True) for factor in (1, 1.001, 1.003, 1.004, 1.005)]
            points.append(fit.evaluate(y * 1.006, False))
            pair = points[4].histories[1], points[5].histories[1]
            second.objective = second.objective.shifted(*pair)
            points.append(fit.evaluate(y * 1.007, True))
            fit.reset()
            points.append(fit.evaluate(y * 1.008, True))
            assert (fit._team is not None) == (processes > 1)
        assert first.warm_start is not None and second.warm_start is not None
        return fit, points

    (one, alone), (other, together) = analyses(1), analyses(2)
    assert [point is None for point in alone] == [k == 3 for k in range(8)]
    for a, b in zip(alone, together, strict=True):
        if a is None:
            assert b is None
            continue
        assert a.value == b.value and a.stable == b.stable
        np.testing.assert_array_equal(a.residual, b.residual)
        np.testing.assert_array_equal(a.jacobian, b.jacobian)
        for of_a, of_b in zip(a.histories, b.histories, strict=True):
            np.testing.assert_array_equal(of_a.displacement, of_b.displacement)
    assert one.failure == other.failure and one.analyses == other.analyses
    for a, b in zip(one.comparisons, other.comparisons, strict=True):
        np.testing.assert_array_equal(a.warm_start.path, b.warm_start.path)


def test_runs_without_derivatives_are_where_later_ones_start_also_side_by_side():
    def analyses(processes):
        fit = two_bubbles()
        for comparison in fit.comparisons:
            comparison.seconds = 1.0
        y = fit.unknowns.at(LAW.beta * 1.02)
        with may_run_at_once(processes):
            return fit.evaluate(y, False), fit.evaluate(y, True)

    for alone, together in zip(analyses(1), analyses(2), strict=True):
        np.testing.assert_array_equal(alone.residual, together.residual)
        for of_alone, of_together in zip(alone.histories, together.histories, strict=True):
            assert of_alone.iterations == of_together.iterations


def test_jacobian_of_two_bubbles_with_nuisance_against_differences():
    fit = two_bubbles()
    y = fit.unknowns.at(LAW.beta * 1.02)
    y[12:] = [0.5, 1.5, -0.3, -2.0]
    point = differentiated(fit, y, range(16))
    assert point.jacobian.shape == (len(point.residual), 16)
    own = fit.rows(0), fit.rows(1)
    assert not point.jacobian[own[1], 12:15].any() and not point.jacobian[own[0], 15].any()
    assert point.jacobian[own[0], 12:15].any(axis=0).all() and point.jacobian[own[1], 15].any()


def test_problem_refuses_comparisons_that_do_not_fit_its_unknowns():
    first, second = (
        noisy_bubble_comparison("bubble 1", BUBBLE_OF_100_MM, PRESSURE),
        noisy_bubble_comparison("bubble 2", BUBBLE_OF_80_MM),
    )
    unknowns = Unknowns.of(CUBIC.form, 0.24, RANGE, CUBIC.bounds, [second])
    assert "nuisance of bubble 1" in complaint(FitProblem, (first, second), LAW, unknowns)
    assert "a name of their own" in complaint(FitProblem, (second, second), LAW, unknowns)
    assert "expected comparisons" in complaint(FitProblem, (), LAW, unknowns)


def test_jacobian_with_shared_nu12_and_thickness_against_differences():
    fit = bubble_and_strip(NU12, THICKNESS)
    y = fit.unknowns.at(LAW.beta * 1.02)
    assert y[12:].tolist() == [0.3, 0.8, 0.0, 0.0]
    y[12:] = [0.27, 0.83, 0.4, 1.5]
    point = differentiated(fit, y, (5, 12, 13, 14, 15))
    # The prior's own row: 0.03 mm from where it is known to be, of 0.02 mm.
    assert point.residual[-1] == pytest.approx(1e-3 * 0.03 / 0.02)
    assert point.jacobian[fit.rows(1), 12:14].any(axis=0).all()
    assert not point.jacobian[fit.rows(1), 14:].any()


def gauges_and_strips(**weights):
    """A project of heights of a bubble and of stiffer strips, with weights of the strips."""
    heights = np.array([9.6, 12.1, 13.8, 15.2, 16.3, 17.4, 18.3])
    bubble = bf.Bubble.heights(
        np.linspace(0.01, 0.07, 7),
        [heights, 0.757 * heights, 0.776 * heights],
        places=[[0, 0], [50, 0], [0, 50]],
        radius=100.0,
        symmetry="quarter",
        elements=27,
    )
    strain = np.linspace(0.002, 0.03, 15)
    error = 5 * np.cos(np.arange(15))
    curves = {
        name: [(100 * np.expm1(strain), 20 * modulus * strain + error)]
        for name, modulus in (("warp", 900.0), ("fill", 250.0))
    }
    strips = bf.Strips(
        curves, width=25.0, gauge=100.0, increments=8, match="points", noise=5.0, **weights
    )
    law = bf.Law("constant", bounds={"E1": [20, 3000], "E2": [20, 3000], "G12": [1, 300]})
    return bf.Project.of([bubble, strips], law, fabric=bf.Fabric("made", thickness=0.8))


def merit_by_block(problem, residual):
    """Contribution of each block to what a fit minimises."""
    blocks = problem.blocks
    return np.array([
        Blocks([size], blocks.least_norms[[k]]).merit(residual[blocks.block_of == k])
        for k, size in enumerate(blocks.sizes)
    ])  # fmt: skip


def residuals_about_least_norms(problem):
    """Residuals whose norms are a third, and three times, of the least ones of their blocks."""
    random = np.random.default_rng(3)
    values = random.standard_normal(len(problem.scale))
    relative = problem.blocks.least_norms / problem.blocks.norms(values)
    return [share * relative[problem.blocks.block_of] * values for share in (1 / 3, 3.0)]


def test_block_counts_as_often_as_it_was_drawn_on_both_sides_of_its_least_norm():
    problem = fit_setup(gauges_and_strips()).problem()
    assert (problem.blocks.least_norms > 0).all()
    is_first = problem.blocks.block_of == 0
    for count in (0, 1, 2, 3):
        factors = np.where(is_first, float(count), 1.0)
        drawn = WeightedProblem.of(problem, factors)
        for residual in residuals_about_least_norms(problem):
            expected = merit_by_block(problem, residual)
            expected[0] *= count
            found = merit_by_block(drawn, factors * residual)
            found[0] -= 0.5 * drawn.blocks.least_norms[0] * (count == 0)  # a constant
            np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_least_norm_of_a_block_drawn_in_parts_is_multiplied_by_rms_of_factors():
    problem = fit_setup(gauges_and_strips()).problem()
    factors = np.sqrt(np.arange(len(problem.scale)) % 2 * 2.0)
    norms = problem.blocks.norms(factors) / np.sqrt(problem.blocks.sizes)
    least = WeightedProblem.of(problem, factors).blocks.least_norms
    np.testing.assert_allclose(least, norms * problem.blocks.least_norms)


def test_weights_of_tests_and_directions_multiply_what_is_minimised():
    plain = fit_setup(gauges_and_strips()).problem()
    (bubble, *strips) = plain.comparisons
    assert [c.name for c in strips] == ["strips: warp", "strips: fill"]
    weighted = fit_setup(gauges_and_strips(weight=16, weights={"warp": 3.0})).problem()
    factor_of = {bubble.name: 1.0, "strips: warp": 16 * 1.5, "strips: fill": 16 * 0.5}
    factors = np.concatenate([
        np.full(len(c.objective.sizes), factor_of[c.name]) for c in plain.comparisons
    ])  # fmt: skip
    for residual in residuals_about_least_norms(plain):
        found = merit_by_block(weighted, factors[plain.blocks.block_of] * residual)
        np.testing.assert_allclose(found, factors * merit_by_block(plain, residual), rtol=1e-9)


def test_weight_moves_a_fit_of_contradicting_tests_towards_one_of_them():
    strips = bf.fit(gauges_and_strips(), tests="strips", starts=1)
    off = [
        abs(fit.modulus("E1", 0.02).value - strips.modulus("E1", 0.02).value)
        for fit in (bf.fit(gauges_and_strips(weight=weight), starts=1) for weight in (1, 16))
    ]
    assert off[0] > 1.0
    assert off[1] < 0.2 * off[0]
