"""The model of the inflated cylinder, and the thickness as a parameter."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import (
    Collar,
    Gas,
    RigidSupports,
    inflated_cylinder,
    usual_collar,
)
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.strip_models import PatchModel, straight_strip
from bubblefit.meshes.tube import cylinder_mesh
from bubblefit.meshes.volume import enclosed_volume, volume_and_gradient
from bubblefit.solvers.calculix.deck import pressure_forces

from ..support.refusals import complaint, refused

RADIUS, LENGTH = 75.0, 400.0
BOX = Mesh(
    np.array([(x, y, z) for x in (0, 2) for y in (0, 3) for z in (0, 5)], float),
    np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]),
    {},
)


def moved(points, size):
    return points + size * np.random.default_rng(3).standard_normal(points.shape)


def test_volume_of_a_box_wherever_it_lies():
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    assert enclosed_volume(BOX.points, BOX.quads) == pytest.approx(30.0, rel=1e-14)
    assert enclosed_volume(7 + BOX.points @ turn.T, BOX.quads) == pytest.approx(30.0, rel=1e-12)
    assert enclosed_volume(BOX.points, BOX.quads[:, ::-1]) == pytest.approx(-30.0, rel=1e-14)
    # A unit cube whose lid is z = 1 + x y / 2: one eighth more.
    cube = np.sign(BOX.points)
    cube[7, 2] = 1.5
    assert enclosed_volume(cube, BOX.quads) == pytest.approx(1.125, rel=1e-14)


def test_the_gradient_is_the_derivative_on_a_closed_surface():
    mesh = cylinder_mesh(LENGTH, 2 * RADIUS, 60.0, 40.0, "full")
    points = moved(mesh.points, 3.0)  # quads warped, too
    gradient = volume_and_gradient(points, mesh.quads)[1]
    for seed in range(5):
        way = np.random.default_rng(seed).standard_normal(points.shape)
        ahead, behind = (enclosed_volume(points + s * way, mesh.quads) for s in (1e-3, -1e-3))
        # Cubic in the way, so that central differences are off by 1e-6 of the cubic term.
        assert (gradient * way).sum() == pytest.approx((ahead - behind) / 2e-3, rel=1e-7)
    np.testing.assert_allclose(gradient.sum(axis=0), 0, atol=1e-9 * np.abs(gradient).sum())
    volume = enclosed_volume(points, mesh.quads)
    assert (gradient * points).sum() == pytest.approx(3 * volume, rel=1e-12)
    forces = pressure_forces(points, mesh.quads, 1.0)
    np.testing.assert_allclose(gradient, forces, atol=1e-9 * np.abs(gradient).max())


def test_the_gradient_of_a_quarter_holds_for_moves_in_its_planes():
    mesh = cylinder_mesh(LENGTH, 2 * RADIUS, 60.0, 40.0, "quarter")
    bounds = ((mesh.node_sets["symmetry_x"], 0), (mesh.node_sets["symmetry_z"], 2))
    points, way = moved(mesh.points, 3.0), moved(np.zeros_like(mesh.points), 1.0)
    for nodes, axis in bounds:
        points[nodes, axis] = way[nodes, axis] = 0.0
    ahead, behind = (enclosed_volume(points + s * way, mesh.quads) for s in (1e-3, -1e-3))
    found = (volume_and_gradient(points, mesh.quads)[1] * way).sum()
    assert found == pytest.approx((ahead - behind) / 2e-3, rel=1e-7)
    # The pressure on the cut through the middle: what the planes must give back.
    total = volume_and_gradient(mesh.points, mesh.quads)[1].sum(axis=0)
    high = np.ptp(mesh.points[mesh.node_sets["mid_span"], 1])
    assert total[2] == pytest.approx(np.pi * RADIUS**2 / 2, rel=1e-12)
    assert total[0] == pytest.approx(high * LENGTH / 2, rel=1e-12)
    assert total[1] == pytest.approx(0.0, abs=1e-9 * total[0])


def test_the_gas_keeps_its_mass():
    gas, full = Gas(), 5.3e7
    closed = gas.closed_in(0.14, full)
    for volume in (0.9 * full, full, 1.2 * full):
        gauge, step = closed.pressure(volume), 1e-5 * volume
        assert (gauge + gas.ambient) * volume == pytest.approx(0.241 * full, rel=1e-14)
        ahead, behind = (closed.pressure(volume + s) for s in (step, -step))
        assert -closed.stiffness(volume) == pytest.approx((ahead - behind) / (2 * step), rel=1e-8)
    # Thesis Fig. 6.11: 140.0 to 141.1 kPa, so the volume fell to 0.9955.
    assert closed.pressure(0.99546 * full) == pytest.approx(0.1411, abs=2e-5)


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_the_thesis_case(symmetry):
    model = inflated_cylinder(150.0, 0.14, 0.81, 30.0, symmetry=symmetry)
    assert model.copies == (4 if symmetry == "quarter" else 1)
    assert model.pressure == 0.14
    assert model.deflections[-1] == 240.0 and len(model.deflections) == 60
    assert model.increments == model.deflections
    assert model.supports == RigidSupports(2000.0, 100.0)
    seam = np.isin(np.arange(len(model.mesh.quads)), model.mesh.element_sets["seam"])
    np.testing.assert_array_equal(model.thickness, np.where(seam, 3 * 0.81, 0.81))
    assert len(model.mesh.node_sets["mid_span"]) == {4: 21, 1: 40}[model.copies]
    # Forty corners around, those at the seam closer together, and yet the circle's area.
    volume = model.copies * enclosed_volume(model.mesh.points, model.mesh.quads)
    assert volume == pytest.approx(np.pi * 75.0**2 * 3000, rel=1e-12)
    assert model.diameter == pytest.approx(150.0, rel=1e-12)
    wider = model.mesh.points * [1.1, 1.1, 1.0] + [0.0, 40.0, 0.0]
    assert model.diameter_at(wider) == pytest.approx(165.0, rel=1e-12)
    finer = replace(model, deflections=[10.0, 40.0], increments=[5.0, 10.0, 20.0, 40.0])
    np.testing.assert_array_equal(finer.reported, [1, 3])
    assert model.collar == usual_collar(150.0) == usual_collar(200.0) == Collar(240.0, 145.0)
    assert usual_collar(250.0) == Collar(295.0, 147.0)
    assert "inner_diameter" in complaint(usual_collar, 300.0)


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_what_is_held_stops_every_rigid_motion_and_no_other(symmetry):
    model = inflated_cylinder(150.0, 0.14, 0.81, 60.0, symmetry=symmetry)
    p = model.mesh.points
    motions = [np.eye(3)[k] + np.zeros_like(p) for k in range(3)]
    motions += [np.cross(np.eye(3)[k], p) for k in range(3)]
    rigid = np.stack([m.ravel() for m in motions], axis=1)
    rigid /= np.linalg.norm(rigid, axis=0)
    bottom = 3 * model.mesh.node_sets["support_bottom"] + 1
    fixed = model.mesh.unknowns(model.guides)
    assert np.linalg.matrix_rank(rigid[np.union1d(fixed, bottom)], tol=1e-6) == 6
    free = rigid[fixed]
    assert np.linalg.matrix_rank(free, tol=1e-6) == 5
    assert np.abs(free[:, 1]).max() == 0


def cylinder(**change):
    values = {"diameter": 150.0, "pressure": 0.14, "thickness": 0.81, "size": 60.0} | change
    return inflated_cylinder(**values)


def changed(**change):
    return replace(cylinder(), **change)


@pytest.mark.parametrize(
    ("make", "change", "field"),
    [
        (cylinder, {"size": 100.0}, "size"),
        (cylinder, {"diameter": 260.0}, "collar"),
        (cylinder, {"collar": Collar(140.0, 145.0)}, "collar.inner_diameter"),
        (cylinder, {"collar": Collar(240.0, 1950.0)}, "collar.length"),
        (cylinder, {"supports": RigidSupports(3200.0)}, "supports.span"),
        (cylinder, {"supports": RigidSupports(2950.0)}, "supports.span"),
        *((cylinder, {"deflections": d}, "deflections") for d in ([20.0, 10.0], [], [np.inf])),
        (changed, {"inflation": [0.1, 0.1]}, "inflation"),
        (changed, {"increments": [1.0, 3.0]}, "increments"),
        (changed, {"supports": RigidSupports(1800.0)}, "supports.span"),
        (Collar, {"inner_diameter": 240.0, "length": 15.0}, "collar.fillet"),
    ],
)  # fmt: skip
def test_nonsense_is_refused_by_name(make, change, field):
    assert refused(make, **change).field == field


MODELS = (
    BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.8, [0.05, 0.1]),
    straight_strip("warp", 20.0, 22.0, 0.8, increments=3),
    PatchModel(np.ones((2, 2)), 0.8),
)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: type(model).__name__)
def test_a_thickness_is_added(model):
    thicker = model.with_parameters({"thickness": 0.05})
    assert thicker.thickness == pytest.approx(0.85) and type(thicker) is type(model)
    assert model.with_parameters({"thickness": 0.0}) is model
    assert "thickness" in complaint(model.with_parameters, {"thickness": -0.8})
    assert "width" in complaint(model.with_parameters, {"width": 1.0})
