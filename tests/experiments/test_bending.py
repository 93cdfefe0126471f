"""experiments/bending: measured loads of bent cylinders in a fit."""

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.base import Weighting
from bubblefit.experiments.bending import BendingObjective
from bubblefit.materials.law import HypoelasticLaw, law_beside
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..support.commands import in_process
from ..support.refusals import complaint

PROJECT = """
units = {{ modulus = "MPa", pressure = "kPa", length = "mm" }}
[fabric]
thickness = 0.8
[law]
form = "constant"
nu12 = 0.2
strain_range = [0.1, 0.1, 0.1]
bounds = {{ E1 = [50.0, 2000.0], E2 = [199.999, 200.001], G12 = [19.9999, 20.0001] }}
[fit]
starts = 1
mesh_error = "told"
[[bending]]
diameter = 150.0
pressure = 60.0
length = 800.0
span = 600.0
support_diameter = 100.0
element_size = 75.0
{more}
"""
LAW = HypoelasticLaw.linear(300.0, 200.0, 20.0, 0.2)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A project with the loads that a known law gives, of two repetitions."""
    file = tmp_path_factory.mktemp("bending") / "project.toml"
    (file.parent / "loads.csv").write_text("deflection_mm,load_N\n0,0\n2,1\n4,2\n12,3\n")
    more = 'deflections = [2.0, 5.0, 8.0]\nmeasured.files = ["loads.csv"]'
    file.write_text(PROJECT.format(more=more))
    (test,) = bf.read_project(file).tests.values()
    assert test.points[0].tolist() == [2.0, 4.0]  # beyond the last deflection nothing is matched
    history = bf.simulate(test, bf.MaterialCard(LAW, 0.8, "known"))["cylinder"]
    rows = zip([0.0, *test.deflections], history.load, strict=True)
    lines = [f"{way},{load:.10g}" for way, load in rows]
    (file.parent / "loads.csv").write_text("\n".join(["deflection_mm,load_N", *lines]))
    return bf.read_project(file)


@pytest.mark.slow
def test_fit_of_bending_finds_a_known_modulus(project, tmp_path):
    found = bf.fit(project)
    assert found.card.law.modulus("E1", 0.0) == pytest.approx(300.0, rel=1e-3)
    table = found.residuals()
    assert len(table) == 3 and (table["difference"].abs() < 1e-3 * table["measured"]).all()
    found.card.write(card := tmp_path / "card.toml")
    typed = ("simulate", "test", project.path, "--card", card, "--out", tmp_path / "out")
    done = in_process(*typed, cwd=tmp_path)
    assert "RMS error of the load" in done.stdout and (tmp_path / "out" / "bending.png").exists()


CORDS = """[[bending.cord]]
angle = 0.0
stiffness = 1e5
initial_force = 40.0
[[bending.cord]]
angle = 180.0
stiffness = 2e5
bonded = false
"""


@pytest.mark.slow
@pytest.mark.parametrize("wall", ["tension field", "stiff"])
@pytest.mark.parametrize("more", ["mass_per_area = 0.9", 'gas.constant = "pressure"', CORDS])
def test_slopes_of_bending_equal_differences_of_runs(tmp_path, wall, more):
    (tmp_path / "loads.csv").write_text("deflection_mm,load_N\n0,0\n2,1\n4,2\n")
    frames = 'deflections = [2.0, 8.0, 20.0]\nmeasured.files = ["loads.csv"]\n'
    (tmp_path / "project.toml").write_text(PROJECT.format(more=frames + more))
    (model,) = (
        next(iter(bf.read_project(tmp_path / "project.toml").tests.values())).models().values()
    )
    solver, names = MembraneSolver(1e-11, wall=wall), ["beta_3", "beta_11", "nu12", "beta_0"]
    here, slopes = solver.run_with_sensitivity(model, LAW, names)
    for k, (name, step) in enumerate(zip(names[:3], (0.01, 0.01, 1e-5), strict=True)):
        above, below = (solver.run(model, law_beside(LAW, name, by)) for by in (step, -step))
        # The inflated tube bears no load at the collar.
        expected = ((above.load - below.load) / (2 * step))[1:]
        assert here.load_slope[1:, k] == pytest.approx(expected, rel=2e-4, abs=2e-5)
        moved = (above.displacement - below.displacement) / (2 * step)
        assert np.abs(slopes[..., k] - moved).max() < 2e-3 * np.abs(moved).max()
    assert (here.load_slope[1:, 0] > 0).all()
    assert not here.load_slope[:, 3].any() and not slopes[..., 3].any()  # a constant has none


@pytest.mark.parametrize(
    ("more", "field"),
    [
        ("", "bending[0].measured.files"),
        ('measured.files = ["none.csv"]', "none.csv"),
        ('deflections = [0.5]\nmeasured.files = ["loads.csv"]', "bending[0].measured.files"),
        ('model = "beam"\nmeasured.files = ["loads.csv"]', "bending[0].model"),
    ],
)
def test_bending_that_cannot_be_fitted_is_refused(tmp_path, more, field):
    (tmp_path / "loads.csv").write_text("deflection_mm,load_N\n0,0\n2,1\n4,2\n")
    (tmp_path / "project.toml").write_text(PROJECT.format(more=more))
    assert field in complaint(bf.read_project, tmp_path / "project.toml")


def test_loads_that_are_all_zero_are_refused(tmp_path):
    (tmp_path / "loads.csv").write_text("deflection_mm,load_N\n0,0\n2,0\n4,0\n")
    (tmp_path / "project.toml").write_text(PROJECT.format(more='measured.files = ["loads.csv"]'))
    message = complaint(bf.read_project, tmp_path / "project.toml")
    assert "measured.files: expected two or more loads between 0 and the last" in message


def test_noise_that_is_not_stated_is_a_fiftieth_of_the_largest_load(tmp_path):
    rows = "".join(f"{way},{3.0 * way}\n" for way in range(11))
    (tmp_path / "loads.csv").write_text(f"deflection_mm,load_N\n{rows}")
    (tmp_path / "project.toml").write_text(PROJECT.format(more='measured.files = ["loads.csv"]'))
    (test,) = bf.read_project(tmp_path / "project.toml").tests.values()
    objective = BendingObjective(test, Weighting())
    assert (objective.least_noise, objective.noise_is) == (pytest.approx(0.6), "assumed")
    assert objective.correlated_count == pytest.approx(2.0)  # ten loads, of which five count
