"""experiments/tube/__init__.py: [[tube]] of a project, its fits, plans and mistakes."""

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.tube import LOADS, TubeObjective
from bubblefit.materials.card import MaterialCard
from bubblefit.project.project import read_project
from bubblefit.runs.fit import fit
from bubblefit.runs.plan import plan
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..support.refusals import raised, refused
from .tube.cases import LINEAR, LOADED, RADIUS, strains_of_tube


def project(tmp_path, noise=5e-5):
    own = strains_of_tube(LOADED) + noise * np.random.default_rng(2).standard_normal(
        (len(LOADED), 3)
    )
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


def test_numbers_beyond_the_heading_of_a_tube_are_refused_and_a_comma_at_the_end_is_not(tmp_path):
    path = project(tmp_path)
    file = tmp_path / "tube.csv"
    expected = read_project(path).tests["tube"].strain
    heading, *rows = file.read_text().splitlines()
    file.write_text("\n".join([heading, *(f"{row}," for row in rows)]) + "\n")
    assert np.array_equal(read_project(path).tests["tube"].strain, expected, equal_nan=True)
    file.write_text("\n".join([heading, *(f"{row},99" for row in rows)]) + "\n")
    assert "more numbers than the heading" in refused(read_project, path).problem
