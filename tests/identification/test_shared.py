"""Unknowns that all comparisons share: nu12 and thickness, their derivatives, what is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.experiments.strips.objective import LoadObjective
from bubblefit.inference.assessment import notes_of_verdicts, verdicts
from bubblefit.inference.comparison import Comparison, Nuisance, NuisanceOf
from bubblefit.inference.linear import posteriors_of
from bubblefit.inference.noise import Noise
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.unknowns import Unknowns
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import CUBIC, LAW, RANGE, levenberg_marquardt

TIGHT = 1e-10
NU12 = Nuisance("nu12", 0.0, 0.5, "", start=0.3, law_parameter="nu12", shared=True)
THICKNESS = Nuisance(
    "thickness", 0.6, 1.0, "mm", "thickness", prior=0.02, weight=1e-3, start=0.8, shared=True,
    why="only the product",
)  # fmt: skip
SHIFT = Nuisance("offset_z", -20.0, 20.0, "mm")
PRESSURE = Nuisance("pressure_offset", -18.0, 50.0, "kPa", "pressure_offset", 1e-3)
BUBBLE = BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.8, [0.05, 0.12, 0.2])
STRIP = straight_strip("fill", 22.78, 27.0, 0.8, increments=5)


def fit_of(*shared: Nuisance, law: HypoelasticLaw = LAW) -> FitProblem:
    """A bubble with offsets of its own, and a strip along the fill, with data of a law."""
    solver = MembraneSolver(TIGHT)
    fields = solver.run(BUBBLE, law).displacement
    targets = [FieldTarget(p, u) for p, u in zip(BUBBLE.pressures, fields, strict=True)]
    loads = MembraneSolver(TIGHT).run(STRIP, law).load
    pulled = LoadObjective(STRIP.elongations, STRIP.elongations, loads, 1000.0, least_noise=2.0)
    own = (SHIFT, *shared, PRESSURE)  # what is shared need not come first
    comparisons = (
        Comparison("bubble", BUBBLE, MembraneSolver(TIGHT), FieldObjective(targets), own),
        Comparison("strip", STRIP, MembraneSolver(TIGHT), pulled, tuple(reversed(shared)),
                   contracts=True),
    )  # fmt: skip
    unknowns = Unknowns.of(CUBIC.form, 0.24, RANGE, CUBIC.bounds, comparisons)
    return FitProblem(comparisons, law, unknowns)


def test_what_is_shared_is_one_unknown() -> None:
    nuisance = NuisanceOf({"a": (SHIFT, NU12), "b": (NU12, PRESSURE, THICKNESS)})
    assert nuisance.names == ("nu12", "thickness", "a: offset_z", "b: pressure_offset")
    assert nuisance.places("a").tolist() == [2, 0]
    assert nuisance.places("b").tolist() == [0, 3, 1]
    values = np.array([0.2, 0.9, 3.0, 4.0])
    assert nuisance.values("b", values) == {"nu12": 0.2, "pressure_offset": 4.0, "thickness": 0.9}
    assert nuisance.start.tolist() == [0.3, 0.8, 0.0, 0.0]
    assert nuisance.of_law(values) == {"nu12": 0.2}
    # A step may leave the bounds by rounding, a law may not.
    assert nuisance.of_law(np.array([-1e-12, 0.9, 0.0, 0.0])) == {"nu12": 0.0}
    assert NuisanceOf({"a": (NU12,)}).names == ("nu12",)


def test_every_derivative_with_nu12_and_thickness() -> None:
    """Against differences of whole evaluations, in two comparisons and in the prior."""
    fit = fit_of(NU12, THICKNESS)
    y = fit.unknowns.at(LAW.beta * 1.02)
    assert y[12:].tolist() == [0.3, 0.8, 0.0, 0.0]
    y[12:] = [0.27, 0.83, 0.4, 1.5]
    point = fit.evaluate(y, True)
    assert point is not None and point.jacobian is not None
    for k in (5, 12, 13, 14, 15):
        step = 1e-4 * max(1.0, abs(y[k])) * np.eye(16)[k]
        ahead, behind = (fit.evaluate(y + s, False, warm=False) for s in (step, -step))
        assert ahead is not None and behind is not None
        column = (ahead.residual - behind.residual) / (2 * step[k])
        assert np.abs(point.jacobian[:, k] - column).max() < 2e-5 * np.abs(column).max(), k
    # The prior's own row: 0.03 mm from where it is known to be, of 0.02 mm.
    assert point.residual[-1] == pytest.approx(1e-3 * 0.03 / 0.02)
    assert point.jacobian[fit.rows(1), 12:14].any(axis=0).all()
    assert not point.jacobian[fit.rows(1), 14:].any()


@pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
def test_only_moduli_times_thickness_is_known(thickness_change: str) -> None:
    """Softer moduli of a thicker sheet change nothing at all, whatever its thickness does."""
    fit = fit_of(NU12, replace(THICKNESS, prior=None),
                 law=replace(LAW, thickness_change=thickness_change))  # fmt: skip
    y = fit.unknowns.at(LAW.beta)
    point = fit.evaluate(y, True)
    assert point is not None and point.jacobian is not None
    j, thickness = point.jacobian, y[13]
    along = j[:, :12] @ y[:12]
    assert np.abs(along).max() > 0.1
    np.testing.assert_allclose(along, thickness * j[:, 13], rtol=0, atol=1e-9 * np.abs(along).max())
    posterior = posteriors_of(fit, point, Noise.of(fit, point.residual))[0]
    nu12, thick, *_ = verdicts(posterior, np.array([0.1, 0.1, 0.05]))
    assert nu12.determined
    assert not thick.determined
    assert thick.words == (
        "0.8 mm: the data say nothing of it (it may be 0.6 to 1 mm); only the product"
    )
    said = [str(note) for note in notes_of_verdicts((nu12, thick))]
    assert said == [f"thickness is {thick.words}"]


def test_a_prior_of_the_thickness_is_the_uncertainty_of_the_moduli() -> None:
    """The thickness stays as uncertain as it was; sigma of a modulus grows by its share."""
    ends = np.array([0.1, 0.1, 0.05])
    found = {}
    for name, shared in (("with", (THICKNESS,)), ("without", ())):
        fit = fit_of(*shared)
        point = fit.evaluate(fit.unknowns.at(LAW.beta), True)
        assert point is not None
        found[name] = posteriors_of(fit, point, Noise.of(fit, point.residual))[0]
    (thick, *_) = verdicts(found["with"], ends)
    assert thick.sigma == pytest.approx(0.02, rel=1e-3) and not thick.determined
    assert thick.words.startswith("0.8 mm: the data say nothing of it (known to 0.02 mm before)")
    sigma = {n: p.sigma[:12] / p.best[:12] for n, p in found.items()}
    np.testing.assert_allclose(
        sigma["with"] ** 2, sigma["without"] ** 2 + (0.02 / 0.8) ** 2, rtol=1e-3
    )


def test_nu12_is_found_from_another() -> None:
    """Of data without noise, from a start and moduli that are off."""
    fit = fit_of(NU12)
    optimum = levenberg_marquardt(fit, fit.unknowns.at(LAW.beta * 1.05), 1e-8, 60)
    assert optimum.value < 1e-7
    assert optimum.best.unknowns[12] == pytest.approx(LAW.nu12, abs=1e-5)
    assert fit.unknowns.law(fit.law, optimum.best.unknowns).nu12 == optimum.best.unknowns[12]


def test_a_free_nu12_asks_for_a_law_that_is_definite_with_the_largest() -> None:
    assert fit_of(NU12).unknowns.definite_nu12 == 0.5
    assert fit_of().unknowns.definite_nu12 == 0.24


def test_verdicts_of_bounds_and_of_offsets() -> None:
    """The same for what one test has of its own."""
    fit = fit_of(replace(NU12, start=0.2, upper=LAW.nu12))
    y = fit.unknowns.at(LAW.beta)
    y[12:] = [LAW.nu12, -0.02, 0.1]
    point = fit.evaluate(y, True)
    assert point is not None
    posterior = posteriors_of(fit, point, Noise.of(fit, point.residual))[0]
    nu12, shift, pressure = verdicts(posterior, np.array([0.1, 0.1, 0.05]))
    assert nu12.on == "upper" and nu12.words.startswith("0.24, on its upper bound, 1 sigma 0.")
    assert nu12.numbers["on_bound"] == "upper" and nu12.numbers["determined"]
    assert (shift.name, shift.on, shift.value) == ("bubble: offset_z", "", -0.02)
    assert shift.sigma == pytest.approx(posterior.sigma[13])
    assert f"1 sigma {shift.sigma:.2g} mm" in shift.words
    assert pressure.unit == "kPa" and pressure.determined and not pressure.shared
    covariance = posterior.covariance
    rho = covariance[12, 13] / np.sqrt(covariance[12, 12] * covariance[13, 13])
    assert abs(rho) <= 1 and all(abs(value) <= 1 for value in nu12.correlation.values())
