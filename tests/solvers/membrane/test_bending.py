"""Bent tubes: jaws, tension field, stiffness of the wall."""

import re
from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.point_state import PointState, point_response
from bubblefit.materials.wrinkles import FabricIncrement, relaxed_update
from bubblefit.meshes.closed_surfaces import half_tube, tube_warp
from bubblefit.meshes.cylinder_model import (
    Bending,
    Collar,
    Gas,
    InflatedModel,
    RigidCylinder,
    RigidSupports,
    inflated_cylinder,
    usual_collar,
)
from bubblefit.meshes.mesh import Mesh
from bubblefit.runs.verification.bent_tube import (
    FIRST_WRINKLE,
    TubeWithPlaneEnds,
    published_moment,
)
from bubblefit.solvers.base import BandedSolver
from bubblefit.solvers.membrane import bending, cylinder
from bubblefit.solvers.membrane import closed as closed_model
from bubblefit.solvers.membrane.closed import ClosedMembrane
from bubblefit.solvers.membrane.contact import brought_to_touch, contact_forces, gaps
from bubblefit.solvers.membrane.cylinder import closed_membrane_of
from bubblefit.solvers.membrane.flexure import Flexure, flexure_of
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.membrane.wall import LEFT, STIFF, TENSION_FIELD, Wall
from bubblefit.solvers.registry import solver_named
from hypothesis import given, settings
from hypothesis import strategies as st

from ...support.refusals import complaint
from .test_inflated import LAW

RADIUS, LENGTH, SPAN = 75.0, 600.0, 800.0
POST = RigidCylinder("support", (1.0, 0.0, 0.0), (0.0, 0.0, 0.5 * SPAN), 50.0)
RING = RigidCylinder("collar", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 120.0, True, 145.0, 10.0)
# Stiff, so that the strain measure and the strain path do not matter.
LINEAR = HypoelasticLaw.linear(5000.0, 4000.0, 200.0)


def beam(displacements=(2.0, 6.0, 10.0), penalty=5.0, across=8):
    mesh = half_tube(across, 24, RADIUS, LENGTH)
    foot = mesh.node_sets["foot"]
    hang = foot[[np.argmin(np.abs(mesh.points[foot, 2] - 0.5 * SPAN))]]
    mesh = Mesh(mesh.points, mesh.quads, {**mesh.node_sets, "hang": hang})
    return InflatedModel(
        mesh, 0.81, tube_warp(mesh, LENGTH), [0.005, 0.02, 0.05, 0.1],
        {"symmetry_x": (0,), "symmetry_z": (2,), "hang": (1,)}, copies=4,
        bending=Bending([POST], [RING], displacements, released="hang", penalty=penalty),
    )  # fmt: skip


def bend(model, law=LINEAR):
    solver = MembraneSolver(1e-9)
    return solver.run(model, law), solver._prepared[1]


@pytest.fixture(scope="module")
def bent():
    model = beam()
    return model, bend(model)[0]


@pytest.mark.parametrize("body", [POST, RING])
def test_distance_has_its_gradient_and_hessian(body):
    rng = np.random.default_rng(2)
    angle, z = rng.uniform(0.2, 2.9, 60), rng.uniform(-72.0, 72.0, 60)
    r = rng.uniform(105.0, 122.0, 60)
    points = np.stack([r * np.cos(angle), r * np.sin(angle), z + body.centre[2]], axis=1)
    gap, out, hessian = gaps(body, points)
    assert np.linalg.norm(out, axis=1) == pytest.approx(1.0, abs=1e-12)
    step, smooth = 1e-4, np.abs(np.abs(z) - 62.5) > 1e-3  # curvature jumps where the mouth begins
    for k in range(3):
        up, down = (gaps(body, points + s * step * np.eye(3)[k]) for s in (1, -1))
        assert out[:, k] == pytest.approx((up[0] - down[0]) / (2 * step), abs=1e-6)
        slope = (up[1] - down[1]) / (2 * step)
        assert hessian[smooth, :, k] == pytest.approx(slope[smooth], abs=1e-5)
    assert ((gap < 0).any() and (gap > 0).any()) or not body.ring
    x = np.asarray(body.centre) + rng.uniform(-160, 160, (4000, 3))
    gap, out, _ = gaps(body, x)
    force, _, touched = contact_forces(body, x, np.full(len(x), 2.0))
    np.testing.assert_array_equal(touched, np.flatnonzero(gap < 0))
    assert 100 < len(touched) < len(x)
    assert force == pytest.approx(np.where(gap[:, None] < 0, -2.0 * gap[:, None] * out, 0.0))


def test_ring_and_post_by_hand():
    x = np.array([[0.0, 121.0, 0.0], [0.0, 119.0, 50.0], [0.0, 121.0, 72.5], [0.0, 130.0, 80.0]])
    # In the mouth: the fillet's circle stands at r = 130, z = 62.5.
    expected = [-1.0, 1.0, np.hypot(9.0, 10.0) - 10.0, 17.5 - 10.0]
    assert gaps(RING, x)[0] == pytest.approx(expected, abs=1e-6)
    assert gaps(POST, np.array([[7.0, -30.0, 440.0]]))[0] == pytest.approx([0.0], abs=1e-12)
    force, stiffness, touched = contact_forces(RING, x, np.full(4, 3.0))
    assert touched.tolist() == [0]
    assert force[0] == pytest.approx([0.0, -3.0, 0.0])
    assert stiffness[0, 1, 1] == pytest.approx(3.0)


def test_bodies_are_brought_to_touch():
    points = half_tube(16, 24, RADIUS, LENGTH).points
    way = np.array([0.0, -1.0, 0.0])
    post = brought_to_touch(POST, points, -way, 0.02)
    ring = brought_to_touch(RING, points, way, 0.0)
    assert post.centre == pytest.approx((0.0, -RADIUS - 50.0 + 0.02, 400.0), abs=1e-6)
    assert ring.centre == pytest.approx((0.0, RADIUS - 120.0, 0.0), abs=1e-6)
    with pytest.raises(InputError, match="no node of the mesh lies where 'support' could touch"):
        brought_to_touch(replace(POST, centre=(0.0, 0.0, 900.0)), points, -way, 0.02)


def test_balance_mass_penetration_and_frames_of_a_bending(bent):
    _, history = bent
    assert (np.diff(history.load) > 0).all()
    assert history.load[0] == 0.0
    total = history.reactions["collar"] + history.reactions["support"]
    assert total[1:] == pytest.approx(0.0, abs=1e-4 * history.load[1])
    assert history.load == pytest.approx(-history.reactions["collar"][:, 1])
    amount = (history.cavity_pressure + 0.101) * history.cavity_volume
    assert amount == pytest.approx(np.full(len(amount), amount[0]), rel=1e-12)
    assert history.cavity_pressure[-1] > history.cavity_pressure[0]

    def depth(history):
        (text,) = [r for r in history.remarks if "penetrate" in r]
        return float(text.split()[3])

    stiff = bend(beam(penalty=50.0))[0]
    assert depth(stiff) < 0.2 * depth(history)
    assert stiff.load[-1] == pytest.approx(history.load[-1], rel=0.01)
    # A linear law's strain path is short here: more frames on the way change little.
    finer = bend(beam((1.0, 2.0, 4.0, 6.0, 8.0, 10.0)))[0]
    assert finer.load[-1] == pytest.approx(history.load[-1], rel=1e-3)


def test_work_of_the_collar_is_what_gas_and_fabric_store():
    """By trapezia over small steps; friction and the penalty's own energy are left out."""
    moves = tuple(np.arange(0.5, 10.1, 0.5))
    model = beam(moves)
    history, m = bend(model)
    work = float(np.trapezoid(history.load, [0.0, *moves]))
    # Without gas, pressure and bodies the residual is the internal force.
    m.strain_old[:], m.stress_old[:] = 0.0, 0.0
    m.gas, m.bodies, forces = None, (), []
    for u in history.displacement:
        m.unbalance(u, 0.0, with_tangent=False)
        forces.append(m.residual.copy())
    mean = 0.5 * (np.array(forces[1:]) + forces[:-1])
    stored = float(np.sum(mean * np.diff(history.displacement, axis=0).reshape(mean.shape)))
    volume, absolute = history.cavity_volume, history.cavity_pressure + 0.101
    gas = absolute[0] * volume[0] * np.log(volume[0] / volume[-1])
    gas += 0.101 * (volume[-1] - volume[0])
    assert work == pytest.approx(model.copies * stored + gas, rel=0.01)


def test_a_wall_bends_with_all_of_its_stiffness_unless_told_otherwise():
    model = beam()
    planes = np.zeros(model.mesh.points.shape, dtype=bool)
    for name, axis in (("symmetry_x", 0), ("symmetry_z", 2)):
        planes[model.mesh.node_sets[name], axis] = True
    whole = flexure_of(model.mesh.points, model.mesh.quads, model.warp, model.thickness, planes)
    for solver in (MembraneSolver(), MembraneSolver(bending_stiffness=1.0)):
        membrane = closed_model.prepare(model, LINEAR, 1e-9, solver.wall)
        assert membrane.flexure.shares == pytest.approx(whole.shares)
    none = closed_model.prepare(model, LINEAR, 1e-9, Wall(bending_stiffness=0.0))
    assert none.flexure is None


def test_what_wrinkles_carry_is_their_work_over_the_way(monkeypatch):
    """Three N mm in the quarter's every step: most of the load where the step is shortest."""
    monkeypatch.setattr(ClosedMembrane, "wrinkle_work", lambda *_: 3.0)
    solver = MembraneSolver(1e-9, wrinkle_stiffness=0.01)
    history = solver.run(beam((2.0, 6.0)), LINEAR)
    (remark,) = [r for r in history.remarks if "left to wrinkles" in r]
    said = re.search(r"\(0\.01 of the taut fabric's\) carries (\S+) % of the largest load", remark)
    assert said is not None
    carried = 4 * 3.0 / 2.0  # of the whole beam, N
    assert float(said[1]) == pytest.approx(100 * carried / history.load.max(), rel=0.05)


def test_mistakes_in_the_plan_and_jumps_between_frames(monkeypatch):
    moves = (2.0, 4.0, 6.0, 8.0)
    assert not [r for r in bend(beam(moves))[0].remarks if "snaps" in r]
    monkeypatch.setattr(bending.BendingAnalysis, "leap", 1e-6)
    (remark,) = [r for r in bend(beam(moves))[0].remarks if "snaps" in r]
    assert remark == "snaps, or nearly, before 6, 8 mm of deflection"


strains = st.tuples(*[st.floats(-0.08, 0.08)] * 2, st.floats(-0.2, 0.2)).map(np.array)
TAUT, WRINKLED, SLACK = 0, 1, 2


def update(h, h_old=(0, 0, 0), s_old=(0, 0, 0), share=0.01, law=LAW):
    he, s, carried = (np.empty(3) for _ in range(3))
    slope, written = np.empty((3, 3)), point_response().law
    before = PointState(np.array(h_old, float), np.array(s_old, float))
    after = PointState(he, s)
    increment = FabricIncrement(law.compiled, before, np.array(h, float), after, written)
    state = relaxed_update(increment, share, carried, slope)
    return state, he, s, carried, written.tangent, slope


def principal(a, b, c):
    return np.linalg.eigvalsh([[a, c], [c, b]])


@settings(max_examples=200, deadline=None)
@given(strains, strains)
def test_no_compression_and_no_work_on_a_wrinkle(first, then):
    _, he, s, *_ = update(first)
    for h, old, s_old in ((first, np.zeros(3), np.zeros(3)), (then, he, s)):
        state, fabric, stress, *_ = update(h, old, s_old)
        assert state >= 0
        wrinkle = fabric - h
        assert principal(*stress)[0] >= -1e-9
        assert principal(*(wrinkle * [1, 1, 0.5]))[0] >= -1e-11
        assert abs(stress @ wrinkle) < 1e-9
        assert (state == TAUT) == (not wrinkle.any())
        assert state != SLACK or not stress.any()


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_derivatives_of_stress_and_strain(seed):
    """At strains off the axes, where moduli (held below zero strain) have kinks of their own."""
    rng = np.random.default_rng(seed)
    first = rng.normal(0.01, [0.04, 0.04, 0.08])
    then = first + rng.normal(0.0, [0.015, 0.015, 0.03])
    _, old, s_old, *_ = update(first)
    state, _, _, _, tangent, slope = update(then, old, s_old)
    step, stress, strain = 1e-7, np.empty((3, 3)), np.empty((3, 3))
    for j in range(3):
        up, down = (update(then + k * step * np.eye(3)[j], old, s_old) for k in (1, -1))
        if {up[0], down[0]} != {state}:
            return  # a kink within the difference
        stress[:, j] = (up[3] - down[3]) / (2 * step)
        strain[:, j] = (up[1] - down[1]) / (2 * step)
    assert tangent == pytest.approx(stress, abs=2e-5 * np.abs(stress).max())
    assert slope == pytest.approx(strain, abs=2e-5)


@given(st.floats(0.001, 0.08), st.floats(0.001, 0.3))
def test_a_strip_that_is_pulled_wrinkles_where_it_is_narrowed(along, narrower):
    """Fabric pulled along the fill and narrowed by more than nu: the stress of a free strip."""
    law = HypoelasticLaw.linear(800.0, 140.0, 20.0, 0.24)
    free = -0.24 * 140.0 / 800.0 * along
    state, he, s, *_ = update([free - narrower, along, 0.0], law=law)
    assert state == WRINKLED
    assert s == pytest.approx([0.0, 140.0 * along, 0.0], rel=1e-12, abs=1e-10)
    assert he == pytest.approx([free, along, 0.0], rel=1e-12, abs=1e-14)


def test_a_wrinkle_is_the_strain_of_the_fabric_less_that_of_the_surface():
    """A tube wider by 2 % and shorter by 3 %: what is left to its wrinkles is pushed together."""
    membrane = closed_model.prepare(beam(), LINEAR, 1e-9, Wall(0.01, 0.0))
    membrane.unbalance(membrane.reference * [0.02, 0.02, -0.03], 0.0, False)
    folded = membrane.wrinkle[..., 0] != 0.0  # the tube, not its ends
    along = membrane.strain_new[folded, 0] - np.log(0.97)
    assert along.min() > 0.02 and folded.sum() > 700
    assert membrane.wrinkle[folded, 0] == pytest.approx(along, rel=1e-6)
    assert membrane.wrinkle_work(0 * membrane.wrinkle) > 0


def test_bent_tube_wrinkles_as_published():
    tube, taut = TubeWithPlaneEnds(32, 1e-4), TubeWithPlaneEnds(32, None)
    for times in (1.5, 2.5, 4.0):
        wrinkled, moment, radius = tube.moment(times * FIRST_WRINKLE)
        expected_wrinkled, expected = published_moment(times * FIRST_WRINKLE, radius)
        assert moment == pytest.approx(expected, rel=2e-3)
        assert wrinkled == pytest.approx(expected_wrinkled, abs=1.0 / 32)
    # A membrane that carries compression goes on as it began.
    assert taut.moment(1.5 * FIRST_WRINKLE)[1] == pytest.approx(0.75, rel=1e-2)


R, L, THICKNESS = 75.0, 40.0, 0.8
SHEET = HypoelasticLaw.linear(800.0, 140.0, 20.0, 0.24)
PLANE = 1.0 / (1.0 - 0.24**2 * 140.0 / 800.0)


def quarter(across, warp=None, thickness=THICKNESS, caps=False):
    mesh = half_tube(across, 4, R, L, caps)
    p = mesh.points
    planes = np.zeros(p.shape, dtype=bool)
    planes[mesh.node_sets["symmetry_x"], 0] = True
    planes[mesh.node_sets["symmetry_z"], 2] = True
    planes[mesh.node_sets["end"], 2] = not caps
    warp = tube_warp(mesh, L) if warp is None else warp
    return p, flexure_of(p, mesh.quads, warp, thickness, planes)


def energy(points, flexure):
    x = points.reshape(-1)
    return 0.5 * float(x @ (flexure.matrix(SHEET, len(points)) @ x))


def test_bending_energy_of_a_rolled_sheet():
    def rolled(modulus):
        """D/2 curvature^2 times the surface of half a tube."""
        return 0.5 * modulus * PLANE * THICKNESS**3 / 12.0 / R**2 * np.pi * R * L

    errors = [energy(*quarter(n)) / rolled(140.0) - 1.0 for n in (16, 32, 64)]
    assert abs(errors[2]) < 2e-3
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1)
    # The same tube with its warp around: tangents of the facets turn, so given as one by one.
    mesh = half_tube(64, 4, R, L, caps=False)
    centre = mesh.points[mesh.quads].mean(axis=1)
    around = np.stack([-centre[:, 1], centre[:, 0], 0 * centre[:, 0]], axis=1)
    assert energy(*quarter(64, around)) == pytest.approx(rolled(800.0), rel=3e-3)
    thin, thick = (energy(*quarter(16, thickness=t)) for t in (0.4, 0.8))
    assert thick == pytest.approx(8.0 * thin, rel=1e-12)


def test_mirrored_lines_and_the_rim_of_a_cap():
    """Around, the curvature of the tube on top and bottom line; along, none in the end rings."""
    points, flexure = quarter(16)
    ends = flexure.nodes[:, 0] == flexure.nodes[:, 2]
    assert ends.sum() == 2 * 5 + 2 * 17  # top and bottom line; the rings at both ends
    curvature = np.einsum("hai,hai->hi", flexure.differences[ends], points[flexure.nodes[ends]])
    size = np.sort(np.linalg.norm(curvature, axis=1))
    assert size[-10:] == pytest.approx(np.full(10, 1 / R), rel=5e-3)
    assert size[:-10] == pytest.approx(0.0, abs=1e-12)
    # A rigid motion turns the forces between nodes and adds none.
    inner = Flexure(*(part[~ends] for part in (flexure.nodes, flexure.differences, flexure.shares)))
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    matrix = inner.matrix(SHEET, len(points))
    force = (matrix @ points.reshape(-1)).reshape(-1, 3)
    moved = (matrix @ (points @ turn.T + [3.0, -2.0, 5.0]).reshape(-1)).reshape(-1, 3)
    assert moved == pytest.approx(force @ turn.T, abs=1e-9 * np.abs(force).max())
    assert force.sum(axis=0) == pytest.approx(0.0, abs=1e-12)
    points, flexure = quarter(16, caps=True)
    before, node, after = points[flexure.nodes].transpose(1, 0, 2)
    rim = (node[:, 2] > L - 1e-6) & (np.hypot(node[:, 0], node[:, 1]) > R - 1e-6)
    assert rim.any()
    assert (before[rim, 2] > L - 1e-6).all() and (after[rim, 2] > L - 1e-6).all()


WALL_LAW = HypoelasticLaw.linear(700.0, 150.0, 20.0)


@pytest.fixture(scope="module")
def model():
    return inflated_cylinder(150.0, 0.14, 0.81, 75.0, deflections=[2.0])


def wall_of(solver, model):
    return cylinder.prepare(model, WALL_LAW, 1e-8, solver.wall).wall


def test_the_band_goes_from_a_tension_field_to_a_stiff_wall(model):
    solver = MembraneSolver()
    assert wall_of(solver, model) == TENSION_FIELD == Wall(LEFT, 1.0)
    assert isinstance(solver, BandedSolver)
    ends = solver.band(model)
    assert [(end.name, end.predicted) for end in ends] == [
        ("tension field", True), ("stiff wall", False)
    ]  # fmt: skip
    own = [solver_named("membrane", wrinkle_stiffness=None, **end.options) for end in ends]
    walls = [wall_of(one, model) for one in own]
    assert walls == [TENSION_FIELD, STIFF] == [Wall(LEFT, 1.0), Wall(None, 1.0)]
    assert [one.band(model) for one in own] == [(), ()]
    assert not solver.band(closed_membrane_of(model))


@pytest.mark.parametrize(
    ("options", "wall"),
    [
        ({"wall": "tension field"}, Wall(LEFT, 1.0)),
        ({"wall": "stiff"}, Wall(None, 1.0)),
        ({"wrinkle_stiffness": 0.01}, Wall(0.01, 1.0)),
        ({"bending_stiffness": 0.5}, Wall(None, 0.5)),
        ({"wrinkle_stiffness": 0.01, "bending_stiffness": 0.0}, Wall(0.01, 0.0)),
        ({"wall": "tension field", "bending_stiffness": 0.5}, Wall(LEFT, 0.5)),
        ({"wall": "tension field", "wrinkle_stiffness": 0.02}, Wall(0.02, 1.0)),
        ({"wall": "stiff", "bending_stiffness": 0.0}, Wall(None, 0.0)),
    ],
)
def test_a_wall_that_is_asked_for_has_no_band(model, options, wall):
    solver = MembraneSolver(**options)
    assert wall_of(solver, model) == wall
    assert not solver.band(model)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"wall": "soft"}, "wall"),
        ({"wall": "stiff", "wrinkle_stiffness": 0.1}, "wrinkle_stiffness: a stiff wall has no"),
        ({"wrinkle_stiffness": 0.0}, "wrinkle_stiffness"),
        ({"wall": "stiff", "bending_stiffness": -1.0}, "bending_stiffness"),
    ],
)
def test_a_wall_that_cannot_be(options, field):
    assert complaint(MembraneSolver, **options).startswith(field)


LOADED = HypoelasticLaw.linear(300.0, 200.0, 20.0, 0.2)


def loaded(symmetry="quarter", **other):
    """The history of a short tube at 60 kPa that is bent by 5 and 10 mm, and its model."""
    said = {"supports": RigidSupports(700.0, 100.0), "collar": usual_collar(150.0), **other}
    model = inflated_cylinder(
        150.0, 0.06, 0.8, 75.0, 1000.0, 40.0, deflections=(5.0, 10.0), symmetry=symmetry, **said
    )
    return MembraneSolver().run(model, LOADED), model


def test_a_pump_keeps_the_pressure():
    closed, pumped = loaded()[0], loaded(gas=Gas(constant="pressure"))[0]
    assert pumped.cavity_pressure == pytest.approx(0.06, rel=1e-12)
    assert closed.cavity_pressure[-1] > 0.06 * 1.0003
    assert closed.load[-1] * 0.98 < pumped.load[-1] < closed.load[-1]


def test_weight_rests_on_the_supports():
    weight = 2e-5
    found, model = loaded(weight=weight)
    own = MembraneSolver()._membrane(model, LOADED).node_weight(weight).sum() * model.copies
    # Tube and caps of one layer, and two more layers of the seam; facets lie inside the circle.
    surface = np.pi * 150.0 * 1000.0 + 2 * np.pi * 75.0**2 + 2 * 40.0 * 1000.0
    assert own == pytest.approx(weight * surface, rel=0.02)
    assert found.reactions["supports"][:, 1] - found.load == pytest.approx(np.full(3, own), 1e-5)
    assert found.load[1] < loaded()[0].load[1]


def test_a_saddle_holds_the_tube_more_stiffly_than_a_post():
    saddle = RigidSupports(700.0, 100.0, Collar(165.0, 60.0))
    found, plain = loaded(supports=saddle)[0], loaded()[0]
    assert (found.load[1:] > 1.1 * plain.load[1:]).all()
    assert found.reactions["supports"][:, 1] == pytest.approx(found.load, abs=1e-4)
    tight = RigidSupports(700.0, 100.0, Collar(140.0, 60.0))
    assert "saddle.inner_diameter" in complaint(loaded, supports=tight)


def test_two_rings_bend_a_whole_tube_as_a_quarter():
    rings = replace(usual_collar(150.0), length=60.0, spacing=200.0)
    whole, quarter = loaded("full", collar=rings)[0], loaded(collar=rings)[0]
    assert whole.load == pytest.approx(quarter.load, rel=1e-4)
    # At a third of the span from the supports the same deflection takes more load.
    assert quarter.load[-1] > 1.05 * loaded(collar=replace(rings, spacing=0.0))[0].load[-1]
    assert "collar.length" in complaint(loaded, collar=replace(rings, spacing=600.0))
