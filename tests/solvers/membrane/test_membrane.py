"""The membrane solver: bar, patch, rotation, equilibrium, tangent, cut-back, failure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from bubblefit.errors import InputError, SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.solvers.membrane import factorisation
from bubblefit.solvers.membrane.factorisation import BandedTangent, SparseTangent, tangent_for
from bubblefit.solvers.membrane.kernel import reference_elements
from bubblefit.solvers.membrane.newton import Membrane
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import solver_named

from ...published_laws import TABLE_4_2

LAW = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.13, 0.13, 0.13])
PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])
E1, E2, G12, NU, THICKNESS = 300.0, 220.0, 5.0, 0.24, 0.81
BOTH = pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])


def grid(across: int, along: int, width: float, length: float, distort: float = 0.0):
    """Points (n, 3) and quads of a rectangle; inside nodes moved by `distort` of a cell."""
    x, y = np.meshgrid(np.linspace(0, length, along + 1), np.linspace(0, width, across + 1))
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    inside = (x > 0) & (x < length) & (y > 0) & (y < width)
    moves = np.random.default_rng(2).uniform(-distort, distort, (int(inside.sum()), 2))
    points[inside.ravel(), :2] += moves * [length / along, width / across]
    corner = (np.arange(across)[:, None] * (along + 1) + np.arange(along)).ravel()
    quads = np.stack([corner, corner + 1, corner + along + 2, corner + along + 1], axis=1)
    return points, quads


def membrane(points, quads, law, held, thickness=THICKNESS, tolerance=1e-11) -> Membrane:
    free = np.setdiff1d(np.arange(points.size), held)
    return Membrane(
        points, quads, reference_elements(points, quads), thickness, law, free,
        tangent_for(quads, points.size, free), tolerance, step_limit=0.1 * np.ptp(points),
    )  # fmt: skip


def rotation(seed: int = 4) -> np.ndarray:
    turn = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0]
    return turn * np.sign(np.linalg.det(turn))


def quarter_bubble(elements: int = 192, law_steps=None) -> BubbleModel:
    mesh = disk_mesh(100.0, elements, "quarter")
    steps = default_increments(PRESSURES) if law_steps is None else law_steps
    return BubbleModel(mesh, THICKNESS, PRESSURES, steps)


def inflated(model: BubbleModel, law: HypoelasticLaw = LAW) -> tuple[Membrane, np.ndarray]:
    """A membrane that holds the stress of the last but one increment, and the last path point."""
    solver = MembraneSolver(1e-11)
    history = solver.run(model, law)
    m = solver._prepared[1]
    return m, history.path[-1]


# Bar and patch


@BOTH
@pytest.mark.parametrize("distort", [0.0, 0.3])
@pytest.mark.parametrize("direction", ["warp", "fill"])
def test_uniaxial_bar(thickness_change: str, distort: float, direction: str) -> None:
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


def test_bar_with_a_linear_modulus_is_exact_in_any_number_of_steps() -> None:
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
def test_patch_of_distorted_elements(thickness_change: str) -> None:
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
def test_rigid_rotation_turns_every_force_and_nothing_else(thickness_change: str) -> None:
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


def polygon_area(points: np.ndarray) -> float:
    order = np.argsort(np.arctan2(points[:, 1], points[:, 0]))
    x, y = points[order, 0], points[order, 1]
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def test_reactions_balance_the_pressure_on_the_full_disk() -> None:
    """The rim is plane and fixed: the resultant is pressure times its polygon."""
    mesh = disk_mesh(100.0, 192, "full")
    model = BubbleModel(mesh, THICKNESS, PRESSURES, default_increments(PRESSURES))
    history = MembraneSolver(1e-10).run(model, LAW)
    area = polygon_area(mesh.points[mesh.node_sets["rim"]])
    reaction = history.reactions["rim"]
    assert reaction[:, 2] == pytest.approx(-history.load * area, rel=1e-8)
    assert np.abs(reaction[:, :2]).max() < 1e-6 * area * PRESSURES[-1]


def test_quarter_and_full_disk_agree() -> None:
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


def test_the_bubble_grows_with_pressure_inside_its_rim() -> None:
    model = quarter_bubble(192)
    history = MembraneSolver().run(model, LAW)
    apex = history.displacement[:, model.mesh.node_sets["apex"][0], 2]
    assert (np.diff(apex) > 0).all()
    assert (history.strain_max > 0).all()
    assert history.load == pytest.approx(PRESSURES)
    assert (history.displacement[:, model.mesh.node_sets["rim"]] == 0).all()


def test_increments_converge_with_second_order() -> None:
    """The seven pressures as increments are within 0.002 % of many: the modulus is a mean."""
    seven = quarter_bubble(192, ())
    fine = quarter_bubble(192, sorted({*PRESSURES, *np.arange(2e-3, 0.3, 2e-3)}))
    apex = seven.mesh.node_sets["apex"][0]
    exact = MembraneSolver().run(fine, LAW).displacement[:, apex, 2]

    def error(model: BubbleModel) -> np.ndarray:
        return MembraneSolver().run(model, LAW).displacement[:, apex, 2] / exact - 1.0

    between = 0.5 * (PRESSURES + np.concatenate([[0.0], PRESSURES[:-1]]))
    assert np.abs(error(seven)).max() < 2e-5
    assert np.abs(error(quarter_bubble(192))).max() < 2e-5
    halved = error(quarter_bubble(192, sorted({*PRESSURES, *between})))
    assert np.log2(np.abs(error(seven)).max() / np.abs(halved).max()) > 1.5


# Tangent


@BOTH
@pytest.mark.parametrize("pressure", [0.0, 0.3])
def test_kernel_tangent_against_differences_of_the_residual(
    thickness_change: str, pressure: float
) -> None:
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


def test_newton_is_quadratic_near_the_answer() -> None:
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


def test_band_and_superlu_solve_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_tangents_assemble_and_solve_a_known_matrix(monkeypatch: pytest.MonkeyPatch) -> None:
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


@pytest.mark.parametrize("refused", [1, 3, 6])
def test_cut_back_does_not_change_the_result(monkeypatch: pytest.MonkeyPatch, refused: int) -> None:
    """Equilibrium iterations that fail on purpose: found by halved load steps all the same."""
    model = quarter_bubble(192, ())
    expected = MembraneSolver(1e-11).run(model, LAW)
    original, calls = Membrane.equilibrium, []

    def stubborn(self: Membrane, u: np.ndarray, pressure: float) -> np.ndarray | None:
        calls.append(pressure)
        # The fourth level is refused until the load step has been halved often enough.
        if pressure == model.increments[3] and calls.count(pressure) <= refused:
            return None
        return original(self, u, pressure)

    monkeypatch.setattr(Membrane, "equilibrium", stubborn)
    found = MembraneSolver(1e-11).run(model, LAW)
    assert calls.count(model.increments[3]) == refused + 1
    assert len(set(calls)) > len(model.increments)
    assert found.displacement == pytest.approx(expected.displacement, abs=1e-7)
    assert found.strain_max == pytest.approx(expected.strain_max, abs=1e-9)


def test_the_first_increment_is_cut_back_too(monkeypatch: pytest.MonkeyPatch) -> None:
    model = quarter_bubble()
    expected = MembraneSolver(1e-11).run(model, LAW)
    original, first = Membrane.equilibrium, model.increments[0]
    refused = []

    def stubborn(self: Membrane, u: np.ndarray, pressure: float) -> np.ndarray | None:
        if pressure == first and len(refused) < 7:
            refused.append(pressure)
            return None
        return original(self, u, pressure)

    monkeypatch.setattr(Membrane, "equilibrium", stubborn)
    found = MembraneSolver(1e-11).run(model, LAW)
    assert len(refused) == 7
    assert found.displacement == pytest.approx(expected.displacement, abs=1e-7)


@BOTH
def test_one_increment_to_full_pressure_equals_many(thickness_change: str) -> None:
    """With constant moduli the path does not matter, so one giant step must find the same."""
    law = HypoelasticLaw.linear(E1, E2, G12, NU, thickness_change)
    mesh = disk_mesh(100.0, 192, "quarter")
    once = MembraneSolver(1e-11).run(BubbleModel(mesh, THICKNESS, [0.3]), law)
    steps = np.linspace(0.01, 0.3, 30)
    often = MembraneSolver(1e-11).run(BubbleModel(mesh, THICKNESS, [0.3], steps), law)
    assert once.displacement == pytest.approx(often.displacement, abs=1e-7)


def test_a_warm_start_finds_the_same_result() -> None:
    model = quarter_bubble()
    cold = MembraneSolver(1e-11).run(model, LAW)
    other = LAW.with_beta(LAW.beta * 1.01)
    expected = MembraneSolver(1e-11).run(model, other)
    warm = MembraneSolver(1e-11).run(model, other, guess=cold.path)
    assert warm.displacement == pytest.approx(expected.displacement, abs=1e-7)
    assert warm.iterations < expected.iterations


def test_a_useless_guess_is_survived() -> None:
    model = quarter_bubble()
    expected = MembraneSolver(1e-11).run(model, LAW)
    guess = np.random.default_rng(0).uniform(-60, 60, expected.path.shape)
    guess[2] = np.nan
    found = MembraneSolver(1e-11).run(model, LAW, guess=guess)
    assert found.displacement == pytest.approx(expected.displacement, abs=1e-7)


def test_a_tolerance_below_rounding_is_met_as_well_as_can_be() -> None:
    model = quarter_bubble()
    expected = MembraneSolver(1e-10).run(model, LAW)
    found = MembraneSolver(1e-15).run(model, LAW)
    assert found.displacement == pytest.approx(expected.displacement, abs=1e-8)
    assert found.iterations < 3 * expected.iterations


def test_runs_leave_nothing_behind() -> None:
    """The same solver object, used twice and after a failure, repeats itself to the last bit."""
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
def test_hopeless_moduli_raise_solver_failure(law: HypoelasticLaw) -> None:
    with pytest.raises(SolverFailure, match="no equilibrium at"):
        MembraneSolver().run(quarter_bubble(), law)


def test_a_modulus_that_turns_negative_on_the_way_fails_there() -> None:
    beta = np.zeros(12)
    beta[[3, 7, 10, 11]] = G12, E2, -5000.0, E1
    with pytest.raises(SolverFailure, match="kPa"):
        MembraneSolver().run(quarter_bubble(), HypoelasticLaw(beta))


def test_a_pressure_offset_below_the_first_pressure_fails() -> None:
    with pytest.raises(InputError, match="expected positive"):
        quarter_bubble().with_parameters({"pressure_offset": -1.0})


def test_a_pressure_offset_is_a_shift_of_every_load() -> None:
    model = quarter_bubble()
    shifted = BubbleModel(
        model.mesh, THICKNESS, PRESSURES + 0.002, np.array(model.increments) + 0.002
    )
    a = MembraneSolver(1e-11).run(model.with_parameters({"pressure_offset": 0.002}), LAW)
    b = MembraneSolver(1e-11).run(shifted, LAW)
    assert a.displacement == pytest.approx(b.displacement, abs=1e-8)
    assert a.load == pytest.approx(b.load)


# Bad input


def test_a_quad_inside_out_is_named() -> None:
    points, quads = grid(2, 2, 1.0, 1.0)
    points[4] = [2.0, 2.0, 0.0]
    with pytest.raises(InputError, match=r"element .*mend the mesh"):
        reference_elements(points, quads)


@pytest.mark.parametrize("pressures", [[], [0.0, 0.1], [0.2, 0.1], [0.1, 0.1], [-0.1]])
def test_pressures_must_increase(pressures: list[float]) -> None:
    with pytest.raises(InputError, match="pressures"):
        BubbleModel(disk_mesh(100.0, 48, "quarter"), THICKNESS, pressures)


def test_increments_must_contain_the_pressures() -> None:
    mesh = disk_mesh(100.0, 48, "quarter")
    with pytest.raises(InputError, match="increments"):
        BubbleModel(mesh, THICKNESS, [0.1, 0.2], [0.05, 0.2])
    with pytest.raises(InputError, match="rim"):
        BubbleModel(Mesh(mesh.points, mesh.quads, {}), THICKNESS, [0.1])
    with pytest.raises(InputError, match="thickness"):
        BubbleModel(mesh, 0.0, [0.1])


def test_solvers_by_name() -> None:
    check = solver_named("membrane").check()
    assert check.available and check.carries_law
    with pytest.raises(InputError, match="membrane"):
        solver_named("abacus")
