"""inference/assessment.py: certainty of a fit, and discrepancies with their causes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.experiments.strips.load_objective import StripObjective
from bubblefit.inference.assessment import (
    certainty,
    discrepancies,
    moduli_from,
    residuals_by_quantity,
)
from bubblefit.inference.descent import descend
from bubblefit.inference.discrepancy import notes_of_discrepancies
from bubblefit.inference.linear import FineMeshLimit, posteriors_of
from bubblefit.inference.noise import Noise, correlated_count_of
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.wording import percent
from scipy.interpolate import BSpline

from .cases import (
    CONSTANT,
    LAW,
    MODEL,
    NODES,
    PRESSURES,
    bubble_problem,
    clean_fit,
    correlated_noise_root,
    follows,
    scatter_of,
    targets,
)

CONSTANT_LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0)
PRESSURE = Nuisance("pressure_offset", -290.0, 3000.0, "kPa", "pressure_offset", 1e-3)
PRESSED = replace(CONSTANT, nuisance=NuisanceUnknowns({"bubble": (PRESSURE,)}))


def test_certainty_predicts_the_scatter_of_noisy_fits():
    fit, moduli, noise = bubble_problem(CONSTANT), np.array([12.0, 250.0, 400.0]), 0.05
    clean = MembraneSolver(1e-10).run(MODEL, CONSTANT_LAW)
    drawn = noise * np.random.default_rng(2).standard_normal(clean.displacement.shape)
    fit.comparisons[0].objective = FieldObjective(targets(clean.displacement + drawn))
    truth = CONSTANT.at(moduli)
    point = fit.evaluate(truth, True)
    scatter = scatter_of(fit, point, {"bubble": noise})
    predicted = certainty(fit, point, CONSTANT_LAW, clean.strain_max)
    assert predicted.noise.level["bubble"] == pytest.approx(noise, rel=0.03)  # of 1281 values: 2 %
    sigma = [predicted.linear_sigma[name][0] for name in ("G12", "E2", "E1")]
    assert sigma == pytest.approx(CONSTANT.to_coefficients @ scatter / moduli, rel=0.03)
    assert [predicted.sigma[name][0] for name in ("G12", "E2", "E1")] == pytest.approx(
        sigma, rel=0.01
    )
    assert not predicted.notes
    limit = FineMeshLimit(np.zeros_like(point.unknowns), 3 * point.residual, 0 * point.residual)
    thrice = certainty(fit, point, CONSTANT_LAW, clean.strain_max, limit)
    assert thrice.linear_sigma["G12"][0] == pytest.approx(3 * sigma[0])
    assert thrice.noise_sigma["G12"] == pytest.approx(thrice.sigma["G12"])
    (words,) = thrice.notes
    most = percent(thrice.sigma["G12"].max())
    assert words.startswith(f"G12 is uncertain by up to {most} (1 sigma at 0.15 mm")
    best, _ = descend(fit, point, 1e-7, 10**6, norms=True)
    off = best.unknowns - truth - follows(fit, point, -point.residual)
    assert np.abs(off / scatter).max() < 0.05  # 0.016: G12 is not quite linear


def test_moduli_at_one_unsure_pressure_are_determined_up_to_a_factor():
    """At a single pressure that is not known for sure, moduli can only be told up to a factor."""
    model, found = replace(MODEL, pressures=PRESSURES[-1:], increments=PRESSURES), []
    for unknowns in (CONSTANT, PRESSED):
        fit = constant_bubble_fit(unknowns, model)
        point = evaluated(fit)
        noise = Noise.from_residual(fit, point.residual)
        posterior = posteriors_of(fit, point, noise)[0]
        strains = {name: np.linspace(0.0, 0.08, 5) for name in ("E1", "E2", "G12")}
        sigma = noise.residual_sigma
        found.append(moduli_from(fit, point, posterior, CONSTANT_LAW, strains, [0], sigma))
    for name in ("E1", "E2"):
        assert found[0][name].sigma.max() < 0.02 and found[1][name].sigma.min() > 0.4


def constant_bubble_fit(unknowns, model=MODEL):
    return clean_fit(model, CONSTANT_LAW, unknowns)


def evaluated(fit):
    return fit.evaluate(fit.unknowns.at(np.array([12.0, 250.0, 400.0])), True)


def test_modulus_beyond_the_strains_reached_is_not_determined():
    ends = [0.13, 0.13, 0.6]
    form = form_named("spline", {"knots": 7}, ends)
    ranges = {"E1": (20.0, 2000.0), "E2": (20.0, 1000.0), "G12": (0.5, 200.0)}
    unknowns = Unknowns.of(form, 0.24, ends, LawBounds.of_moduli(ranges))
    law = HypoelasticLaw(np.repeat([12.0, 250.0, 400.0], 7), 0.24, ends, form=form)
    fit = replace(constant_bubble_fit(CONSTANT), law=law, unknowns=unknowns)
    point = fit.evaluate(unknowns.at(law.beta), True)
    assert point.jacobian is not None and point.histories[0].strain_max[2] < 0.2
    sure = certainty(fit, point, law, np.array([0.05, 0.05, 0.5]))
    shear = sure.sigma["G12"]
    assert shear[0] < 1.0 and shear[-1] > 5.0
    assert not sure.moduli["G12"].determined[-1]
    assert any(words.startswith("G12 is not determined between") for words in sure.notes)


def test_sigma_grows_with_root_of_correlated_count():
    random = np.random.default_rng(5)
    nodes, found = NODES, {}
    mixes = {
        "white": 0.2 * np.eye(len(nodes)),
        "shared": 0.2 * correlated_noise_root(20.0),
        "smooth": None,
    }
    for name, mix in mixes.items():
        fit = bubble_problem()
        objective = fit.comparisons[0].objective
        moved = [
            t.displacement
            + (0.03 if mix is None else mix @ random.standard_normal((len(nodes), 3)))
            for t in objective.targets
        ]
        objective.targets = tuple(
            replace(t, displacement=u, positions=nodes)
            for t, u in zip(objective.targets, moved, strict=True)
        )
        point = fit.evaluate(fit.unknowns.at(LAW.beta), True)
        found[name] = certainty(fit, point, LAW, np.full(3, 0.08))
        if name == "shared":
            count = correlated_count_of(objective, point.residual)
            assert count == found[name].noise.correlated_count["bubble"]
    # A smooth misfit of 0.03 mm, below 0.05 mm to reckon with, does not tell.
    assert found["smooth"].noise.correlated_count == {"bubble": 1.0}
    assert found["white"].noise.correlated_count["bubble"] == pytest.approx(1.0, abs=0.15)
    assert 3.0 < found["shared"].noise.correlated_count["bubble"] < 12.0
    for name in ("E1", "E2", "G12"):
        ratio = found["shared"].linear_sigma[name] / found["white"].linear_sigma[name]
        noise_ratio = found["shared"].noise.level["bubble"] / found["white"].noise.level["bubble"]
        shared, white = (found[mix].noise.correlated_count["bubble"] for mix in ("shared", "white"))
        many = shared / white
        # Noise that is shared leaves blocks of other norms, and so of other weights.
        assert ratio == pytest.approx(noise_ratio * np.sqrt(many), rel=0.15)


def test_residuals_of_a_quantity_are_those_of_its_blocks():
    field = SimpleNamespace(sizes=(2, 2, 2, 1, 1, 1), quantities=("dx", "dy", "dz"))
    load = SimpleNamespace(sizes=(3,), quantities=())
    comparisons = [
        SimpleNamespace(name=name, objective=own) for name, own in (("b", field), ("s", load))
    ]
    ends = [slice(0, 9), slice(9, 12)]
    problem = SimpleNamespace(comparisons=comparisons, rows=lambda k: ends[k])
    numbers = residuals_by_quantity(problem)
    assert {name: rows.tolist() for name, rows in numbers.items()} == {
        "b: dx": [0, 1, 6], "b: dy": [2, 3, 7], "b: dz": [4, 5, 8], "s": [9, 10, 11],
    }  # fmt: skip


@pytest.mark.parametrize(("columns", "names"), [(1, []), (2, ["field"]), (3, [])])
def test_smooth_residual_is_a_discrepancy_on_a_sheet_only(columns, names):
    """Places of gauges have three columns, rows of a table one."""
    random = np.random.default_rng(0)
    places = random.uniform(-1.0, 1.0, (600, columns))
    residual = places[:, 0] ** 2 + 0.01 * random.standard_normal(600)
    objective = SimpleNamespace(
        positions=(places,), specimens=None, split=lambda values: [values], unit="mm",
        least_noise=0.01, measured=np.full(600, 2.0),
    )  # fmt: skip
    comparison = SimpleNamespace(name="field", objective=objective, may_run_aside=False, model=None)
    problem = SimpleNamespace(
        comparisons=[comparison], rows=lambda _: slice(None), scale=np.ones(600),
        unknowns=SimpleNamespace(count=3),
    )  # fmt: skip
    best = SimpleNamespace(jacobian=None)
    found = discrepancies(problem, residual, np.zeros(600), best, lambda _: 0.0)
    assert list(found) == names
    for discrepancy in found.values():
        assert discrepancy.is_systematic
        assert discrepancy.rms == pytest.approx(np.sqrt(np.mean(residual**2)), rel=0.02)
        assert discrepancy.relative_rms == pytest.approx(discrepancy.rms / 2.0)


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
        comparisons=[SimpleNamespace(name="warp", objective=objective, may_run_aside=True)],
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
