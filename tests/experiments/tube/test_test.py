"""experiments/tube/test.py: tubes in tension and torsion, their fits, plans and mistakes."""

import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.tube.prepared import TubeObjective
from bubblefit.experiments.tube.test import LOADS
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import TubeModel
from bubblefit.project.project import read_project
from bubblefit.runs.fit import fit
from bubblefit.runs.plan import plan
from bubblefit.runs.setup import prepare_fit
from bubblefit.runs.verification.thesis_bubble import table_4_2_law
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...support.refusals import raised, refused

RADIUS, THICKNESS = 100.0, 0.8
LINEAR = HypoelasticLaw.linear(400.0, 300.0, 20.0, 0.24)
PULLED = [(0.02, force, 0.0) for force in np.linspace(200, 2000, 5)]
TWISTED = [(0.02, 0.0, torque) for torque in np.linspace(5e3, 6e4, 7)]
LOADED = [*((p, 0.0, 0.0) for p in np.linspace(0.004, 0.02, 5)), *PULLED, *TWISTED]


def strains(loads, law=LINEAR):
    model = TubeModel(loads, RADIUS, THICKNESS)
    return model.strains(MembraneSolver().run(model, law).displacement)


def test_small_loads_of_a_thin_tube_in_closed_form():
    """Axial p R/2 + F/(2 pi R), hoop p R, shear T/(2 pi R^2), all over moduli times thickness."""
    pressure, force, torque = 1e-6, 0.01, 1.0
    (found,) = strains([(pressure, force, torque)])
    axial = 0.5 * pressure * RADIUS + force / (2 * np.pi * RADIUS)
    hoop, nu = pressure * RADIUS, 0.24
    wanted = [
        (axial / 400 - nu * hoop / 400) / THICKNESS,
        (hoop / 300 - nu * axial / 400) / THICKNESS,
        torque / (2 * np.pi * RADIUS**2 * THICKNESS * 20),
    ]
    assert found == pytest.approx(wanted, rel=1e-4)


def test_equilibrium_of_a_tube_is_a_stationary_energy():
    """Pressure, pull and torque are derivatives of an elastic energy by volume, length, twist."""
    model = TubeModel([(0.02, 500.0, 4e4)], RADIUS, THICKNESS)
    solver = MembraneSolver()
    history = solver.run(model, table_4_2_law())
    (axial, hoop, twist), stress = model.strains(history.displacement)[0], solver.stress[0, 0]
    a, b, s = 1 + axial, 1 + hoop, twist * (1 + hoop)
    # Cauchy stress of the wall in space: the corotated frame turned to the tube's.
    gradient = np.array([[a, 0.0], [s, b]])
    left, _, right = np.linalg.svd(gradient)
    turn = left @ right
    tensor = turn @ np.array([[stress[0], stress[2]], [stress[2], stress[1]]]) @ turn.T
    radius = RADIUS * b
    around = tensor * THICKNESS
    assert around[1, 1] == pytest.approx(0.02 * radius, rel=1e-8)
    pull = 0.02 * np.pi * radius**2 + 500.0
    assert 2 * np.pi * radius * around[0, 0] == pytest.approx(pull, rel=1e-8)
    assert 2 * np.pi * radius**2 * around[0, 1] == pytest.approx(4e4, rel=1e-8)


@pytest.mark.parametrize("law", [LINEAR, table_4_2_law()])
def test_derivatives_of_a_tube_against_differences(law):
    model = TubeModel(LOADED, RADIUS, THICKNESS)
    solver = MembraneSolver()
    names = [*(f"beta_{i}" for i in law.form.free), "nu12"]
    history, slope = solver.run_with_sensitivity(model, law, names)
    found = model.strain_slopes(history.displacement, slope)
    for k, i in enumerate(law.form.free):
        step = 1e-3 * max(abs(law.beta[i]), 1.0)
        ends = []
        for sign in (1, -1):
            beta = law.beta.copy()
            beta[i] += sign * step
            ends.append(strains(LOADED, law.with_beta(beta)))
        wanted = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(found[:, :, k] - wanted).max() < 1e-4 * np.abs(wanted).max(), i


def project(tmp_path, noise=5e-5):
    own = strains(LOADED) + noise * np.random.default_rng(2).standard_normal((len(LOADED), 3))
    twist = np.degrees(own[:, 2] / RADIUS) * 1e3
    loads = np.array(LOADED) / list(LOADS.values())
    rows = np.column_stack([loads, 100 * own[:, :2], twist])
    head = "pressure_kPa,force_N,torque_Nm,axial_percent,hoop_percent,twist_deg_per_m"
    np.savetxt(tmp_path / "tube.csv", rows, delimiter=",", header=head, comments="", fmt="%.8g")
    path = tmp_path / "project.toml"
    path.write_text(
        '[fabric]\nname = "t"\nthickness = 0.8\n[law]\nform = "constant"\n[law.bounds]\n'
        "E1 = [0.05, 2.0]\nE2 = [0.05, 2.0]\nG12 = [0.001, 0.5]\n[fit]\njobs = 1\n"
        '[[tube]]\ndiameter = 200.0\nfile = "tube.csv"\nnoise = 0.005\n'
    )
    return path


def test_tension_and_torsion_identify_the_moduli(tmp_path):
    found = fit(read_project(project(tmp_path)), starts=2)
    law = found.card.law
    for name, true in (("E1", 400.0), ("E2", 300.0), ("G12", 20.0)):
        low, high = found.card.certainty.band(law, name, [0.0])
        assert low[0] < true < high[0] and high[0] / low[0] < 1.05, name
    folder = found.report(tmp_path / "out").parent
    assert len((folder / "strains.csv").read_text().splitlines()) == 1 + 3 * len(LOADED)


def test_function_as_objective_of_a_tube_is_refused(tmp_path):
    given = read_project(project(tmp_path)).with_objective("tube", np.subtract)
    setup = prepare_fit(given, given.chosen(None, fitted=True))
    raised(InputError, "tube tests have an objective of their own", setup.problem)


def test_plan_proposes_torsion_for_g12(tmp_path):
    made = plan(read_project(project(tmp_path)), MaterialCard(LINEAR, 0.8, "card"))
    twisted = next(c for c in made.candidates if c.kind == "tube")
    assert twisted.summary["G12"] < made.present.summary["G12"]


def test_zero_of_a_strain_is_free(tmp_path):
    (test,) = read_project(project(tmp_path)).tests.values()
    objective = TubeObjective(test, 1.0)
    (model,) = test.models().values()
    history = MembraneSolver().run(model, LINEAR)
    moved = type(test)(**{**vars(test), "strain": test.strain + np.array([1e-3, -2e-3, 5e-3])})
    assert TubeObjective(moved, 1.0).residual(history) == pytest.approx(objective.residual(history))
    assert objective.rms(history) == pytest.approx([0.005] * 3, rel=0.5)
    assert objective.sizes == (len(LOADED),) * 3


@pytest.mark.parametrize(
    ("before", "after", "field"),
    [("torque_Nm", "moment", "torque_Nm"), ("axial_percent", "strange", "strange")],
)
def test_missing_columns_of_a_tube_are_named(tmp_path, before, after, field):
    path = project(tmp_path)
    file = tmp_path / "tube.csv"
    file.write_text(file.read_text().replace(before, after))
    raised = refused(read_project, path)
    assert raised.path == file and raised.field == field


def test_tube_that_cannot_carry_its_loads_is_a_failure():
    assert "load 1" in raised(SolverFailure, "", strains, [(5.0, 0.0, 0.0)]).reason
