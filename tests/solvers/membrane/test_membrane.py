"""The membrane: kernel, equilibrium, failure, single elements, marching."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from bubblefit.errors import SolverFailure
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import SIDE, PatchModel, elongations, straight_strip
from bubblefit.solvers.base import analysis_of
from bubblefit.solvers.membrane import extrapolation, factorisation
from bubblefit.solvers.membrane.factorisation import BandedTangent, SparseTangent, tangent_for
from bubblefit.solvers.membrane.kernel import reference_elements
from bubblefit.solvers.membrane.membrane import Membrane
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import solver_named

from ...builders.biaxial_tests import BENT_LAW
from ...builders.laws import TABLE_4_2
from ...inference.cases import MODEL as CASE_MODEL
from ...support.refusals import complaint

LAW = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.13, 0.13, 0.13])
PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])
E1, E2, G12, NU, THICKNESS = 300.0, 220.0, 5.0, 0.24, 0.81
BOTH = pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])


def grid(across, along, width, length, distort=0.0):
    x, y = np.meshgrid(np.linspace(0, length, along + 1), np.linspace(0, width, across + 1))
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    inside = (x > 0) & (x < length) & (y > 0) & (y < width)
    moves = np.random.default_rng(2).uniform(-distort, distort, (int(inside.sum()), 2))
    points[inside.ravel(), :2] += moves * [length / along, width / across]
    corner = (np.arange(across)[:, None] * (along + 1) + np.arange(along)).ravel()
    quads = np.stack([corner, corner + 1, corner + along + 2, corner + along + 1], axis=1)
    return points, quads


def membrane(points, quads, law, held, thickness=THICKNESS, tolerance=1e-11):
    free = np.setdiff1d(np.arange(points.size), held)
    return Membrane(
        points, quads, reference_elements(points, quads), thickness, law, free,
        tangent_for(quads, points.size, free), tolerance, step_limit=0.1 * np.ptp(points),
    )  # fmt: skip


def quarter_bubble(steps=None):
    mesh = disk_mesh(100.0, 192, "quarter")
    steps = default_increments(PRESSURES) if steps is None else steps
    return BubbleModel(mesh, THICKNESS, PRESSURES, steps)


def rotation():
    turn = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    return turn * np.sign(np.linalg.det(turn))


@BOTH
def test_patch_of_distorted_elements(thickness_change):
    points, quads = grid(4, 4, 10.0, 12.0, distort=0.3)
    gradient = rotation() @ [[1.06, 0.02, 0.0], [0.02, 1.04, 0.0], [0.0, 0.0, 1.0]]
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    on_rim = ((points[:, :2] == low) | (points[:, :2] == high)).any(axis=1)
    held = (3 * np.flatnonzero(on_rim)[:, None] + np.arange(3)).ravel()
    patch = membrane(points, quads, replace(LAW, thickness_change=thickness_change), held)
    exact = points @ gradient.T - points
    moves = np.random.default_rng(0).uniform(-0.2, 0.2, points.shape)
    found = patch.equilibrium(exact + ~on_rim[:, None] * moves, 0.0)
    assert found == pytest.approx(exact, abs=1e-8)
    stress = patch.stress_new.reshape(-1, 3)
    assert stress == pytest.approx(np.broadcast_to(stress[0], stress.shape), abs=1e-8)


@BOTH
def test_rigid_rotation_turns_every_force_and_nothing_else(thickness_change):
    solver = MembraneSolver(1e-11)
    u = solver.run(quarter_bubble(), replace(LAW, thickness_change=thickness_change)).path[-1]
    m, turn, pressure = solver._prepared[1], rotation(), PRESSURES[-1]
    # Out of balance, too.
    position = m.reference + u + np.random.default_rng(8).uniform(-0.3, 0.3, u.shape)
    m.unbalance(position - m.reference, pressure, False)
    forces, strain, stress = m.residual.copy(), m.strain_new.copy(), m.stress_new.copy()
    m.unbalance(position @ turn.T + [3.0, -2.0, 7.0] - m.reference, pressure, False)
    turned = forces.reshape(-1, 3) @ turn.T
    assert m.residual.reshape(-1, 3) == pytest.approx(turned, abs=1e-10 * np.abs(forces).max())
    assert m.strain_new == pytest.approx(strain, abs=1e-12)
    assert m.stress_new == pytest.approx(stress, abs=1e-9)


def test_quarter_and_full_disk_agree():
    """The rim is plane and fixed: the resultant is pressure times its polygon."""
    whole, quarter = (disk_mesh(100.0, 192, s) for s in ("full", "quarter"))
    steps = default_increments(PRESSURES)
    a, b = (MembraneSolver(1e-11).run(BubbleModel(m, THICKNESS, PRESSURES, steps), LAW)
            for m in (whole, quarter))  # fmt: skip
    place = {tuple(np.round(p, 6)): i for i, p in enumerate(whole.points)}
    same = [place[tuple(np.round(p, 6))] for p in quarter.points]
    assert a.displacement[:, same] == pytest.approx(b.displacement, abs=1e-6)
    assert a.strain_max == pytest.approx(b.strain_max, abs=1e-8)
    assert a.load == pytest.approx(PRESSURES)
    assert 4 * b.reactions["rim"][:, 2] == pytest.approx(a.reactions["rim"][:, 2], rel=1e-8)
    rim = whole.points[whole.node_sets["rim"]]
    x, y = rim[np.argsort(np.arctan2(rim[:, 1], rim[:, 0])), :2].T
    area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    assert a.reactions["rim"][:, 2] == pytest.approx(-a.load * area, rel=1e-8)
    assert np.abs(a.reactions["rim"][:, :2]).max() < 1e-6 * area * PRESSURES[-1]


def test_increments_converge_with_second_order():
    """The seven pressures as increments are within 0.002 % of many: the modulus is a mean."""

    def apex(steps):
        model = quarter_bubble(steps)
        node = model.mesh.node_sets["apex"][0]
        return MembraneSolver().run(model, LAW).displacement[:, node, 2]

    exact = apex(sorted({*PRESSURES, *np.arange(2e-3, 0.3, 2e-3)}))
    between = 0.5 * (PRESSURES + np.concatenate([[0.0], PRESSURES[:-1]]))
    seven, usual, halved = (
        np.abs(apex(steps) / exact - 1.0).max()
        for steps in ((), None, sorted({*PRESSURES, *between}))
    )
    assert seven < 2e-5 and usual < 2e-5
    assert np.log2(seven / halved) > 1.5


def test_newton_is_quadratic_near_the_answer():
    solver = MembraneSolver(1e-11)
    history = solver.run(quarter_bubble(), LAW)
    m, v, norms = solver._prepared[1], history.path[-1].copy(), []
    for _ in range(6):  # a little more pressure than the state that was accepted
        norms.append(m.unbalance(v, 1.02 * PRESSURES[-1], True))
        m.tangent.factor()
        v.reshape(-1)[m.free] -= m.tangent.solve(m.residual[m.free])
    norms = np.array([n for n in norms if n > 1e-13])
    orders = np.log(norms[2:] / norms[1:-1]) / np.log(norms[1:-1] / norms[:-2])
    assert orders.max() > 1.8


@BOTH
@pytest.mark.parametrize("pressure", [0.0, 0.3])
def test_kernel_tangent_against_differences_of_the_residual(thickness_change, pressure):
    """Large deformation, stress and strain history, follower pressure: all 3 n by 3 n entries."""
    points, quads = grid(2, 2, 8.0, 10.0, distort=0.2)
    m = membrane(points, quads, replace(LAW, thickness_change=thickness_change), [])
    random = np.random.default_rng(11)
    m.strain_old[:] = 0.02 * random.random(m.strain_old.shape)
    m.stress_old[:] = 5 + 5 * random.random(m.stress_old.shape)
    u = 0.06 * points + random.uniform(-0.15, 0.15, points.shape)
    u[:, 2] += 0.02 * points[:, 0] * (10.0 - points[:, 0])
    size = points.size
    dofs = (3 * quads[:, :, None] + np.arange(3)).reshape(len(quads), 12)
    slot = (size * dofs[:, :, None] + dofs[:, None, :]).reshape(len(quads), 144)
    m.tangent.slot, m.tangent.data = slot, np.zeros(size * size)
    assert np.isfinite(m.unbalance(u, pressure, True))
    tangent = m.tangent.data.reshape(size, size).copy()
    expected = np.empty((size, size))
    for j, shift in enumerate(1e-6 * np.eye(size)):
        m.unbalance(u + shift.reshape(-1, 3), pressure, False)
        ahead = m.residual.copy()
        m.unbalance(u - shift.reshape(-1, 3), pressure, False)
        expected[:, j] = (ahead - m.residual) / 2e-6
    assert np.abs(tangent - expected).max() < 1e-6 * np.abs(tangent).max()


@pytest.mark.parametrize(("limit", "kind"), [(10**9, BandedTangent), (0, SparseTangent)])
def test_tangents_assemble_and_solve_a_known_matrix(monkeypatch, limit, kind):
    points, quads = grid(3, 4, 3.0, 4.0)
    free = np.arange(6, points.size)
    random = np.random.default_rng(3)
    element = random.standard_normal((len(quads), 144)) + 40 * np.eye(12).ravel()
    dofs = (3 * quads[:, :, None] + np.arange(3)).reshape(len(quads), 12)
    rows, columns = np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel()
    whole = sp.csr_matrix((element.ravel(), (rows, columns)), shape=(points.size,) * 2)
    expected = np.linalg.solve(whole.toarray()[6:, 6:], rhs := random.standard_normal((54, 2)))
    monkeypatch.setattr(factorisation, "LARGEST_BAND", limit)
    tangent = tangent_for(quads, points.size, free)
    assert isinstance(tangent, kind)
    used = tangent.slot >= 0
    np.add.at(tangent.data, tangent.slot[used], element[used])
    tangent.factor()
    assert tangent.solve(rhs) == pytest.approx(expected, rel=1e-9)
    assert tangent.solve(rhs[:, 0]) == pytest.approx(expected[:, 0], rel=1e-9)
    if kind is SparseTangent:  # the symmetric part, looked at last, is near enough
        tangent.definite()
        near, before = tangent.near, tangent.lu
        left = rhs[:, 0] - tangent.times(tangent.step(rhs[:, 0], True)[:, None])[:, 0]
        assert np.linalg.norm(left) <= 1e-3 * np.linalg.norm(rhs[:, 0])
        assert tangent.lu is before and tangent.near is near is not before
    # Steps keep a factorisation only where it leads to the solution of the present matrix.
    for change, kept in ((1.0, kind is SparseTangent), (60.0, False)):
        before, known = tangent.lu, np.flatnonzero(tangent.data)
        tangent.data[known] += change * random.standard_normal(len(known))
        left = rhs[:, 0] - tangent.times(tangent.step(rhs[:, 0], True)[:, None])[:, 0]
        assert np.linalg.norm(left) <= 1e-3 * np.linalg.norm(rhs[:, 0])
        assert (tangent.lu is before) == kept


def test_guesses_and_tolerance_leave_the_result():
    model = quarter_bubble()
    cold = MembraneSolver(1e-11).run(model, LAW)
    other = LAW.with_beta(LAW.beta * 1.01)
    expected = MembraneSolver(1e-11).run(model, other)
    warm = MembraneSolver(1e-11).run(model, other, guess=cold.path)
    assert warm.displacement == pytest.approx(expected.displacement, abs=1e-7)
    assert warm.iterations < expected.iterations
    found = MembraneSolver(1e-15).run(model, LAW)
    assert found.displacement == pytest.approx(cold.displacement, abs=1e-8)
    assert found.iterations < 3 * cold.iterations


def test_bad_input():
    points, quads = grid(2, 2, 1.0, 1.0)
    points[4] = [2.0, 2.0, 0.0]
    assert "mend the mesh" in complaint(reference_elements, points, quads)
    mesh = disk_mesh(100.0, 48, "quarter")
    for field, *values in (
        *(("pressures", mesh, 1.0, p) for p in ([], [0, 0.1], [0.2, 0.1], [0.1, 0.1], [-0.1])),
        ("increments", mesh, 1.0, [0.1, 0.2], [0.05, 0.2]),
        ("thickness", mesh, 0.0, [0.1]),
    ):
        assert field in complaint(BubbleModel, *values)
    assert "thickness" in complaint(PatchModel, [[1.0, 1.0]], 0.0)
    check = solver_named("membrane").check()
    assert check.available and check.carries_law
    assert "membrane" in complaint(solver_named, "abacus")
    assert analysis_of({BubbleModel: 1, object: 2}, quarter_bubble(), "") == 1
    with pytest.raises(SolverFailure, match="membrane: cannot run a str, only: BubbleModel, "):
        MembraneSolver().run("a bubble", LAW)


LOADS = np.outer(np.linspace(2, 30, 8), [1.0, 0.5])


def test_the_corners_move_as_the_law_says_and_so_do_their_derivatives():
    names, model = ("beta_7", "beta_11", "nu12"), PatchModel(LOADS, 0.8)
    history, slope = MembraneSolver().run_with_sensitivity(model, BENT_LAW, names)
    wanted, u = biaxial_response(BENT_LAW, LOADS, 0.8, names), history.displacement
    np.testing.assert_allclose(elongations(u), wanted.elongation, rtol=1e-13)
    np.testing.assert_allclose(u[:, [1, 3], [0, 1]], SIDE * wanted.elongation)
    assert (u[:, 0] == 0).all() and (u[..., 2] == 0).all()
    step = 1e-3 * np.eye(12)[7]
    ahead, behind = (
        elongations(MembraneSolver().run(model, BENT_LAW.with_beta(BENT_LAW.beta + s)).displacement)
        for s in (step, -step)
    )
    by_e2 = (ahead - behind) / 2e-3
    np.testing.assert_allclose(elongations(slope)[..., 0], by_e2, atol=1e-7 * np.abs(by_e2).max())
    assert slope.shape == (8, 4, 3, 3)
    np.testing.assert_allclose(history.strain_max[:2], wanted.strain.max(axis=0))
    np.testing.assert_allclose(history.strain_min[:2], wanted.strain.min(axis=0))
    assert history.unstable == () and history.strain_max[2] == 0
    np.testing.assert_allclose(history.load, LOADS.sum(axis=1))


def test_progress_failure_and_stability_of_a_patch():
    solver, told = MembraneSolver(), []
    solver.progress = lambda done: told.append(done.time)
    solver.run(straight_strip("warp", 20.0, 22.0, 0.81, increments=3), LAW)
    solver.run(PatchModel(LOADS, 0.8), BENT_LAW)
    assert told == [1.0, 2.0, 3.0, 8.0]
    stress = biaxial_response(BENT_LAW, LOADS, 0.8).stress[-1]
    np.testing.assert_allclose(solver.stress[0, 0], [*stress, 0.0])
    falling = HypoelasticLaw([0, 0, 0, 30, 0, 0, -8e3, 600, 0, 0, -8e3, 600], 0.2, [0.08] * 3)
    loads = np.outer(np.linspace(2, 60, 30), [1.0, 1.0])
    with pytest.raises(SolverFailure, match=r"no equilibrium at \d+ and \d+ N/mm.*load \d+ of 30"):
        MembraneSolver().run(PatchModel(loads, 0.8), falling)
    law = HypoelasticLaw.linear(100.0, 100.0, 5.0, 0.6)
    history = MembraneSolver().run(PatchModel([[10.0, 10.0], [100.0, 100.0]], 0.8), law)
    assert history.unstable == ("100 and 100 N/mm",)


def test_extrapolation():
    x = np.array([0.0, 1.0, 2.5, 4.0])
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.3])
    known = cubic(x)[:, None, None] * np.ones((4, 2, 3))
    np.testing.assert_allclose(extrapolation.lagrange(x, known, 5.0), cubic(5.0), rtol=1e-12)
    path = [np.full((1, 3), 2.0), np.full((1, 3), 3.0)]
    np.testing.assert_allclose(extrapolation.straight_on([1.0, 3.0], path, 4.0), 3.5)
    assert extrapolation.straight_on([1.0], path[:1], 4.0) is path[0]


def test_a_folded_sheet_on_which_newton_wanders_is_left_soon():
    """Its residual stays thousands of times the pressure's force: 40 iterations find nothing."""
    x, y = (CASE_MODEL.mesh.points[:, k] / np.abs(CASE_MODEL.mesh.points).max() for k in range(2))
    inside = 1 - x**2 - y**2
    folds = 6.0 * np.sin(7 * x) * np.cos(6 * y) * inside
    points = np.column_stack([CASE_MODEL.mesh.points[:, :2], folds])
    model = replace(CASE_MODEL, mesh=replace(CASE_MODEL.mesh, points=points))
    soft = HypoelasticLaw.linear(500.0, 300.0, 10.0)
    membrane = MembraneSolver()._membrane(model, soft)
    dome = np.zeros_like(points)
    dome[:, 2] = 10.0 * inside
    assert membrane.equilibrium(dome, 0.0005) is None
    settings = membrane.newton
    assert settings.wandering_after < membrane.iterations < 25 < settings.max_iterations
    history = MembraneSolver().run(
        replace(model, pressures=(0.02,), increments=(0.02,)), soft
    )  # by other ways
    assert history.displacement[0, :, 2].max() > 5.0
