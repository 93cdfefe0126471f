"""solvers/membrane/cords.py: cords along tubes and sheets."""

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, SheetCord
from bubblefit.meshes.cylinder_model import (
    Collar,
    Cord,
    ForceTable,
    InflatedModel,
    RigidSupports,
    inflated_cylinder,
)
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh, grid_quads
from bubblefit.meshes.tube import cylinder_mesh
from bubblefit.solvers.membrane import bubble
from bubblefit.solvers.membrane.closed import prepare
from bubblefit.solvers.membrane.cords import cords_on_sheet
from bubblefit.solvers.membrane.cylinder import closed_membrane_of
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...support.refusals import refused

LINEAR = ForceTable(np.array([0.0, 1.0]), np.array([0.0, 40e3]))
KINKED = ForceTable(np.array([0.0, 2e-4, 1.0]), np.array([0.0, 20.0, 90e3]))
WALL = HypoelasticLaw.linear(400.0, 500.0, 50.0, 0.2)
RADIUS, LENGTH, THICKNESS, PRESSURE = 100.0, 800.0, 0.8, 0.03
THREE = (60.0, 180.0, 300.0)


def tube_with_cords(cords, symmetry="quarter", pressures=(0.25 * PRESSURE, PRESSURE)):
    mesh = cylinder_mesh(LENGTH, 2 * RADIUS, 50.0, symmetry=symmetry)
    if symmetry == "quarter":
        supports = {"symmetry_x": (0,), "symmetry_z": (2,)}
        low = mesh.node_sets["bottom_line"]
        at = low[np.argmin(mesh.points[low, 2])]
        sets = {**mesh.node_sets, "low": np.array([at])}
        supports |= {"low": (1,)}
    else:
        sets = mesh.node_sets
        supports = {"top_line": (0,), "bottom_line": (0,), "mid_span": (2,)}
        low = mesh.node_sets["bottom_line"]
        at = low[np.argmin(np.abs(mesh.points[low, 2]))]
        sets = {**sets, "low": np.array([at])}
        supports["low"] = (1,)
    mesh = type(mesh)(mesh.points, mesh.quads, sets, mesh.element_sets, mesh.warp)
    return InflatedModel(
        mesh, THICKNESS, mesh.warp, list(pressures), supports,
        4 if symmetry == "quarter" else 1, cords=cords,
    )  # fmt: skip


@pytest.mark.parametrize("table", [LINEAR, KINKED])
@pytest.mark.parametrize(("given", "bonded"), [(None, True), (150.0, True), (150.0, False)])
def test_tangent_with_cords_is_the_derivative_of_the_residual(table, given, bonded):
    model = tube_with_cords([Cord(a, table, given, bonded=bonded) for a in (0.0, 100.0, 260.0)])
    membrane = prepare(model, WALL, 1e-9, None)
    assert membrane.cords is not None
    rng = np.random.default_rng(1)
    u = 0.3 * rng.standard_normal(membrane.reference.shape) + 2e-3 * membrane.reference
    if given:
        membrane.cords.begin(membrane.reference + 0.4 * u)
    way = rng.standard_normal(u.shape)
    way.reshape(-1)[np.setdiff1d(np.arange(u.size), membrane.free)] = 0.0
    step, ends = 1e-6, []
    force, stiffness = membrane.cords.forces(membrane.reference + u)
    for sign in (1, -1):
        ends.append(membrane.cords.forces(membrane.reference + u + sign * step * way)[0])
    if bonded:  # else a member's force depends on the others, too
        local = np.einsum("mij,mj->mi", stiffness, way[membrane.cords.nodes].reshape(-1, 12))
        difference = (ends[0] - ends[1]).reshape(-1, 12) / (2 * step)
        assert np.abs(local - difference).max() < 1e-6 * np.abs(difference).max()
    assert np.abs(force.sum(axis=1)).max() < 1e-9
    # And it reaches the matrix: Newton's own tangent against differences of its residual.
    membrane.unbalance(u, PRESSURE, with_tangent=True)
    membrane.tangent.factor()
    plus, minus = (residual_of(membrane, u + sign * step * way) for sign in (1, -1))
    back = membrane.tangent.solve((plus - minus)[membrane.free] / (2 * step))
    wanted = way.reshape(-1)[membrane.free]
    assert np.abs(back - wanted).max() < 1e-4 * np.abs(wanted).max()


def residual_of(membrane, u):
    membrane.unbalance(u, PRESSURE, with_tangent=False)
    return membrane.residual.copy()


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_wall_and_cords_share_the_thrust_of_the_pressure(symmetry):
    solver = MembraneSolver(1e-9)
    model = tube_with_cords([Cord(a, LINEAR) for a in THREE], symmetry)
    history = solver.run(model, WALL)
    cords = solver._prepared[1].cords
    mesh = model.mesh
    middle = np.abs(mesh.points[mesh.quads][..., 2]).min(axis=1) < 1e-6
    stress = solver.stress[middle][..., 0].mean()
    near = np.isin(cords.quads, np.flatnonzero(middle))
    share = {"quarter": 4.0, "full": 1.0}[symmetry]
    at = (mesh.points + history.displacement[-1])[mesh.node_sets["mid_span"]]
    section = ring_area(at, symmetry)
    around = 2 * np.sqrt(np.pi * section)
    pull = cords.force[near] * cords.mesh_share[near]
    # A quarter has half of the circumference; a whole ring has quads on both sides of mid-span.
    total = pull.sum() * (2.0 if share == 4 else 0.5)
    assert total > 0.2 * PRESSURE * section
    assert stress * THICKNESS * around + total == pytest.approx(PRESSURE * section, rel=0.02)
    # Section with cords: strain = (thrust - nu hoop) / (E t 2 pi r + 3 EA), small strains.
    e1, e2, nu = 400.0, 500.0, 0.2
    hoop = PRESSURE * RADIUS
    by_hoop = nu * hoop * 2 * np.pi * RADIUS * 1.0
    plain = PRESSURE * np.pi * RADIUS**2 - by_hoop
    strain = plain / (e1 * THICKNESS * 2 * np.pi * RADIUS + 3 * 40e3)
    assert cords.force[near].mean() == pytest.approx(40e3 * strain, rel=0.06)
    assert e2 > e1


def ring_area(at, symmetry):
    x, y = at[np.argsort(np.arctan2(at[:, 0], -at[:, 1])), :2].T
    area = 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    return 2 * area if symmetry == "quarter" else area


def test_forces_of_cords_in_the_inflated_tube_stiffen_its_bending():
    loads = []
    for force in (None, 60.0):
        cords = [] if force is None else [Cord(a, LINEAR, force) for a in THREE]
        model = inflated_cylinder(
            150.0, 0.1, 0.81, 75.0, 1500.0, 0.0, RigidSupports(1000.0, 100.0),
            Collar(180.0, 145.0), [4.0], cords=cords,
        )  # fmt: skip
        loads.append(MembraneSolver(wall="tension field").run(model, WALL).load[-1])
    assert loads[1] > 1.1 * loads[0]


def test_sliding_cord_has_one_force_and_stiffens_less():
    forces, loads = [], []
    for bonded in (True, False):
        cords = [Cord(a, LINEAR, 60.0, bonded=bonded) for a in THREE]
        model = inflated_cylinder(
            150.0, 0.1, 0.81, 75.0, 1500.0, 0.0, RigidSupports(1000.0, 100.0),
            Collar(180.0, 145.0), [4.0, 20.0], cords=cords,
        )  # fmt: skip
        solver = MembraneSolver(wall="tension field")
        loads.append(solver.run(model, WALL).load)
        membrane = prepare(closed_membrane_of(model), WALL, 1e-9, None)
        membrane.cords.begin(membrane.reference)
        bent = membrane.reference.copy()
        bent[:, 1] -= 1e-4 * bent[:, 2] ** 2 * (bent[:, 1] > 0)
        membrane.cords.forces(bent)
        forces.append([np.ptp(membrane.cords.force[membrane.cords.cord == k]) for k in (0, 1)])
    assert forces[0][0] > 1.0 and max(forces[1]) < 1e-9
    assert (loads[1][1:] < 0.99 * loads[0][1:]).all()
    # Strained alike all along, as by inflation, a cord that slides is one that is bonded.
    even = [
        MembraneSolver(1e-9).run(tube_with_cords([Cord(a, LINEAR, bonded=b) for a in THREE]), WALL)
        for b in (True, False)
    ]
    assert even[1].cavity_volume == pytest.approx(even[0].cavity_volume, rel=1e-4)


def test_half_a_tube_needs_mirror_image_of_a_cord():
    raised = refused(prepare, tube_with_cords([Cord(60.0, LINEAR)]), WALL, 1e-9, None)
    assert raised.field == "cord.angle" and "300" in raised.problem


def test_force_table_is_straight_between_and_beyond_its_points():
    force, slope = KINKED.pull([-1e-4, 1e-4, 0.5, 2.0])
    steep = (90e3 - 20.0) / (1.0 - 2e-4)
    assert force == pytest.approx([0.0, 10.0, 20.0 + steep * (0.5 - 2e-4), 90e3 + steep])
    assert slope == pytest.approx([0.0, 1e5, steep, steep])
    assert KINKED.pull([-1e-4], tension_only=False)[0] == pytest.approx([-10.0])
    assert KINKED.strain_at(10.0) == pytest.approx(1e-4)
    assert refused(ForceTable, np.array([0.0, 0.0]), np.array([0.0, 1.0])).field == "strain"


def bubble_with(*lines, symmetry="full", table=LINEAR, **more):
    cords = [SheetCord(ends, table, **more) for ends in lines]
    return BubbleModel(disk_mesh(100.0, 200, symmetry), 0.8, (0.01, 0.04), cords=cords)


ALONG_X, CROSS = [[-100, 0], [100, 0]], ([[-70, -70], [70, 70]], [[70, -70], [-70, 70]])
ABOVE, BELOW = [[-90, 30], [90, 30]], [[90, -30], [-90, -30]]


def test_tangent_of_a_sheet_with_a_cord_against_differences():
    membrane = bubble.prepare(bubble_with([[-50, -13], [31, 47]]), WALL, 1e-9, None)
    rng = np.random.default_rng(1)
    u, way = rng.standard_normal((2, *membrane.reference.shape))
    u = 0.1 * u + 1e-2 * membrane.reference
    membrane.unbalance(u, PRESSURE, with_tangent=True)
    membrane.tangent.factor()
    way.reshape(-1)[np.setdiff1d(np.arange(way.size), membrane.free)] = 0.0
    plus, minus = (residual_of(membrane, u + sign * 1e-6 * way) for sign in (1, -1))
    back = membrane.tangent.solve((plus - minus)[membrane.free] / 2e-6)
    assert np.abs(back - way.reshape(-1)[membrane.free]).max() < 1e-4
    cords = membrane.cords
    assert cords.force.max() > 100.0 and cords.rest_length.sum() == pytest.approx(
        np.hypot(81.0, 60.0)
    )


@pytest.mark.parametrize("lines", [[ALONG_X], [ABOVE, BELOW], CROSS])
def test_a_quarter_of_a_sheet_with_cords_is_a_quarter_of_the_whole(lines):
    ends = []
    for symmetry, share in (("full", 1), ("quarter", 4)):
        model = bubble_with(*lines, symmetry=symmetry)
        apex, cords = model.mesh.node_sets["apex"][0], cords_on_sheet(model)
        length = sum(np.linalg.norm(np.subtract(*line)) for line in lines)
        assert share * cords.mesh_share @ cords.rest_length == pytest.approx(length)
        ends.append(MembraneSolver(1e-9).run(model, WALL).displacement[:, apex, 2])
    assert ends[1] == pytest.approx(ends[0], rel=1e-8)
    # One that stays slack changes nothing; others hold the sheet down.
    slack = MembraneSolver(1e-9).run(bubble_with(*lines, prestrain=-0.1), WALL).displacement
    plain = MembraneSolver(1e-9).run(bubble_with(), WALL).displacement
    assert (slack == plain).all()
    assert (ends[0] < 0.95 * plain[:, apex, 2]).all()


@pytest.mark.parametrize("prestrain", [0.0, 0.01])
def test_two_cords_that_carry_a_soft_strip_are_arcs_of_circles(prestrain):
    """Compare with arcs of half angle a: cord and strip hold p w L / (2 sin a) together."""
    length, width, stiffness, pressure = 200.0, 20.0, 2e4, 0.01
    soft = HypoelasticLaw.linear(1.0, 1.0, 0.4, 0.0)

    def pulls(a):
        longer = a / np.sin(a)
        return stiffness * (longer - 1 + prestrain), 0.5 * width * np.log(longer)

    low, high = 1e-3, 1.5
    for _ in range(60):
        a = 0.5 * (low + high)
        cord, strip = pulls(a)
        enough = 2 * cord + strip > pressure * width * length / (2 * np.sin(a))
        low, high = (low, a) if enough else (a, high)
    height, off = 0.5 * length * np.tan(0.5 * a), []
    for count in (10, 20):
        x, sides = np.linspace(-0.5 * length, 0.5 * length, count + 1), (-10.0, 10.0)
        points = np.array([[at, y, 0.0] for at in x for y in sides])
        nodes = np.arange(len(points)).reshape(-1, 2)
        sets = {"rim": nodes[[0, -1]].ravel(), "sides": nodes.ravel()}
        table = ForceTable([0.0, 1.0], [0.0, stiffness])
        cords = [SheetCord([[-100.0, y], [100.0, y]], table, prestrain) for y in sides]
        model = BubbleModel(
            Mesh(points, grid_quads(nodes), sets), 0.5, (pressure,),
            supports={"rim": (0, 1, 2), "sides": (1,)}, cords=cords,
        )  # fmt: skip
        guess = np.zeros((1, *points.shape))
        guess[0, :, 2] = height * (1 - (2 * points[:, 0] / length) ** 2)
        solver = MembraneSolver(1e-10)
        found = solver.run(model, soft, guess=guess).displacement[-1, :, 2].max()
        force = solver._prepared[1].cords.force
        off.append([found / height - 1, force.mean() / pulls(a)[0] - 1])
        assert np.ptp(force) < 1e-9 * force.mean()
    assert np.abs(off[1]).max() < 1e-3
    assert np.divide(*off) == pytest.approx(4.0, rel=0.02)  # second order


def test_bad_cords_of_a_sheet_are_refused():
    for lines, words in (([ABOVE], "in y = 0"), ([[[0, 30], [60, 0]]], "in x = 0")):
        raised = refused(bubble_with, *lines, symmetry="quarter")
        assert raised.field == "cord[0].ends" and words in raised.problem
    beside = bubble_with([[200, 0], [200, 50]])
    assert refused(cords_on_sheet, beside).field == "cord[0].ends"
    assert refused(SheetCord, [[1, 2], [1, 2]], LINEAR).field == "ends"
