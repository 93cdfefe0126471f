"""Rigid cylinders against the membrane: distances, forces, balance, work, gas of constant mass."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import Bending, InflatedModel, RigidCylinder
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.tube import half_tube, tube_warp
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane import bending
from bubblefit.solvers.membrane import closed as closed_model
from bubblefit.solvers.membrane.bubble import Wall
from bubblefit.solvers.membrane.closed import (
    ClosedMembrane,
    brought_to_touch,
    contact_forces,
    flexure_of,
    gaps,
)
from bubblefit.solvers.membrane.newton import Membrane
from bubblefit.solvers.membrane.solver import MembraneSolver

RADIUS, LENGTH, SPAN = 75.0, 600.0, 800.0
POST = RigidCylinder("support", (1.0, 0.0, 0.0), (0.0, 0.0, 0.5 * SPAN), 50.0)
RING = RigidCylinder("collar", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 120.0, True, 145.0, 10.0)
# Stiff, so that the strain measure and the strain path do not matter.
LINEAR = HypoelasticLaw.linear(5000.0, 4000.0, 200.0)


def beam(displacements=(2.0, 6.0, 10.0), penalty: float = 5.0, across: int = 8) -> InflatedModel:
    """A quarter of a short beam, 150 mm, at 100 kPa."""
    mesh = half_tube(across, 24, RADIUS, LENGTH)
    foot = mesh.node_sets["foot"]
    hang = foot[[np.argmin(np.abs(mesh.points[foot, 2] - 0.5 * SPAN))]]
    mesh = Mesh(mesh.points, mesh.quads, {**mesh.node_sets, "hang": hang})
    return InflatedModel(
        mesh, 0.81, tube_warp(mesh, LENGTH), [0.005, 0.02, 0.05, 0.1],
        {"symmetry_x": (0,), "symmetry_z": (2,), "hang": (1,)}, copies=4,
        bending=Bending([POST], RING, displacements, released="hang", penalty=penalty),
    )  # fmt: skip


def bend(model: InflatedModel, law: HypoelasticLaw = LINEAR) -> tuple[History, ClosedMembrane]:
    solver = MembraneSolver(1e-9)
    return solver.run(model, law), solver._prepared[1]


@pytest.fixture(scope="module")
def bent() -> tuple[InflatedModel, History]:
    model = beam()
    return model, bend(model)[0]


@pytest.mark.parametrize("body", [POST, RING])
def test_distance_has_its_gradient_and_hessian(body: RigidCylinder) -> None:
    """Points beside the post, in the ring's straight part and in its rounded mouth."""
    rng = np.random.default_rng(2)
    angle, z = rng.uniform(0.2, 2.9, 60), rng.uniform(-72.0, 72.0, 60)
    r = rng.uniform(105.0, 122.0, 60)
    points = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)
    if not body.ring:
        points[:, 2] += 0.5 * SPAN
    gap, out, hessian = gaps(body, points)
    assert np.linalg.norm(out, axis=1) == pytest.approx(1.0, abs=1e-12)
    step = 1e-4
    for k in range(3):
        up, down = (gaps(body, points + s * step * np.eye(3)[k]) for s in (1, -1))
        smooth = np.abs(np.abs(z) - 62.5) > 1e-3  # curvature jumps where the mouth begins
        assert out[:, k] == pytest.approx((up[0] - down[0]) / (2 * step), abs=1e-6)
        slope = (up[1] - down[1]) / (2 * step)
        assert hessian[smooth, :, k] == pytest.approx(slope[smooth], abs=1e-5)
    assert ((gap < 0).any() and (gap > 0).any()) or not body.ring


def test_ring_and_post_by_hand() -> None:
    x = np.array([[0.0, 121.0, 0.0], [0.0, 119.0, 50.0], [0.0, 121.0, 72.5], [0.0, 130.0, 80.0]])
    # In the mouth: the fillet's circle stands at r = 130, z = 62.5.
    expected = [-1.0, 1.0, np.hypot(9.0, 10.0) - 10.0, 17.5 - 10.0]
    assert gaps(RING, x)[0] == pytest.approx(expected, abs=1e-6)
    assert gaps(POST, np.array([[7.0, -30.0, 440.0]]))[0] == pytest.approx([0.0], abs=1e-12)
    force, stiffness, touched = contact_forces(RING, x, np.full(4, 3.0))
    assert touched.tolist() == [0]
    assert force[0] == pytest.approx([0.0, -3.0, 0.0])
    assert stiffness[0, 1, 1] == pytest.approx(3.0)


@pytest.mark.parametrize("body", [POST, RING])
def test_forces_are_on_all_nodes_that_are_inside(body: RigidCylinder) -> None:
    rng = np.random.default_rng(3)
    x = np.asarray(body.centre) + rng.uniform(-160, 160, (4000, 3))
    gap, out, _ = gaps(body, x)
    force, _, touched = contact_forces(body, x, np.full(len(x), 2.0))
    np.testing.assert_array_equal(touched, np.flatnonzero(gap < 0))
    assert 100 < len(touched) < len(x)
    assert force == pytest.approx(np.where(gap[:, None] < 0, -2.0 * gap[:, None] * out, 0.0))


def test_bodies_are_brought_to_touch() -> None:
    points = half_tube(16, 24, RADIUS, LENGTH).points
    way = np.array([0.0, -1.0, 0.0])
    post = brought_to_touch(POST, points, -way, 0.02)
    ring = brought_to_touch(RING, points, way, 0.0)
    assert post.centre == pytest.approx((0.0, -RADIUS - 50.0 + 0.02, 400.0), abs=1e-6)
    assert ring.centre == pytest.approx((0.0, RADIUS - 120.0, 0.0), abs=1e-6)
    with pytest.raises(InputError, match="no node of the mesh lies where 'support' could touch"):
        brought_to_touch(replace(POST, centre=(0.0, 0.0, 900.0)), points, -way, 0.02)


def test_collar_and_supports_balance(bent: tuple[InflatedModel, History]) -> None:
    _, history = bent
    assert (np.diff(history.load) > 0).all()
    assert history.load[0] == 0.0
    total = history.reactions["collar"] + history.reactions["support"]
    assert total[1:] == pytest.approx(0.0, abs=1e-4 * history.load[1])
    assert history.load == pytest.approx(-history.reactions["collar"][:, 1])


def test_gas_keeps_its_mass(bent: tuple[InflatedModel, History]) -> None:
    _, history = bent
    amount = (history.cavity_pressure + 0.101) * history.cavity_volume
    assert amount == pytest.approx(np.full(len(amount), amount[0]), rel=1e-12)
    assert history.cavity_pressure[-1] > history.cavity_pressure[0]


def test_penetration_is_reported_and_shrinks_with_the_penalty(
    bent: tuple[InflatedModel, History],
) -> None:
    def depth(history: History) -> float:
        (text,) = [r for r in history.remarks if "penetrate" in r]
        return float(text.split()[3])

    stiff = bend(beam(penalty=50.0))[0]
    assert depth(stiff) < 0.2 * depth(bent[1])
    assert stiff.load[-1] == pytest.approx(bent[1].load[-1], rel=0.01)


def test_the_start_of_each_frame_does_not_matter(bent: tuple[InflatedModel, History]) -> None:
    """A linear law's strain path is short here: more frames on the way change little."""
    finer = bend(beam((1.0, 2.0, 4.0, 6.0, 8.0, 10.0)))[0]
    assert finer.load[-1] == pytest.approx(bent[1].load[-1], rel=1e-3)


def test_the_line_search_finds_what_plain_newton_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    """A little way, which both manage; and in one go."""
    model = beam((1.0, 3.0))
    with_search = bend(model)[0]
    with monkeypatch.context() as patch:
        patch.setattr(ClosedMembrane, "equilibrium", Membrane.equilibrium)
        plain = bend(model)[0]
    assert with_search.load == pytest.approx(plain.load, rel=1e-6)
    in_one = bend(beam((3.0,)))[0]
    assert in_one.load[-1] == pytest.approx(plain.load[-1], rel=1e-3)


def test_work_of_the_collar_is_what_gas_and_fabric_store() -> None:
    """Work of the collar = work of the internal forces + that of the gas - that of the air outside.

    Trapezia over small steps; friction and the penalty's own energy (far below 1 %) left out.
    """
    moves = tuple(np.arange(0.5, 10.1, 0.5))
    model = beam(moves)
    history, m = bend(model)
    load, way = history.load, np.array([0.0, *moves])
    work = float(np.sum(0.5 * (load[1:] + load[:-1]) * np.diff(way)))
    # Without gas, pressure and bodies the residual is the internal force.
    stored = 0.0
    m.strain_old[:], m.stress_old[:] = 0.0, 0.0
    m.gas, m.bodies = None, ()
    before = None
    for u in history.displacement:
        m.unbalance(u, 0.0, with_tangent=False)
        forces = m.residual.copy()
        if before is not None:
            stored += 0.5 * float((forces + before[0]) @ (u - before[1]).reshape(-1))
        before = (forces, u)
    volume, absolute = history.cavity_volume, history.cavity_pressure + 0.101
    gas = absolute[0] * volume[0] * np.log(volume[0] / volume[-1]) + 0.101 * (
        volume[-1] - volume[0]
    )
    assert work == pytest.approx(model.copies * stored + gas, rel=0.01)


def test_a_wall_bends_with_all_of_its_stiffness_unless_told_otherwise() -> None:
    """D = E t^3/12 along every line, not none of it."""
    membranes = [
        closed_model.prepare(beam(), LINEAR, 1e-9, solver.wall)
        for solver in (MembraneSolver(), MembraneSolver(bending_stiffness=1.0))
    ]
    model = beam()
    planes = np.zeros(model.mesh.points.shape, dtype=bool)
    for name, axis in (("symmetry_x", 0), ("symmetry_z", 2)):
        planes[model.mesh.node_sets[name], axis] = True
    whole = flexure_of(model.mesh.points, model.mesh.quads, model.warp, model.thickness, planes)
    for membrane in membranes:
        assert membrane.flexure is not None
        assert membrane.flexure.shares == pytest.approx(whole.shares)
    none = closed_model.prepare(beam(), LINEAR, 1e-9, Wall(bending_stiffness=0.0))
    assert none.flexure is None


def test_a_jump_between_frames_is_remarked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every frame but the first two jumps, where no node may leave its line."""
    moves = (2.0, 4.0, 6.0, 8.0)
    assert not [r for r in bend(beam(moves))[0].remarks if "snaps" in r]
    monkeypatch.setattr(bending, "SNAP", 1e-6)
    (remark,) = [r for r in bend(beam(moves))[0].remarks if "snaps" in r]
    assert remark == "snaps, or nearly, before 6, 8 mm of deflection"


def test_what_wrinkles_carry_is_their_work_over_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three N mm in the quarter's every step: most of the load where the step is shortest."""
    monkeypatch.setattr(ClosedMembrane, "wrinkle_work", lambda *_: 3.0)
    solver = MembraneSolver(1e-9, wrinkle_stiffness=0.01)
    history = solver.run(beam((2.0, 6.0)), LINEAR)
    (remark,) = [r for r in history.remarks if "left to wrinkles" in r]
    said = re.search(r"\(0\.01 of the taut fabric's\) carries (\S+) % of the largest load", remark)
    assert said is not None
    carried = 4 * 3.0 / 2.0  # of the whole beam, N
    assert float(said[1]) == pytest.approx(100 * carried / history.load.max(), rel=0.05)


def test_mistakes_in_the_plan() -> None:
    model = beam()
    with pytest.raises(InputError, match=r"displacements: expected positive, increasing"):
        replace(model, bending=replace(model.bending, displacements=[4.0, 2.0]))
    with pytest.raises(InputError, match="no node set 'nowhere'"):
        replace(model, bending=replace(model.bending, released="nowhere"))
