"""Comparisons, shared unknowns, specimens and folds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.experiments.bubble.targets import FieldTarget
from bubblefit.experiments.strips.load_objective import LoadObjective, StripObjective
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.discrepancy import DISCREPANCY, notes_of_discrepancies
from bubblefit.inference.folds import folds_of
from bubblefit.inference.linear import posteriors_of
from bubblefit.inference.noise import Noise
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.nuisance_verdicts import notes_of_verdicts, verdicts
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.specimen_discrepancy import specimen_discrepancy
from bubblefit.inference.unknowns import Unknowns
from bubblefit.inference.wrong_form import discrepancies
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.interpolate import BSpline
from scipy.stats import ttest_1samp

from ..complaints import complaint
from .cases import CUBIC, LAW, RANGE, differentiated, levenberg_marquardt

TIGHT = 1e-10
PRESSURE = Nuisance("pressure_offset", -18.0, 50.0, "kPa", "pressure_offset", 1e-3)
SHIFTS = tuple(Nuisance(f"offset_{axis}", -20.0, 20.0, "mm") for axis in "xyz")
SMALL = BubbleModel(disk_mesh(100.0, 96, "quarter"), 0.81, [0.05, 0.12, 0.2])
OTHER = BubbleModel(disk_mesh(80.0, 96, "quarter"), 0.81, [0.06, 0.15])


def comparison(name, model, *nuisance, **other):
    fields = MembraneSolver(TIGHT).run(model, LAW).displacement
    fields = fields + 0.02 * np.random.default_rng(5).standard_normal(fields.shape)
    return Comparison(name, model, MembraneSolver(TIGHT), to(model, fields), nuisance, **other)


def to(model, fields):
    return FieldObjective([FieldTarget(p, u) for p, u in zip(model.pressures, fields, strict=True)])


def fit_of(*comparisons):
    unknowns = Unknowns.of(CUBIC.form, 0.24, RANGE, CUBIC.bounds, comparisons)
    return FitProblem(comparisons, LAW, unknowns)


def two():
    """The nuisance of the first: what the objective knows on both sides of what the solver does."""
    first = comparison("bubble 1", SMALL, SHIFTS[2], PRESSURE, SHIFTS[0])
    return fit_of(first, comparison("bubble 2", OTHER, PRESSURE))


def test_nuisance_belongs_to_its_comparison_and_stays_inside_its_bounds():
    unknowns = two().unknowns
    own = {"offset_z": 0.1, "pressure_offset": 2.0, "offset_x": 0.3}
    names = *(f"bubble 1: {name}" for name in own), "bubble 2: pressure_offset"
    assert unknowns.nuisance.names == names and unknowns.count == 16
    y = np.concatenate([np.ones(12), [0.1, 2.0, 0.3, -4.0]])
    for name, values in (("1", own), ("2", {"pressure_offset": -4.0}), ("3", {})):
        assert unknowns.nuisance_values(f"bubble {name}", y) == values
    alone = fit_of(comparison("bubble 1", SMALL, PRESSURE))
    assert alone.unknowns.nuisance.names == ("pressure_offset",)
    a, c = unknowns.inequalities
    y = unknowns.at(LAW.beta)
    assert (a @ y >= c).all()
    for k, end in ((12, 20.1), (13, -18.1), (14, -20.1), (15, 50.1)):
        outside = y.copy()
        outside[k] = end
        assert (a @ outside < c).any()


def test_every_derivative_of_two_comparisons_with_nuisance_each():
    fit = two()
    y = fit.unknowns.at(LAW.beta * 1.02)
    y[12:] = [0.5, 1.5, -0.3, -2.0]
    point = differentiated(fit, y, range(16))
    assert point.jacobian.shape == (len(point.residual), 16)
    own = fit.rows(0), fit.rows(1)
    assert not point.jacobian[own[1], 12:15].any() and not point.jacobian[own[0], 15].any()
    assert point.jacobian[own[0], 12:15].any(axis=0).all() and point.jacobian[own[1], 15].any()


def test_both_offsets_and_the_law_are_found():
    fit = two()
    truth = {"bubble 1": (0.8, 2.0, 0.2), "bubble 2": (-3.0,)}
    for one in fit.comparisons:
        values = dict(zip((n.name for n in one.nuisance), truth[one.name], strict=True))
        offset = {"pressure_offset": 1e-3 * values["pressure_offset"]}
        moved = one.solver.run(one.model.with_parameters(offset), LAW)
        shift = [values.get(f"offset_{axis}", 0.0) for axis in "xyz"]
        one.objective = to(one.model, moved.displacement + shift)
    optimum = levenberg_marquardt(fit, fit.unknowns.at(LAW.beta * 1.05), 1e-8, 60)
    assert optimum.value < 1e-7
    assert optimum.best.unknowns[12:] == pytest.approx([0.8, 2.0, 0.2, -3.0], abs=1e-4)


class Plain:
    name, external = "plain", True

    def run(self, model, law, *unused):
        return MembraneSolver(TIGHT).run(model, law)


def test_a_solver_without_derivatives_runs_a_model_with_the_offset():
    fit = two()
    plain = fit.with_solvers([Plain(), Plain()])
    y = fit.unknowns.at(LAW.beta)
    y[12:] = [0.5, 1.5, -0.3, -2.0]
    expected = fit.evaluate(y, False, warm=False).residual
    assert plain.evaluate(y, False).residual == pytest.approx(expected, rel=1e-6, abs=1e-9)
    assert fit.differentiates and not plain.differentiates
    with pytest.raises(SolverFailure, match="no derivatives"):
        plain.comparisons[0].differentiate(LAW, range(12), {"pressure_offset": 0.0}, False)


def test_a_problem_says_what_does_not_go_together():
    first, second = comparison("bubble 1", SMALL, PRESSURE), comparison("bubble 2", OTHER)
    unknowns = Unknowns.of(CUBIC.form, 0.24, RANGE, CUBIC.bounds, [second])
    assert "nuisance of bubble 1" in complaint(FitProblem, (first, second), LAW, unknowns)
    assert "a name of their own" in complaint(FitProblem, (second, second), LAW, unknowns)
    assert "expected comparisons" in complaint(FitProblem, (), LAW, unknowns)


def test_what_contracts_asks_for_a_positive_definite_law():
    strip = comparison("strip", SMALL, contracts=True)
    unknowns = Unknowns.of(CUBIC.form, 0.24, RANGE, CUBIC.bounds, [strip])
    assert unknowns.definite_nu12 == 0.24 and CUBIC.definite_nu12 is None
    assert len(unknowns.inequalities[0]) > len(CUBIC.inequalities[0])
    plain = replace(unknowns, definite_nu12=None)
    assert plain.inequalities[0].shape == CUBIC.inequalities[0].shape
    assert shared_fit(NU12).unknowns.definite_nu12 == 0.5  # free: the largest that it may be


NU12 = Nuisance("nu12", 0.0, 0.5, "", start=0.3, law_parameter="nu12", shared=True)
THICKNESS = Nuisance(
    "thickness", 0.6, 1.0, "mm", "thickness", prior=0.02, weight=1e-3, start=0.8, shared=True,
    hint="only the product",
)  # fmt: skip
SHIFT = Nuisance("offset_z", -20.0, 20.0, "mm")
BUBBLE = BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.8, [0.05, 0.12, 0.2])
STRIP = straight_strip("fill", 22.78, 27.0, 0.8, increments=5)


def shared_fit(*shared, law=LAW):
    solver = MembraneSolver(TIGHT)
    bubble = to(BUBBLE, solver.run(BUBBLE, law).displacement)
    loads = solver.run(STRIP, law).load
    pulled = LoadObjective(STRIP.elongations, STRIP.elongations, loads, 1000.0, least_noise=2.0)
    own = (SHIFT, *shared, PRESSURE)  # what is shared need not come first
    comparisons = (
        Comparison("bubble", BUBBLE, MembraneSolver(TIGHT), bubble, own),
        Comparison("strip", STRIP, MembraneSolver(TIGHT), pulled, tuple(reversed(shared)),
                   contracts=True),
    )  # fmt: skip
    unknowns = Unknowns.of(CUBIC.form, 0.24, RANGE, CUBIC.bounds, comparisons)
    return FitProblem(comparisons, law, unknowns)


def test_what_is_shared_is_one_unknown():
    nuisance = NuisanceUnknowns({"a": (SHIFT, NU12), "b": (NU12, PRESSURE, THICKNESS)})
    assert nuisance.names == ("nu12", "thickness", "a: offset_z", "b: pressure_offset")
    assert nuisance.positions("a").tolist() == [2, 0]
    assert nuisance.positions("b").tolist() == [0, 3, 1]
    values = np.array([0.2, 0.9, 3.0, 4.0])
    assert nuisance.values("b", values) == {"nu12": 0.2, "pressure_offset": 4.0, "thickness": 0.9}
    assert nuisance.start.tolist() == [0.3, 0.8, 0.0, 0.0]
    assert nuisance.of_law(values) == {"nu12": 0.2}
    # A step may leave the bounds by rounding, a law may not.
    assert nuisance.of_law(np.array([-1e-12, 0.9, 0.0, 0.0])) == {"nu12": 0.0}
    assert NuisanceUnknowns({"a": (NU12,)}).names == ("nu12",)


def test_every_derivative_with_nu12_and_thickness():
    fit = shared_fit(NU12, THICKNESS)
    y = fit.unknowns.at(LAW.beta * 1.02)
    assert y[12:].tolist() == [0.3, 0.8, 0.0, 0.0]
    y[12:] = [0.27, 0.83, 0.4, 1.5]
    point = differentiated(fit, y, (5, 12, 13, 14, 15))
    # The prior's own row: 0.03 mm from where it is known to be, of 0.02 mm.
    assert point.residual[-1] == pytest.approx(1e-3 * 0.03 / 0.02)
    assert point.jacobian[fit.rows(1), 12:14].any(axis=0).all()
    assert not point.jacobian[fit.rows(1), 14:].any()


ENDS = np.array([0.1, 0.1, 0.05])


@pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
def test_only_moduli_times_thickness_is_known(thickness_change):
    """Softer moduli of a thicker sheet change nothing at all, whatever its thickness does."""
    law = replace(LAW, thickness_change=thickness_change)
    point, posterior = evaluated(shared_fit(NU12, replace(THICKNESS, prior=None), law=law))
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


def test_a_prior_of_the_thickness_is_the_uncertainty_of_the_moduli():
    posteriors = [evaluated(shared_fit(*shared))[1] for shared in ((THICKNESS,), ())]
    (thick, *_) = verdicts(posteriors[0], ENDS)
    assert thick.sigma == pytest.approx(0.02, rel=1e-3) and not thick.determined
    assert "(known to 0.02 mm before)" in thick.words
    known, free = (np.diag(p.covariance)[:12] ** 0.5 / p.best[:12] for p in posteriors)
    np.testing.assert_allclose(known**2, free**2 + (0.02 / 0.8) ** 2, rtol=1e-3)


def test_nu12_is_found_from_another():
    fit = shared_fit(NU12)
    optimum = levenberg_marquardt(fit, fit.unknowns.at(LAW.beta * 1.05), 1e-8, 60)
    assert optimum.value < 1e-7
    assert optimum.best.unknowns[12] == pytest.approx(LAW.nu12, abs=1e-5)
    assert fit.unknowns.law(fit.law, optimum.best.unknowns).nu12 == optimum.best.unknowns[12]


def test_verdicts_of_bounds_and_of_offsets():
    fit = shared_fit(replace(NU12, start=0.2, upper=LAW.nu12))
    _, posterior = evaluated(fit, [LAW.nu12, -0.02, 0.1])
    nu12, shift, pressure = verdicts(posterior, ENDS)
    assert nu12.on == "upper" and nu12.words.startswith("0.24, on its upper bound, 1 sigma 0.")
    assert nu12.numbers["on_bound"] == "upper" and nu12.numbers["determined"]
    assert (shift.name, shift.on, shift.value) == ("bubble: offset_z", "", -0.02)
    assert shift.sigma == pytest.approx(posterior.covariance[13, 13] ** 0.5)
    assert f"1 sigma {shift.sigma:.2g} mm" in shift.words
    assert pressure.unit == "kPa" and pressure.determined and not pressure.shared
    covariance = posterior.covariance
    rho = covariance[12, 13] / np.sqrt(covariance[12, 12] * covariance[13, 13])
    assert abs(rho) <= 1 and all(abs(value) <= 1 for value in nu12.correlation.values())


PLACES = np.linspace(0.1, 3.0, 30)
#: Of a law whose modulus is a constant: the load is proportional.
SLOPES = 100.0 * PLACES[:, None] @ np.array([[1.0, 0.0, 0.0]])


def scattered(count, random):
    """(count, n) N: stiffer by a factor each, uneven over half of the curve, and noise."""
    distance = np.abs(PLACES[:, None] - PLACES)
    root = np.linalg.cholesky(np.exp(-((distance / 1.5) ** 2)) + 1e-6 * np.eye(len(PLACES)))
    factor = 20.0 * PLACES * random.standard_normal((count, 1))
    uneven = 15.0 * random.standard_normal((count, len(PLACES))) @ root.T
    return factor + uneven + random.standard_normal((count, len(PLACES)))


def found(residuals, places=None):
    own = places or [PLACES] * len(residuals)
    return specimen_discrepancy(list(residuals), own, [SLOPES[: len(p)] for p in own], "N")


@pytest.mark.parametrize("specimens", [3, 5, 10])
def test_specimens_that_scatter_are_seldom_told(specimens):
    random, told = np.random.default_rng(specimens), 0
    sets = 400
    for _ in range(sets):
        off = scattered(specimens, random)
        off -= (off @ SLOPES[:, :1] / (SLOPES[:, 0] @ SLOPES[:, 0])).mean() * SLOPES[:, 0]
        one = found(off)
        assert one is not None and one.specimen_count == specimens
        told += one.is_significant
    assert told / sets <= 0.03


def test_of_three_specimens_it_is_the_square_of_students_t():
    """Beside the slope there is one shape to be tested, the load at no elongation."""
    off = scattered(3, np.random.default_rng(4))
    one, starts = found(off), [np.polyfit(PLACES, own, 1)[1] for own in off]
    assert one.f_ratio == pytest.approx(ttest_1samp(starts, 0.0).statistic ** 2, rel=1e-9)
    assert one.critical_ratio == pytest.approx(98.50, abs=0.01)


def test_a_wrong_form_is_told():
    random = np.random.default_rng(8)
    bend = 60.0 * ((PLACES / 1.5 - 1.0) ** 2 - 0.4)
    assert sum([found(bend + scattered(5, random)).is_significant for _ in range(100)]) > 70
    ten = [found(bend + scattered(10, random)) for _ in range(50)]
    assert all(one.is_significant for one in ten)
    # Without what another modulus would follow.
    beside = bend - SLOPES[:, 0] * (bend @ SLOPES[:, 0]) / (SLOPES[:, 0] @ SLOPES[:, 0])
    expected = float(np.sqrt(np.mean(beside**2)))
    assert np.mean([one.rms for one in ten]) == pytest.approx(expected, rel=0.1)
    (note,) = notes_of_discrepancies({"strips: warp": ten[0]})
    assert (note.kind, note.of) == (DISCREPANCY, "strips: warp")
    assert f"{ten[0].rms:.2g} N " in note and "all 10 specimens" in note


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
def test_what_all_specimens_have_in_common_points_to_its_cause(load, elongation, words):
    one = judged_strips(1.0, load, elongation)
    assert one.is_significant and one.specimen_count == 6
    first, *others = one.causes
    assert words in first.description and first.explained_share > 0.9
    assert all(other.explained_share < first.explained_share for other in others)
    (note,) = notes_of_discrepancies({"warp": one})
    assert words in note


def test_what_is_small_beside_the_load_is_no_warning():
    """Beyond chance, but 0.3 N: told of strips that carry 3 N, not of those that carry 3000."""
    small, large = judged_strips(10.0, 0.3, 0.0), judged_strips(0.01, 0.3, 0.0)
    assert small.is_systematic and small.f_ratio > 5 * small.critical_ratio
    assert small.relative_rms < 1e-3 and not small.is_significant
    assert not notes_of_discrepancies({"warp": small})
    assert large.relative_rms > 0.02 and large.is_significant


def test_what_a_spline_leaves_is_small_beside_scatter_and_load():
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


def test_what_the_law_can_follow_is_no_wrong_form():
    """All specimens stiffer alike: another modulus, not another form."""
    random = np.random.default_rng(9)
    for _ in range(20):
        off = scattered(5, random)
        before, after = found(off), found(400.0 * PLACES + off)
        assert after.f_ratio == pytest.approx(before.f_ratio, rel=1e-6)
    # Two of four broke early: their curves say too little of the whole.
    places = [PLACES, PLACES, PLACES[:15], PLACES[:15]]
    assert found([own[: len(at)] for own, at in zip(off, places, strict=False)], places) is None
    # Specimens that do not differ leave nothing to test against, nor do two, nor single points.
    assert found(off[:2]) is None and found(np.tile(off[:1], (5, 1))) is None
    assert (
        specimen_discrepancy([np.ones(1)] * 5, [np.ones(1)] * 5, [np.ones((1, 1))] * 5, "N") is None
    )


@pytest.mark.parametrize(
    ("specimens", "count", "shares"),
    [({"warp": [3, 3, 8]}, 2, [1, 2]), ({"warp": [5] * 5}, 3, [1, 2, 2]), ({}, 2, [])],
)
def test_every_fold_has_its_share(specimens, count, shares):
    """Two specimens are left out one by one; of five points of one specimen two, two and one."""
    folds = folds_of(specimens, count, 7)
    assert len(folds) == count and all(list(fold) == list(specimens) for fold in folds)
    assert sorted(int((~fold[name]).sum()) for fold in folds for name in specimens) == shares


def test_folds_leave_out_whole_specimens_or_single_points_once():
    whose = {"warp": [0, 0, 1, 1, 2, 2, 2], "bias": [4] * 9}
    folds, again, other = (folds_of(whose, 3, seed) for seed in (1, 1, 2))
    for name in whose:
        left = np.array([~fold[name] for fold in folds])
        assert (left.sum(axis=0) == 1).all() and left.any(axis=1).all(), name
        np.testing.assert_array_equal(left, [~fold[name] for fold in again])
    assert any((a["bias"] != b["bias"]).any() for a, b in zip(folds, other, strict=True))
    for fold in folds:
        out = np.array(whose["warp"])[~fold["warp"]]
        assert len(set(out)) == 1 and len(out) == whose["warp"].count(out[0])
