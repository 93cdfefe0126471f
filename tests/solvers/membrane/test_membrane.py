"""The membrane: kernel, equilibrium, failure, single elements, marching."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.responses import biaxial_response
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.strip_models import SIDE, PatchModel, elongations, straight_strip
from bubblefit.solvers.base import analysis_of
from bubblefit.solvers.membrane import factorisation
from bubblefit.solvers.membrane.factorisation import BandedTangent, SparseTangent, tangent_for
from bubblefit.solvers.membrane.kernel import reference_elements
from bubblefit.solvers.membrane.newton import (
    Asked,
    Loading,
    Membrane,
    NoEquilibrium,
    lagrange,
    march,
)
from bubblefit.solvers.membrane.newton import straight_on as line
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import solver_named

from ...biaxial_files import BENT
from ...complaints import complaint, complaint_with
from ...published_laws import TABLE_4_2

# --- membrane ---
LAW = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.13, 0.13, 0.13])
PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])
E1, E2, G12, NU, THICKNESS = 300.0, 220.0, 5.0, 0.24, 0.81
BOTH = pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])


def grid(across, along, width, length, distort=0.0):
    """Points (n, 3) and quads of a rectangle; inside nodes moved by `distort` of a cell."""
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


def rotation(seed=4):
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    return turn * np.sign(np.linalg.det(turn))


def quarter_bubble(elements=192, law_steps=None):
    mesh = disk_mesh(100.0, elements, "quarter")
    steps = default_increments(PRESSURES) if law_steps is None else law_steps
    return BubbleModel(mesh, THICKNESS, PRESSURES, steps)


def inflated(model, law=LAW):
    """A membrane that holds the stress of the last but one increment, and the last path point."""
    solver = MembraneSolver(1e-11)
    history = solver.run(model, law)
    m = solver._prepared[1]
    return m, history.path[-1]


# Bar and patch
@BOTH
@pytest.mark.parametrize("distort", [0.0, 0.3])
@pytest.mark.parametrize("direction", ["warp", "fill"])
def test_uniaxial_bar(thickness_change, distort, direction):
    """Stress E log(l/L); the width follows nu; the force is stress times the current section."""
    length, width, steps, end = 40.0, 10.0, 4, 6.0
    points, quads = grid(3, 6, width, length, distort)
    if direction == "fill":  # the same bar, standing
        points = points @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        points[:, 0] -= points[:, 0].min()
    axis = 0 if direction == "warp" else 1
    law = HypoelasticLaw.linear(E1, E2, G12, NU, thickness_change)
    near = np.flatnonzero(points[:, axis] < 1e-9)
    far = np.flatnonzero(points[:, axis] > length - 1e-9)
    edge = np.flatnonzero(points[:, 1 - axis] < 1e-9)
    along = np.concatenate([3 * near + axis, 3 * far + axis])
    held = np.concatenate([along, 3 * edge + 1 - axis, 3 * np.arange(len(points)) + 2])
    bar = membrane(points, quads, law, held)
    u = np.zeros_like(points)
    for _ in range(steps):
        u[:, axis] += end / steps * points[:, axis] / length
        u = bar.equilibrium(u, 0.0)
        assert u is not None
        bar.accept()
    strain = np.log1p(end / length)
    modulus, ratio = (E1, NU) if direction == "warp" else (E2, NU * E2 / E1)
    stress = np.zeros(3)
    stress[axis] = modulus * strain
    assert bar.stress_old == pytest.approx(np.broadcast_to(stress, bar.stress_old.shape), abs=1e-8)
    assert bar.strain_old[..., 1 - axis] == pytest.approx(-ratio * strain, abs=1e-10)
    stretch, side = np.exp(strain), np.exp(-ratio * strain)
    thin = 1.0 if thickness_change == "constant" else 1.0 / (stretch * side)
    force = modulus * strain * THICKNESS * thin * width * side
    forces = bar.residual.reshape(-1, 3)
    assert forces[far, axis].sum() == pytest.approx(force, rel=1e-9)
    assert forces[near, axis].sum() == pytest.approx(-force, rel=1e-9)


def test_bar_with_a_linear_modulus_is_exact_in_any_number_of_steps():
    beta = np.zeros(12)
    beta[[3, 7, 10, 11]] = G12, E2, 900.0, E1
    points, quads = grid(2, 4, 10.0, 40.0)
    left, right = np.flatnonzero(points[:, 0] == 0), np.flatnonzero(points[:, 0] == 40.0)
    edge = np.flatnonzero(points[:, 1] == 0)
    held = [*(3 * left), *(3 * right), *(3 * edge + 1), *(3 * np.arange(len(points)) + 2)]
    for steps in (1, 5):
        bar = membrane(points, quads, HypoelasticLaw(beta, NU), held)
        u = np.zeros_like(points)
        for k in range(1, steps + 1):
            # Equal parts of log strain or not: the midpoint of a linear function is its mean.
            u[right, 0] = 5.0 * k / steps
            u = bar.equilibrium(u, 0.0)
            bar.accept()
        strain = np.log1p(5.0 / 40.0)
        assert bar.stress_old[..., 0] == pytest.approx(E1 * strain + 450.0 * strain**2, rel=1e-9)


@BOTH
def test_patch_of_distorted_elements(thickness_change):
    """Rim displaced by one deformation gradient, in a turned plane: the inside must follow it."""
    points, quads = grid(4, 4, 10.0, 12.0, distort=0.3)
    law = replace(LAW, thickness_change=thickness_change)
    stretch = np.array([[1.06, 0.02, 0.0], [0.02, 1.04, 0.0], [0.0, 0.0, 1.0]])
    gradient = rotation() @ stretch
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    rim = np.flatnonzero(((points[:, :2] == low) | (points[:, :2] == high)).any(axis=1))
    assert 0 < len(rim) < len(points)
    patch = membrane(points, quads, law, (3 * rim[:, None] + np.arange(3)).ravel())
    exact = points @ gradient.T - points
    start = exact.copy()
    inside = np.setdiff1d(np.arange(len(points)), rim)
    start[inside] += np.random.default_rng(0).uniform(-0.2, 0.2, (len(inside), 3))
    found = patch.equilibrium(start, 0.0)
    assert found is not None
    assert found == pytest.approx(exact, abs=1e-8)
    stress = patch.stress_new.reshape(-1, 3)
    assert stress == pytest.approx(np.broadcast_to(stress[0], stress.shape), abs=1e-8)


# Rotation and equilibrium
@BOTH
def test_rigid_rotation_turns_every_force_and_nothing_else(thickness_change):
    law = replace(LAW, thickness_change=thickness_change)
    m, u = inflated(quarter_bubble(), law)
    random = np.random.default_rng(8).uniform(-0.3, 0.3, u.shape)  # out of balance, too
    position, turn, pressure = m.reference + u + random, rotation(), PRESSURES[-1]
    m.unbalance(position - m.reference, pressure, False)
    forces, strain, stress = m.residual.copy(), m.strain_new.copy(), m.stress_new.copy()
    m.unbalance(position @ turn.T + [3.0, -2.0, 7.0] - m.reference, pressure, False)
    turned = forces.reshape(-1, 3) @ turn.T
    assert m.residual.reshape(-1, 3) == pytest.approx(turned, abs=1e-10 * np.abs(forces).max())
    assert m.strain_new == pytest.approx(strain, abs=1e-12)
    assert m.stress_new == pytest.approx(stress, abs=1e-9)


def polygon_area(points):
    order = np.argsort(np.arctan2(points[:, 1], points[:, 0]))
    x, y = points[order, 0], points[order, 1]
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def test_reactions_balance_the_pressure_on_the_full_disk():
    """The rim is plane and fixed: the resultant is pressure times its polygon."""
    mesh = disk_mesh(100.0, 192, "full")
    model = BubbleModel(mesh, THICKNESS, PRESSURES, default_increments(PRESSURES))
    history = MembraneSolver(1e-10).run(model, LAW)
    area = polygon_area(mesh.points[mesh.node_sets["rim"]])
    reaction = history.reactions["rim"]
    assert reaction[:, 2] == pytest.approx(-history.load * area, rel=1e-8)
    assert np.abs(reaction[:, :2]).max() < 1e-6 * area * PRESSURES[-1]


def test_quarter_and_full_disk_agree():
    whole, quarter = (disk_mesh(100.0, 192, s) for s in ("full", "quarter"))
    steps = default_increments(PRESSURES)
    a, b = (MembraneSolver(1e-11).run(BubbleModel(m, THICKNESS, PRESSURES, steps), LAW)
            for m in (whole, quarter))  # fmt: skip
    place = {tuple(np.round(p, 6)): i for i, p in enumerate(whole.points)}
    same = [place[tuple(np.round(p, 6))] for p in quarter.points]
    assert a.displacement[:, same] == pytest.approx(b.displacement, abs=1e-6)
    assert a.strain_max == pytest.approx(b.strain_max, abs=1e-8)
    total = b.reactions["rim"][:, 2]
    assert 4 * total == pytest.approx(a.reactions["rim"][:, 2], rel=1e-8)


def test_the_bubble_grows_with_pressure_inside_its_rim():
    model = quarter_bubble(192)
    history = MembraneSolver().run(model, LAW)
    apex = history.displacement[:, model.mesh.node_sets["apex"][0], 2]
    assert (np.diff(apex) > 0).all()
    assert (history.strain_max > 0).all()
    assert history.load == pytest.approx(PRESSURES)
    assert (history.displacement[:, model.mesh.node_sets["rim"]] == 0).all()


def test_increments_converge_with_second_order():
    """The seven pressures as increments are within 0.002 % of many: the modulus is a mean."""
    seven = quarter_bubble(192, ())
    fine = quarter_bubble(192, sorted({*PRESSURES, *np.arange(2e-3, 0.3, 2e-3)}))
    apex = seven.mesh.node_sets["apex"][0]
    exact = MembraneSolver().run(fine, LAW).displacement[:, apex, 2]

    def error(model):
        return MembraneSolver().run(model, LAW).displacement[:, apex, 2] / exact - 1.0

    between = 0.5 * (PRESSURES + np.concatenate([[0.0], PRESSURES[:-1]]))
    assert np.abs(error(seven)).max() < 2e-5
    assert np.abs(error(quarter_bubble(192))).max() < 2e-5
    halved = error(quarter_bubble(192, sorted({*PRESSURES, *between})))
    assert np.log2(np.abs(error(seven)).max() / np.abs(halved).max()) > 1.5


# Tangent
@BOTH
@pytest.mark.parametrize("pressure", [0.0, 0.3])
def test_kernel_tangent_against_differences_of_the_residual(thickness_change, pressure):
    """Large deformation, stress and strain history, follower pressure: all 3 n by 3 n entries."""
    points, quads = grid(2, 2, 8.0, 10.0, distort=0.2)
    law = replace(LAW, thickness_change=thickness_change)
    m = membrane(points, quads, law, [])
    random = np.random.default_rng(11)
    m.strain_old[:] = 0.02 * random.random(m.strain_old.shape)
    m.stress_old[:] = 5 + 5 * random.random(m.stress_old.shape)
    u = 0.06 * points + random.uniform(-0.15, 0.15, points.shape)
    u[:, 2] += 0.02 * points[:, 0] * (10.0 - points[:, 0])
    size = points.size
    place = np.arange(size * size, dtype=np.int64).reshape(size, size)
    dofs = (3 * quads[:, :, None] + np.arange(3)).reshape(len(quads), 12)
    slot = place[dofs[:, :, None], dofs[:, None, :]].reshape(len(quads), 144)
    m.tangent.slot, m.tangent.data = slot, np.zeros(size * size)
    assert np.isfinite(m.unbalance(u, pressure, True))
    tangent = m.tangent.data.reshape(size, size).copy()
    step, expected = 1e-6, np.empty((size, size))
    for j in range(size):
        shift = np.zeros(size)
        shift[j] = step
        m.unbalance(u + shift.reshape(-1, 3), pressure, False)
        ahead = m.residual.copy()
        m.unbalance(u - shift.reshape(-1, 3), pressure, False)
        expected[:, j] = (ahead - m.residual) / (2 * step)
    assert np.abs(tangent - expected).max() < 1e-6 * np.abs(tangent).max()


def test_newton_is_quadratic_near_the_answer():
    m, u = inflated(quarter_bubble())
    # The state is accepted: a little more pressure, starting from it.
    norms, v = [], u.copy()
    for _ in range(6):
        norms.append(m.unbalance(v, 1.02 * PRESSURES[-1], True))
        m.tangent.factor()
        v.reshape(-1)[m.free] -= m.tangent.solve(m.residual[m.free])
    norms = np.array([n for n in norms if n > 1e-13])
    orders = np.log(norms[2:] / norms[1:-1]) / np.log(norms[1:-1] / norms[:-2])
    assert orders.max() > 1.8


def test_band_and_superlu_solve_the_same(monkeypatch):
    mesh = disk_mesh(100.0, 192, "quarter")
    model = BubbleModel(mesh, THICKNESS, PRESSURES)
    free = np.setdiff1d(np.arange(mesh.points.size), model.fixed)
    band = tangent_for(mesh.quads, mesh.points.size, free)
    assert isinstance(band, BandedTangent)
    by_band = MembraneSolver(1e-11).run(model, LAW)
    monkeypatch.setattr(factorisation, "LARGEST_BAND", 0)
    sparse = tangent_for(mesh.quads, mesh.points.size, free)
    assert isinstance(sparse, SparseTangent)
    by_superlu = MembraneSolver(1e-11).run(model, LAW)
    assert by_superlu.displacement == pytest.approx(by_band.displacement, abs=1e-7)


def test_tangents_assemble_and_solve_a_known_matrix(monkeypatch):
    points, quads = grid(3, 4, 3.0, 4.0)
    free = np.arange(6, points.size)
    random = np.random.default_rng(3)
    element = random.standard_normal((len(quads), 144)) + 40 * np.eye(12).ravel()
    dofs = (3 * quads[:, :, None] + np.arange(3)).reshape(len(quads), 12)
    rows, columns = np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel()
    whole = sp.csr_matrix((element.ravel(), (rows, columns)), shape=(points.size,) * 2)
    expected = np.linalg.solve(whole.toarray()[6:, 6:], rhs := random.standard_normal((54, 2)))
    for limit in (10**9, 0):
        monkeypatch.setattr(factorisation, "LARGEST_BAND", limit)
        tangent = tangent_for(quads, points.size, free)
        used = tangent.slot >= 0
        np.add.at(tangent.data, tangent.slot[used], element[used])
        tangent.factor()
        assert tangent.solve(rhs) == pytest.approx(expected, rel=1e-9)
        assert tangent.solve(rhs[:, 0]) == pytest.approx(expected[:, 0], rel=1e-9)


# Robustness
@pytest.mark.parametrize(("level", "refused"), [(3, 1), (3, 3), (3, 6), (0, 7)])
def test_cut_back_does_not_change_the_result(monkeypatch, level, refused):
    model = quarter_bubble(192, () if level else None)
    expected = MembraneSolver(1e-11).run(model, LAW)
    original, calls = Membrane.equilibrium, []

    def stubborn(self, u, pressure):
        calls.append(pressure)
        # One level is refused until the load step has been halved often enough.
        if pressure == model.increments[level] and calls.count(pressure) <= refused:
            return None
        return original(self, u, pressure)

    monkeypatch.setattr(Membrane, "equilibrium", stubborn)
    found = MembraneSolver(1e-11).run(model, LAW)
    assert calls.count(model.increments[level]) == refused + 1
    assert len(set(calls)) > len(model.increments)
    assert found.displacement == pytest.approx(expected.displacement, abs=1e-7)
    assert found.strain_max == pytest.approx(expected.strain_max, abs=1e-9)


@BOTH
def test_one_increment_to_full_pressure_equals_many(thickness_change):
    """With constant moduli the path does not matter, so one giant step must find the same."""
    law = HypoelasticLaw.linear(E1, E2, G12, NU, thickness_change)
    mesh = disk_mesh(100.0, 192, "quarter")
    once = MembraneSolver(1e-11).run(BubbleModel(mesh, THICKNESS, [0.3]), law)
    steps = np.linspace(0.01, 0.3, 30)
    often = MembraneSolver(1e-11).run(BubbleModel(mesh, THICKNESS, [0.3], steps), law)
    assert once.displacement == pytest.approx(often.displacement, abs=1e-7)


def test_guesses_tolerance_and_earlier_runs_leave_the_result():
    model = quarter_bubble()
    cold = MembraneSolver(1e-11).run(model, LAW)
    other = LAW.with_beta(LAW.beta * 1.01)
    expected = MembraneSolver(1e-11).run(model, other)
    warm = MembraneSolver(1e-11).run(model, other, guess=cold.path)
    assert warm.displacement == pytest.approx(expected.displacement, abs=1e-7)
    assert warm.iterations < expected.iterations
    model = quarter_bubble()
    expected = MembraneSolver(1e-11).run(model, LAW)
    guess = np.random.default_rng(0).uniform(-60, 60, expected.path.shape)
    guess[2] = np.nan
    found = MembraneSolver(1e-11).run(model, LAW, guess=guess)
    assert found.displacement == pytest.approx(expected.displacement, abs=1e-7)
    model = quarter_bubble()
    expected = MembraneSolver(1e-10).run(model, LAW)
    found = MembraneSolver(1e-15).run(model, LAW)
    assert found.displacement == pytest.approx(expected.displacement, abs=1e-8)
    assert found.iterations < 3 * expected.iterations
    model, solver = quarter_bubble(), MembraneSolver()
    first = solver.run(model, LAW)
    with pytest.raises(SolverFailure):
        solver.run(model, HypoelasticLaw.linear(E1, -E2, G12))
    assert (solver.run(model, LAW).path == first.path).all()


HOPELESS = {
    "negative warp modulus": HypoelasticLaw.linear(-E1, E2, G12),
    "negative shear modulus": HypoelasticLaw.linear(E1, E2, -G12),
    "no stiffness at all": HypoelasticLaw.linear(1e-9, 1e-9, 1e-9),
    "nu12 nu21 above one": HypoelasticLaw.linear(1.0, 500.0, G12, 0.4),
    "limit load far below": HypoelasticLaw.linear(0.5, 0.5, 0.2),
}


@pytest.mark.parametrize("law", HOPELESS.values(), ids=HOPELESS)
def test_hopeless_moduli_raise_solver_failure(law):
    with pytest.raises(SolverFailure, match="no equilibrium at"):
        MembraneSolver().run(quarter_bubble(), law)


def test_negative_moduli_and_pressure_offsets():
    beta = np.zeros(12)
    beta[[3, 7, 10, 11]] = G12, E2, -5000.0, E1
    with pytest.raises(SolverFailure, match="kPa"):
        MembraneSolver().run(quarter_bubble(), HypoelasticLaw(beta))
    with pytest.raises(InputError, match="expected positive"):
        quarter_bubble().with_parameters({"pressure_offset": -1.0})
    model = quarter_bubble()
    shifted = BubbleModel(
        model.mesh, THICKNESS, PRESSURES + 0.002, np.array(model.increments) + 0.002
    )
    a = MembraneSolver(1e-11).run(model.with_parameters({"pressure_offset": 0.002}), LAW)
    b = MembraneSolver(1e-11).run(shifted, LAW)
    assert a.displacement == pytest.approx(b.displacement, abs=1e-8)
    assert a.load == pytest.approx(b.load)


# Bad input
def test_bad_input():
    points, quads = grid(2, 2, 1.0, 1.0)
    points[4] = [2.0, 2.0, 0.0]
    with pytest.raises(InputError, match=r"element .*mend the mesh"):
        reference_elements(points, quads)
    mesh = disk_mesh(100.0, 48, "quarter")
    for pressures in ([], [0.0, 0.1], [0.2, 0.1], [0.1, 0.1], [-0.1]):
        assert "pressures" in complaint(BubbleModel, mesh, THICKNESS, pressures)
    assert "increments" in complaint(BubbleModel, mesh, THICKNESS, [0.1, 0.2], [0.05, 0.2])
    assert "rim" in complaint(BubbleModel, Mesh(mesh.points, mesh.quads, {}), THICKNESS, [0.1])
    assert "thickness" in complaint(BubbleModel, mesh, 0.0, [0.1])
    check = solver_named("membrane").check()
    assert check.available and check.carries_law
    assert "membrane" in complaint(solver_named, "abacus")


# --- patch ---
LOADS = np.outer(np.linspace(2, 30, 8), [1.0, 0.5])


def test_the_corners_move_as_the_law_says_and_so_do_their_derivatives():
    names = ("beta_7", "beta_11", "nu12")
    history, slope = MembraneSolver().run_with_sensitivity(PatchModel(LOADS, 0.8), BENT, names)
    wanted = biaxial_response(BENT, LOADS, 0.8, names)
    np.testing.assert_allclose(elongations(history.displacement), wanted.elongation, rtol=1e-13)
    np.testing.assert_allclose(history.displacement[:, 1, 0], SIDE * wanted.elongation[:, 0])
    np.testing.assert_allclose(history.displacement[:, 3, 1], SIDE * wanted.elongation[:, 1])
    assert (history.displacement[:, 0] == 0).all() and (history.displacement[..., 2] == 0).all()
    step = 1e-3 * np.eye(12)[7]
    laws = [BENT.with_beta(BENT.beta + step), BENT.with_beta(BENT.beta - step)]
    ends = [MembraneSolver().run(PatchModel(LOADS, 0.8), law).displacement for law in laws]
    ahead, behind = (elongations(end) for end in ends)
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
    solver.run(PatchModel(LOADS, 0.8), BENT)
    assert told == [8.0]
    stress = biaxial_response(BENT, LOADS, 0.8).stress[-1]
    np.testing.assert_allclose(solver.stress[0, 0], [*stress, 0.0])
    falling = HypoelasticLaw([0, 0, 0, 30, 0, 0, -8e3, 600, 0, 0, -8e3, 600], 0.2, [0.08] * 3)
    loads = np.outer(np.linspace(2, 60, 30), [1.0, 1.0])
    with pytest.raises(SolverFailure, match=r"no equilibrium at \d+ and \d+ N/mm.*load \d+ of 30"):
        MembraneSolver().run(PatchModel(loads, 0.8), falling)
    law = HypoelasticLaw.linear(100.0, 100.0, 5.0, 0.6)
    history = MembraneSolver().run(PatchModel([[10.0, 10.0], [100.0, 100.0]], 0.8), law)
    assert history.unstable == ("100 and 100 N/mm",)
    complaint_with(["loads", "(n, 2)", "(3,)"], PatchModel, [1.0, 2.0, 3.0], 0.8)
    complaint_with(["finite"], PatchModel, [[1.0, np.nan]], 0.8)
    complaint_with(["thickness", "> 0"], PatchModel, [[1.0, 1.0]], 0.0)


# --- march ---
MARCH_LAW = HypoelasticLaw.linear(300.0, 300.0, 100.0, 0.3)


class Ladder(Loading):
    """u = level, found only from a start nearer than `reach`; every look is noted."""

    most_cuts = 3

    def __init__(self, reach, top=np.inf):
        self.reach, self.top, self.looks = reach, top, []

    def equilibrium(self, start, level):
        self.looks.append((float(start[0, 0]), level))
        near = abs(float(start[0, 0]) - level) <= self.reach and level <= self.top
        return np.full((1, 3), level) if near else None

    def first(self, level):
        return self.reached(0.0, np.zeros((1, 3)), level, np.zeros((1, 3)), self.most_cuts)

    def ahead(self, levels, path, level):
        return path[-1]

    def onward(self, u, at, to, before):
        return u

    def problem(self, before, level, place):
        return f"nothing between {before:g} and {level:g}, {place}"


def ends(loading, levels, **options):
    return [float(u[0, 0]) for u in march(loading, levels, Asked(), **options)]


def test_levels_are_reached_directly_or_in_parts():
    ladder = Ladder(1.0)
    assert ends(ladder, [1.0, 2.0, 3.0]) == [1.0, 2.0, 3.0]
    assert ladder.looks == [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0)]
    # A march goes on from where another ended.
    ladder = Ladder(1.0)
    assert ends(ladder, [6.0], begun=(5.0, np.full((1, 3), 5.0))) == [6.0]
    assert ladder.looks == [(5.0, 6.0)]
    ladder = Ladder(1.0)
    assert ends(ladder, [1.0, 5.0]) == [1.0, 5.0]
    assert [level for _, level in ladder.looks] == [1.0, 5.0, 3.0, 2.0, 3.0, 5.0, 4.0, 5.0]
    assert ends(Ladder(0.125), [1.0]) == [1.0]  # eighths: three cuts
    with pytest.raises(NoEquilibrium, match="nothing between 0 and 1, increment 1 of 1"):
        ends(Ladder(0.1), [1.0])
    found = []
    with pytest.raises(SolverFailure, match="nothing between 2 and 3, increment 3 of 3"):
        for u in march(Ladder(1.0, top=2.0), [1.0, 2.0, 3.0], Asked()):
            found.append(float(u[0, 0]))
    assert found == [1.0, 2.0]
    ladder, guess = Ladder(1.0), np.array([1.0, 9.0])[:, None, None] * np.ones((2, 1, 3))
    found = [float(u[0, 0]) for u in march(ladder, [2.0, 3.0], Asked(guess=guess))]
    assert found == [2.0, 3.0]
    assert ladder.looks == [(1.0, 2.0), (9.0, 3.0), (2.0, 3.0)]


def test_extrapolation():
    x = np.array([0.0, 1.0, 2.5, 4.0])
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.3])
    known = cubic(x)[:, None, None] * np.ones((4, 2, 3))
    np.testing.assert_allclose(lagrange(x, known, 5.0), cubic(5.0), rtol=1e-12)
    path = [np.full((1, 3), 2.0), np.full((1, 3), 3.0)]
    np.testing.assert_allclose(line([1.0, 3.0], path, 4.0), 3.5)
    assert line([1.0], path[:1], 4.0) is path[0]


@pytest.mark.parametrize(
    "model",
    [
        BubbleModel(disk_mesh(90.0, 48, "quarter"), 0.81, (0.02, 0.05, 0.1)),
        straight_strip("warp", 20.0, 22.0, 0.81, increments=3),
    ],
    ids=["bubble", "strip"],
)
def test_the_embedded_solver_tells_its_increments(model):
    solver, told = MembraneSolver(), []
    solver.progress = told.append
    solver.run(model, MARCH_LAW)
    assert [one.time for one in told] == [1, 2, 3]


def test_a_model_that_is_not_in_the_table_is_refused():
    class Mine(BubbleModel):
        pass

    assert analysis_of({BubbleModel: 1, object: 2}, Mine(disk_mesh(9.0, 48), 1.0, (0.1,)), "") == 1
    with pytest.raises(SolverFailure, match="membrane: cannot run a str, only: BubbleModel, Uni"):
        MembraneSolver().run("a bubble", MARCH_LAW)
