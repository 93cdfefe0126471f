"""Sheets clamped under tension: closed forms, stiffness of the law, CalculiX' deck, a fit."""

from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import TENSION, BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.pretension import clamped_strain, force_per_width, slack_slopes, stretched

RADIUS, THICKNESS = 100.0, 0.5
LAW = HypoelasticLaw.linear(200.0, 100.0, 40.0, 0.3)
MESH = disk_mesh(RADIUS, 192, "quarter")
CENTRE = np.argmin(np.hypot(*MESH.points[:, :2].T))


def bubble(tension, pressures):
    return BubbleModel(MESH, THICKNESS, pressures, default_increments(pressures), tension=tension)


@pytest.mark.parametrize("tension", [0.5, 10.0])
def test_flat_sheet_under_tension_rises_by_pressure_over_four_tensions(tension):
    # A soap film: p = 4 T h / R^2 while h is small beside R and the tension hardly changes.
    pressures = np.array([1e-5, 1e-4]) * tension
    history = MembraneSolver().run(bubble((tension, tension), pressures), LAW)
    heights = history.displacement[:, CENTRE, 2]
    np.testing.assert_allclose(heights, pressures * RADIUS**2 / (4 * tension), rtol=0.01)


def test_strain_of_the_clamped_sheet_is_that_of_hooke():
    strain = clamped_strain(LAW, THICKNESS, np.array([4.0, 1.0]))
    e1, e2, nu12, nu21 = 200.0, 100.0, 0.3, 0.15
    stress = np.array([4.0, 1.0]) / THICKNESS
    hooke = [stress[0] / e1 - nu21 * stress[1] / e2, stress[1] / e2 - nu12 * stress[0] / e1]
    np.testing.assert_allclose(strain, hooke)
    thin = replace(LAW, thickness_change="incompressible")
    strain = clamped_strain(thin, THICKNESS, np.array([4.0, 1.0]))
    np.testing.assert_allclose(force_per_width(thin, THICKNESS, strain)[0], [4.0, 1.0])


def test_derivatives_of_the_slack_are_those_of_its_differences():
    model = bubble((4.0, 1.0), [0.01])
    names = ["beta_11", "beta_7", "beta_3", "nu12", *TENSION, "thickness", "slack_fill", "turn"]
    slopes = slack_slopes(model, LAW, names)
    for name, slope in zip(names, slopes.T, strict=True):
        ends = []
        for sign in (1.0, -1.0):
            law, changed = LAW, model
            if name == "nu12":
                law = replace(LAW, nu12=0.3 + sign * 1e-4)
            elif name in model.parameters:
                changed = model.with_parameters({name: sign * 1e-4})
            else:
                entry = np.arange(12) == int(name.removeprefix("beta_"))
                law = LAW.with_beta(LAW.beta + sign * 1e-2 * entry)
            ends.append(np.array(stretched(changed, law).slack))
        step = 1e-2 if name.startswith("beta") else 1e-4
        difference = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(slope, difference, rtol=1e-5, atol=1e-12, err_msg=name)


def test_tension_that_no_strain_carries_is_said():
    thin = replace(LAW, thickness_change="incompressible")
    with pytest.raises(SolverFailure, match="carries no tension of 500 and 500"):
        MembraneSolver().run(bubble((500.0, 500.0), [0.01]), thin)


def known_bubble(**sheet):
    pressures = [0.02, 0.05, 0.1]
    mesh = disk_mesh(RADIUS, 48, "quarter")
    model = BubbleModel(
        mesh, THICKNESS, pressures, default_increments(pressures), tension=(2.0, 2.0)
    )
    law = HypoelasticLaw.linear(200.0, 200.0, 200.0 / 2.6, 0.3)
    fields = MembraneSolver().run(model, law).displacement
    return bf.Bubble(
        mesh.points,
        fields,
        pressures,
        radius=RADIUS,
        elements=48,
        symmetry="quarter",
        sheet=bf.Sheet(**sheet),
    )


def test_fit_finds_tension_and_modulus():
    bubble = known_bubble(tension_prior=3.0)
    law = bf.Law("constant", symmetry="isotropic", nu12=0.3, bounds={"E1": [50, 2000]})
    fit = bf.fit([bubble], law, fabric=bf.Fabric("film", THICKNESS), starts=2, jobs=1)
    found = fit.best.point
    assert fit.law.E1(0.0) == pytest.approx(200.0, rel=0.02)
    tension = found.unknowns[fit.problem.unknowns.size :]
    assert tension == pytest.approx([2.0, 2.0], rel=0.1)
    (test,) = fit.result["tests"].values()
    reported = [verdict.value for verdict in fit.verdicts]
    assert test["sheet"]["tension_N_per_mm"] == reported == pytest.approx(tension, rel=0.02)


def test_tension_beside_slack_is_refused():
    bubble = known_bubble(tension_prior=1.0, slack=True)
    with pytest.raises(InputError, match="opposite of slack"):
        bf.fit([bubble], bf.Law("constant"), fabric=bf.Fabric("film", THICKNESS), starts=1)
