"""The model of the inflated cylinder, and the thickness as a parameter."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import (
    Collar,
    CylinderModel,
    Gas,
    RigidSupports,
    inflated_cylinder,
    usual_collar,
)
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh, enclosed_volume, volume_and_gradient
from bubblefit.meshes.strip_models import PatchModel, straight_strip
from bubblefit.meshes.tube import cylinder_mesh
from bubblefit.solvers.calculix.deck import pressure_forces

from ..complaints import complaint

RADIUS, LENGTH = 75.0, 400.0
BOX = Mesh(
    np.array([(x, y, z) for x in (0, 2) for y in (0, 3) for z in (0, 5)], float),
    np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]),
    {},
)


def moved(points: np.ndarray, size: float, seed: int = 3) -> np.ndarray:
    return points + size * np.random.default_rng(seed).standard_normal(points.shape)


# Volume
def test_volume_of_a_box_wherever_it_lies():
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    assert enclosed_volume(BOX.points, BOX.quads) == pytest.approx(30.0, rel=1e-14)
    assert enclosed_volume(7 + BOX.points @ turn.T, BOX.quads) == pytest.approx(30.0, rel=1e-12)
    assert enclosed_volume(BOX.points, BOX.quads[:, ::-1]) == pytest.approx(-30.0, rel=1e-14)


def test_volume_of_a_bilinear_patch_is_exact():
    # A unit cube whose lid is z = 1 + x y / 2: one eighth more.
    cube = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    cube[7, 2] = 1.5
    assert enclosed_volume(cube, BOX.quads) == pytest.approx(1.125, rel=1e-14)


def test_volume_of_a_sphere_converges_with_second_order():
    def gap(n: int) -> float:
        # A hemisphere is a disk blown up, its rim left open in the plane z = 0.
        disk = disk_mesh(1.0, 8 * n * n)
        r = np.linalg.norm(disk.points, axis=1)
        lift = np.sin(r * np.pi / 2) / np.maximum(r, 1e-30)
        dome = disk.points * lift[:, None] + np.cos(r * np.pi / 2)[:, None] * [0, 0, 1]
        dome[disk.node_sets["rim"], 2] = 0.0
        half = enclosed_volume(dome, disk.quads)
        return 1 - half / (2 * np.pi / 3)

    found = np.array([gap(n) for n in (4, 8, 16)])
    np.testing.assert_allclose(-np.diff(np.log2(found)), 2.0, atol=0.1)
    assert found[-1] < 2e-3


@pytest.mark.parametrize(("size", "seam"), [(60.0, 0.0), (60.0, 40.0), (15.0, 40.0)])
def test_volume_of_a_cylinder_is_exact_however_coarse(size, seam):
    for symmetry, copies in (("quarter", 4), ("full", 1)):
        tube = cylinder_mesh(LENGTH, 2 * RADIUS, size, seam, symmetry)
        found = copies * enclosed_volume(tube.points, tube.quads)
        assert found == pytest.approx(np.pi * RADIUS**2 * LENGTH, rel=1e-12)


def test_the_gradient_is_the_derivative_on_a_closed_surface():
    mesh = cylinder_mesh(LENGTH, 2 * RADIUS, 60.0, 40.0, "full")
    points = moved(mesh.points, 3.0)  # quads warped, too
    gradient = volume_and_gradient(points, mesh.quads)[1]
    for seed in range(5):
        way = np.random.default_rng(seed).standard_normal(points.shape)
        ahead, behind = (enclosed_volume(points + s * way, mesh.quads) for s in (1e-3, -1e-3))
        # Cubic in the way, so that central differences are off by 1e-6 of the cubic term.
        assert (gradient * way).sum() == pytest.approx((ahead - behind) / 2e-3, rel=1e-7)
    # A translation changes nothing; homogeneous of degree three.
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
    tube = mesh.points[mesh.node_sets["mid_span"]][:, :2]
    order = tube[np.argsort(np.arctan2(tube[:, 0], -tube[:, 1]))]
    (x, y), (x1, y1) = order[:-1].T, order[1:].T
    section = 0.5 * np.abs(np.sum(x * y1 - y * x1))
    assert total[2] == pytest.approx(section, rel=1e-12)
    assert total[2] == pytest.approx(np.pi * RADIUS**2 / 2, rel=1e-12)
    assert total[0] == pytest.approx(np.ptp(tube[:, 1]) * LENGTH / 2, rel=1e-12)
    assert total[1] == pytest.approx(0.0, abs=1e-9 * total[0])


# Gas
def test_the_gas_keeps_its_mass():
    gas, full = Gas(), 5.3e7
    assert gas.mass(0.0, 1e9) == pytest.approx(1.2041)  # a cubic metre around us
    closed = gas.closed_in(0.14, full)
    for volume in (0.9 * full, full, 1.2 * full):
        gauge = closed.pressure(volume)
        assert (gauge + gas.ambient) * volume == pytest.approx(0.241 * full, rel=1e-14)
        assert gas.mass(gauge, volume) == pytest.approx(gas.mass(0.14, full), rel=1e-14)
        step = 1e-5 * volume
        ahead, behind = (closed.pressure(volume + s) for s in (step, -step))
        assert -closed.stiffness(volume) == pytest.approx((ahead - behind) / (2 * step), rel=1e-8)
    # Thesis Fig. 6.11: 140.0 to 141.1 kPa, so the volume fell to 0.9955.
    assert closed.pressure(0.99546 * full) == pytest.approx(0.1411, abs=2e-5)


# Model
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
    volume = model.copies * enclosed_volume(model.mesh.points, model.mesh.quads)
    assert len(model.mesh.node_sets["mid_span"]) == {4: 21, 1: 40}[model.copies]
    # Forty corners around, those at the seam closer together, and yet the circle's area.
    assert volume == pytest.approx(np.pi * 75.0**2 * 3000, rel=1e-12)
    assert model.diameter == pytest.approx(150.0, rel=1e-12)
    moved = model.mesh.points * [1.1, 1.1, 1.0] + [0.0, 40.0, 0.0]
    assert model.diameter_at(moved) == pytest.approx(165.0, rel=1e-12)
    extra = np.setdiff1d(model.held_on_inflation, model.fixed)
    np.testing.assert_array_equal(extra, 3 * model.mesh.node_sets["support_bottom"] + 1)


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_what_is_held_stops_every_rigid_motion_and_no_other(symmetry):
    model = inflated_cylinder(150.0, 0.14, 0.81, 60.0, symmetry=symmetry)
    p = model.mesh.points
    motions = [np.eye(3)[k] + np.zeros_like(p) for k in range(3)]
    motions += [np.cross(np.eye(3)[k], p) for k in range(3)]
    rigid = np.stack([m.ravel() for m in motions], axis=1)
    rigid /= np.linalg.norm(rigid, axis=0)
    # Once inflated the supports hold it in height, and only they.
    assert np.linalg.matrix_rank(rigid[model.held_on_inflation], tol=1e-6) == 6
    free = rigid[model.fixed]
    assert np.linalg.matrix_rank(free, tol=1e-6) == 5
    assert np.abs(free[:, 1]).max() == 0


def test_collars_of_the_thesis():
    assert usual_collar(150.0) == usual_collar(200.0) == Collar(240.0, 145.0)
    assert usual_collar(250.0) == Collar(295.0, 147.0)
    assert inflated_cylinder(250.0, 0.085, 0.81, 60.0).collar == Collar(295.0, 147.0)
    assert "give inner_diameter" in complaint(usual_collar, 300.0)


def test_increments_may_be_finer_than_what_is_reported():
    base = inflated_cylinder(150.0, 0.14, 0.81, 60.0)
    model = replace(base, deflections=[10.0, 40.0], increments=[5.0, 10.0, 20.0, 40.0])
    np.testing.assert_array_equal(model.reported, [1, 3])
    assert model.increments == (5.0, 10.0, 20.0, 40.0)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"pressure": 0.0}, "pressure"), ({"pressure": float("nan")}, "pressure"),
        ({"thickness": -0.8}, "thickness"), ({"size": 100.0}, "size"),
        ({"diameter": 260.0}, "collar"),
        ({"collar": Collar(140.0, 145.0)}, "collar.inner_diameter"),
        ({"collar": Collar(240.0, 1950.0)}, "collar.length"),
        ({"supports": RigidSupports(3200.0)}, "supports.span"),
        ({"supports": RigidSupports(2950.0)}, "supports.span"),
        ({"deflections": [20.0, 10.0]}, "deflections"), ({"deflections": []}, "deflections"),
        ({"deflections": [float("inf")]}, "deflections"),
    ],
)  # fmt: skip
def test_nonsense_is_refused_by_name(change, field):
    values = {"diameter": 150.0, "pressure": 0.14, "thickness": 0.81, "size": 60.0} | change
    with pytest.raises(InputError) as caught:
        inflated_cylinder(**values)
    assert caught.value.field == field
    assert "\n" not in str(caught.value)


def test_a_model_that_does_not_fit_together_is_refused():
    base = inflated_cylinder(150.0, 0.14, 0.81, 60.0)
    assert isinstance(base, CylinderModel)
    for change, field in (
        ({"thickness": np.full(3, 0.8)}, "thickness"), ({"inflation": [0.1, 0.1]}, "inflation"),
        ({"increments": [1.0, 3.0]}, "increments"), ({"mesh": BOX}, "mesh"),
        ({"supports": RigidSupports(1800.0)}, "supports.span"),
    ):  # fmt: skip
        with pytest.raises(InputError) as caught:
            replace(base, **change)
        assert caught.value.field == field


@pytest.mark.parametrize(
    "make",
    [
        lambda: Gas(ambient=0.0), lambda: Gas(density=float("nan")),
        lambda: RigidSupports(span=-1.0), lambda: Collar(0.0, 145.0), lambda: Collar(240.0, 15.0),
    ],
)  # fmt: skip
def test_gas_and_bodies_are_checked(make):
    with pytest.raises(InputError) as caught:
        make()
    assert "." in caught.value.field


MODELS = (
    BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.8, [0.05, 0.1]),
    straight_strip("warp", 20.0, 22.0, 0.8, increments=3),
    PatchModel(np.ones((2, 2)), 0.8),
)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: type(model).__name__)
def test_a_thickness_is_added(model):
    assert "thickness" in model.parameters
    thicker = model.with_parameters({"thickness": 0.05})
    assert thicker.thickness == pytest.approx(0.85) and type(thicker) is type(model)
    assert model.with_parameters({"thickness": 0.0}) is model
    assert "thickness: expected > 0" in complaint(model.with_parameters, {"thickness": -0.8})
    assert "parameters: ['width'] not among" in complaint(model.with_parameters, {"width": 1.0})
