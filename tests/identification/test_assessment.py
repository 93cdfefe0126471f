"""How good a fit is, and how sure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.identification.assessment import certainty, moduli_error, pinned_by
from bubblefit.identification.bounds import LawBounds
from bubblefit.identification.methods.descent import descend
from bubblefit.identification.nuisance import Nuisance, NuisanceOf
from bubblefit.identification.problem import Evaluation, FitProblem
from bubblefit.identification.unknowns import Unknowns
from bubblefit.materials.forms.registry import form_named
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.models.bubble import BubbleModel
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import CONSTANT, CUBIC, LAW, MODEL, PRESSURES, problem, single, targets

REACHED = np.array([0.08, 0.08, 0.08])
FLAT_LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0)
PRESSURE = Nuisance("pressure_offset", -3.0, 50.0, "kPa", "pressure_offset", 1e-3)
PRESSED = replace(CONSTANT, nuisance=NuisanceOf({"bubble": (PRESSURE,)}))


def test_moduli_error_is_the_largest_relative_one() -> None:
    law = HypoelasticLaw.linear(303.0, 220.0, 5.0)
    known_law = HypoelasticLaw.linear(300.0, 220.0, 4.0)
    error = moduli_error(law, known_law, np.array([0.1, 0.1, 0.1]))
    assert error == pytest.approx({"E1": 0.01, "E2": 0.0, "G12": 0.25})


def test_certainty_predicts_the_scatter_of_noisy_fits() -> None:
    """Linear propagation against five fits to freshly drawn noise, E1 in the middle."""
    fit = problem(CONSTANT)
    law = HypoelasticLaw.linear(400.0, 250.0, 12.0)
    clean = MembraneSolver(1e-10).run(MODEL, law)
    optimum, noise = [], 0.05
    predicted = None
    for seed in range(12):
        random = np.random.default_rng(seed)
        fields = clean.displacement + noise * random.standard_normal(clean.displacement.shape)
        fit.comparisons[0].objective = FieldObjective(targets(fields))
        point = fit.evaluate(CONSTANT.at(np.array([12.0, 250.0, 400.0])), True)
        best, _ = descend(fit, point, 1e-7, 10**6)
        optimum.append(best.coefficients)
        predicted = certainty(fit, best, law, clean.strain_max)
    scatter = np.std(optimum, axis=0, ddof=1) / [12.0, 250.0, 400.0]
    sigma = [predicted.sigma[name][0] for name in ("G12", "E2", "E1")]
    assert predicted.noise["bubble"] == pytest.approx(noise, rel=0.1)
    assert scatter == pytest.approx(sigma, rel=0.6)


def test_what_a_nuisance_hides_is_not_determined() -> None:
    """At a single pressure that is not known for sure, moduli can only be told up to a factor."""
    model = replace(MODEL, pressures=PRESSURES[-1:], increments=PRESSURES)
    without, beside = flat(CONSTANT, model), flat(PRESSED, model)
    sure = pinned_by(without, evaluated(without), FLAT_LAW, REACHED, [0])
    unsure = pinned_by(beside, evaluated(beside), FLAT_LAW, REACHED, [0])
    for name in ("E1", "E2"):
        assert sure[name].max() < 0.02 and unsure[name].min() > 0.5


def flat(unknowns: Unknowns, model: BubbleModel = MODEL) -> FitProblem:
    """A fit to what constant moduli show."""
    fields = MembraneSolver(1e-10).run(model, FLAT_LAW).displacement
    data = [FieldTarget(p, u) for p, u in zip(model.pressures, fields, strict=True)]
    return single(model, MembraneSolver(), FLAT_LAW, FieldObjective(data), unknowns)


def evaluated(fit: FitProblem) -> Evaluation:
    point = fit.evaluate(fit.unknowns.at(np.array([12.0, 250.0, 400.0])), True)
    assert point is not None
    return point


def test_what_the_data_never_reach_is_not_certain() -> None:
    """Knots far beyond the strains reached do not change the residual at all."""
    ends = [0.13, 0.13, 0.6]
    form = form_named("spline", {"knots": 7}, ends)
    ranges = {"E1": (20.0, 2000.0), "E2": (20.0, 1000.0), "G12": (0.5, 200.0)}
    unknowns = Unknowns.of(form, 0.24, ends, LawBounds.of_moduli(ranges))
    law = HypoelasticLaw(np.repeat([12.0, 250.0, 400.0], 7), 0.24, ends, form=form)
    fit = replace(flat(CONSTANT), law=law, unknowns=unknowns)
    point = fit.evaluate(unknowns.at(law.beta), True)
    assert point.jacobian is not None and point.histories[0].strain_max[2] < 0.2
    sure = certainty(fit, point, law, np.array([0.05, 0.05, 0.5]))
    shear = sure.sigma["G12"]
    assert shear[0] < 1.0 and shear[-1] > 5.0
    assert any(words.startswith("G12 is uncertain") for words in sure.undetermined)


def test_words_name_what_lies_on_its_bound() -> None:
    fit = problem(replace(CUBIC, nuisance=NuisanceOf({"bubble": (PRESSURE,)})))
    y = fit.unknowns.at(np.where(np.arange(12) == 0, CUBIC.box[1], LAW.beta))
    y[12] = PRESSURE.lower
    words = certainty(fit, fit.evaluate(y, True), LAW, REACHED).undetermined
    assert "beta_0 lies on its upper bound" in words
    assert "pressure_offset lies on its lower bound" in words
    tight = LawBounds.of_moduli({"E1": (20.0, 400.0), "E2": (250.0, 900.0), "G12": (0.5, 200.0)})
    fit = flat(replace(CONSTANT, bounds=tight))
    words = certainty(fit, evaluated(fit), FLAT_LAW, REACHED).undetermined
    assert "E1 touches its upper bound: the data ask for more stiffness" in words
    assert "E2 touches its positivity margin: the data ask for less stiffness" in words
