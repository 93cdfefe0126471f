"""solvers/base.py: what a solver can carry."""

from dataclasses import replace

import bubblefit as bf
import meshio
import numpy as np
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.nuisance import Nuisance
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import PatchModel, bias_strip, straight_strip
from bubblefit.runs.verification.bubbles import table_4_2_law
from bubblefit.runs.verification.thin_walls import (
    ISOTROPIC,
    RADIUS,
    THICKNESS,
    capped_strain,
    sphere_model,
    tube_model,
)
from bubblefit.solvers.base import History, check_carries
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.run_cache import from_bytes, to_bytes

from ..materials.cases import MEMORY_LAW
from ..support.paths import EXAMPLES
from ..support.refusals import complaint, raised

LAW = table_4_2_law()
PRESSURES = (0.022, 0.1, 0.3)
MODELS = {
    "bubble": BubbleModel(
        replace(m := disk_mesh(100.0, 48, "quarter"), points=m.points + np.array([0, 0, 0.5])),
        0.81, PRESSURES, default_increments(PRESSURES), slack=(0.002, 0.001),
    ),
    "fill": replace(straight_strip("fill", 20.0, 23.3, 0.81, increments=20), unloaded=True),
    "bias": bias_strip(20.0, 26.0, 0.81, increments=10, across=4, along=9),
    "tube": tube_model(16, 2, 40.0, [0.005, 0.01], caps=False),
}  # fmt: skip


def ran(model, law, solver=None):
    solver = solver or MembraneSolver(1e-9)
    return replace(solver.run(model, law), model=model, law=law), solver._prepared[1]


@pytest.mark.parametrize("name", MODELS)
def test_strain_and_stress_are_those_of_solver(name):
    law = ISOTROPIC if name == "tube" else LAW
    history, membrane = ran(MODELS[name], law)
    strain, stress = history.strain("points"), history.stress("points")
    np.testing.assert_allclose(strain[-1], membrane.strain_old, atol=1e-13)
    np.testing.assert_allclose(stress[-1], membrane.stress_old, atol=1e-9)
    whole = history if history.path is None else replace(history, displacement=history.path)
    flat = whole.strain("points").reshape(-1, 3)
    np.testing.assert_allclose(flat.max(axis=0).clip(min=0), history.strain_max, atol=1e-13)
    np.testing.assert_allclose(flat.min(axis=0).clip(max=0), history.strain_min, atol=1e-13)
    frames, quads = len(history.load), len(history.mesh.quads)
    assert history.strain().shape == history.stress().shape == (frames, quads, 3)
    assert strain.shape == stress.shape == (frames, quads, 4, 3)
    # Between the Gauss points, to what their mean differs from the middle by.
    assert np.abs(history.strain() - strain.mean(axis=2)).max() < 0.05 * np.abs(strain).max()


def test_strain_and_stress_of_bar_are_closed_form():
    model = straight_strip("warp", 20.0, 22.4, 0.81, increments=3)
    history, _ = ran(model, LAW)
    strain = np.log1p(np.array(model.elongations) / 20.0)
    across = -LAW.nu12 * (LAW.E2(0.0) / LAW.E1(0.0))  # the fill is pressed: E2 is that at rest
    np.testing.assert_allclose(history.strain()[:, :, 0], strain[:, None] + np.zeros(40), atol=1e-9)
    x, weight = np.polynomial.legendre.leggauss(8)
    pull = [0.5 * e * float(weight @ LAW.E1(0.5 * e * (1 + x))) for e in strain]
    stress = history.stress()
    np.testing.assert_allclose(stress[..., 0], np.array(pull)[:, None] + np.zeros(40), rtol=1e-9)
    assert np.abs(stress[..., 1:]).max() < 1e-8 and across < 0
    area = 25.0 * 0.81 * np.exp(history.strain()[:, 0, 1])
    np.testing.assert_allclose(history.load, stress[:, 0, 0] * area, rtol=1e-9)


def test_stress_of_patch_carries_its_loads():
    loads = np.array([[5.0, 2.0], [12.0, 4.0]])
    history, _ = ran(PatchModel(loads, 0.8), LAW)
    stretch = np.exp(history.strain()[:, 0, 1::-1])  # of the width that each load crosses
    np.testing.assert_allclose(history.stress()[:, 0, :2] * 0.8 * stretch, loads, rtol=2e-3)


def test_strain_of_sphere_and_capped_tube_is_closed_form():
    pressures = np.linspace(0.01, 0.03, 3)
    history, _ = ran(sphere_model(6, list(pressures)), ISOTROPIC)
    radius = np.linalg.norm(history.mesh.points + history.displacement[-1], axis=1).mean()
    expected = 0.03 * radius / (2 * THICKNESS), np.log(radius / RADIUS)
    assert history.stress()[-1, :, :2].mean() == pytest.approx(expected[0], rel=0.02)
    assert history.strain()[-1, :, :2].mean() == pytest.approx(expected[1], rel=0.02)
    history, _ = ran(tube_model(32, 8, 200.0, list(pressures)), ISOTROPIC)
    near = history.mesh.points[history.mesh.quads][..., 2].min(axis=1) < 1e-6
    axial, hoop, _ = history.strain()[-1, near].mean(axis=0)
    wanted = capped_strain(ISOTROPIC, 0.03, RADIUS, THICKNESS)
    assert (axial, hoop) == pytest.approx(tuple(wanted), rel=0.02)


def test_wrinkled_beam_carries_no_compression():
    way = np.arange(10.0, 61.0, 10.0)
    model = inflated_cylinder(150.0, 0.09, 0.81, 60.0, deflections=way)
    history, membrane = ran(model, LAW, MembraneSolver(1e-9, wall="tension field"))
    assert history.relaxed and history.wrinkled[-1] > 0
    again = from_bytes(to_bytes(history, "key", 1.0), "key")
    assert again.relaxed and again.model is None
    stress = history.stress("points")
    mean, half = stress[..., :2].mean(axis=-1), 0.5 * (stress[..., 0] - stress[..., 1])
    least = mean - np.hypot(half, stress[..., 2])
    most = np.abs(stress).max()
    assert least.min() > -1e-9 * most
    # The first frame is reached in one step: the increments of the inflation are not kept.
    np.testing.assert_allclose(stress[0], membrane.stress_old, atol=3e-3 * most)
    assert replace(history, relaxed=False).stress("points")[..., :2].min() < -0.05 * most


def test_mesh_is_written_and_read_back(tmp_path):
    project = bf.read_project(EXAMPLES / "batch" / "project.toml")
    law = HypoelasticLaw.linear(800.0, 400.0, 80.0)
    histories = bf.simulate(project.tests["bubble"], bf.MaterialCard(law, 0.81))
    assert list(histories) == ["bubble"] and isinstance(histories, dict)
    history = histories["bubble"]
    for frame in (0, -1):
        history.to_meshio(frame).write(tmp_path / "sheet.vtu")
        grid = meshio.read(tmp_path / "sheet.vtu")
        u = history.displacement[frame]
        np.testing.assert_allclose(grid.points - grid.point_data["displacement"],
                                   history.mesh.points, atol=1e-12)  # fmt: skip
        np.testing.assert_array_equal(grid.point_data["displacement"], u)
        np.testing.assert_array_equal(grid.cells_dict["quad"], history.mesh.quads)
        (strain,), (stress,) = grid.cell_data.values()
        np.testing.assert_array_equal(strain, history.strain()[frame])
        np.testing.assert_array_equal(stress, history.stress()[frame])


def test_history_names_its_strains_in_percent():
    ends = np.array([-0.004, 0.0, -0.02]), np.array([0.12, 0.035, 0.0])
    words = repr(History(np.ones(1), np.zeros((1, 4, 3)), *ends))
    assert "-0.4 to 12 %, " in words and "0 to 3.5 %" in words and "-2 to 0 %" in words


def test_history_without_model_or_law_refuses_strain_and_stress():
    bare = History(np.ones(1), np.zeros((1, 4, 3)), np.zeros(3), np.zeros(3))
    for call in (bare.strain, bare.stress, bare.to_meshio):
        raised(InputError, "model: is not", call)
    known = replace(bare, model=PatchModel([[1.0, 1.0]], 1.0))
    raised(InputError, "law: is not", known.stress)
    raised(InputError, "at: expected 'elements' or 'points', got 'nodes'", known.strain, "nodes")


def test_fitted_thickness_replaces_that_of_model():
    one = Nuisance("thickness", 0.5, 1.0, "mm", "thickness", start=0.81, shared=True)
    comparison = Comparison("one", MODELS["fill"], MembraneSolver(), None, (one,))
    assert comparison.model_at({"thickness": 0.9}).thickness == pytest.approx(0.9)


THICKNESS_MODELS = (
    BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.8, [0.05, 0.1]),
    straight_strip("warp", 20.0, 22.0, 0.8, increments=3),
    PatchModel(np.ones((2, 2)), 0.8),
)


@pytest.mark.parametrize("model", THICKNESS_MODELS, ids=lambda model: type(model).__name__)
def test_change_of_thickness_is_added_to_a_model(model):
    thicker = model.with_parameters({"thickness": 0.05})
    assert thicker.thickness == pytest.approx(0.85) and type(thicker) is type(model)
    assert model.with_parameters({"thickness": 0.0}) is model
    assert "thickness" in complaint(model.with_parameters, {"thickness": -0.8})
    assert "width" in complaint(model.with_parameters, {"width": 1.0})


def test_solvers_without_memory_refuse_it():
    assert "memory" in complaint(check_carries, CalculixSolver(), MEMORY_LAW)
    check_carries(MembraneSolver(), MEMORY_LAW)
    with pytest.raises(SolverFailure, match="memory"):
        MembraneSolver().run(PatchModel(np.array([[1.0, 1.0]]), 0.8), MEMORY_LAW)


def test_frame_is_a_table_of_nodes_or_elements():
    card = bf.MaterialCard(HypoelasticLaw.linear(400.0, 250.0, 12.0), 0.8)
    bubble = bf.Bubble(radius=100.0, pressures=[0.01, 0.05], elements=48)
    history = bf.simulate(bubble, card)["bubble"]
    frame = history.frame(-1)
    assert frame.load == 0.05
    nodes = frame.to_dataframe()
    assert nodes[["x", "y", "z"]].to_numpy() == pytest.approx(history.mesh.points)
    assert nodes[["dx", "dy", "dz"]].to_numpy() == pytest.approx(history.displacement[1])
    elements = frame.to_dataframe("elements")
    assert elements[["eps1", "eps2", "gamma12"]].to_numpy() == pytest.approx(history.strain()[1])
    assert elements[["sigma1", "sigma2", "tau12"]].to_numpy() == pytest.approx(history.stress()[1])
    middles = nodes.to_numpy()[history.mesh.quads].mean(axis=1)
    assert elements[list(nodes)].to_numpy() == pytest.approx(middles)
    lines = repr(history).splitlines()
    assert lines[0] == "History: 2 frames, load 0.01 to 0.05" and len(lines) == 3
    raised(InputError, r"^at: expected one of nodes, elements", frame.to_dataframe, "points")
    with pytest.raises(IndexError):
        history.frame(2)
