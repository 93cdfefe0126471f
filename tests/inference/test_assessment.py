"""inference/assessment.py: certainty of a fit, by noise, mesh and correlation."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective
from bubblefit.inference.assessment import certainty, moduli_from, residuals_by_quantity
from bubblefit.inference.descent import descend
from bubblefit.inference.linear import FineMeshLimit, posteriors_of
from bubblefit.inference.noise import Noise, correlated_count_of
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.wording import percent

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
