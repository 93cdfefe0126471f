"""solvers/membrane/closed.py: equilibrium of closed membranes with gas."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import ClosedGas
from bubblefit.runs.verification.thin_walls import ISOTROPIC, RADIUS
from bubblefit.runs.verification.thin_walls import tube_model as tube
from bubblefit.solvers.membrane import closed
from bubblefit.solvers.membrane.bending import RigidBodies
from bubblefit.solvers.membrane.closed import closed_cavity
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.membrane.wall import STIFF

from ...builders.laws import TABLE_4_2
from ...support.refusals import complaint
from .cases import square_beam

LAW = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.13, 0.13, 0.13])


def inflate(model, law=ISOTROPIC, tolerance=1e-09):
    solver = MembraneSolver(tolerance)
    return solver.run(model, law), solver._prepared[1]


def test_tangent_with_gas_against_finite_differences():
    """Stress, follower pressure and the rank-one term of the gas: J (K^-1 b) = b."""
    history, m = inflate(tube(8, 3, 60.0, [0.02, 0.05]), LAW)
    m.gas = ClosedGas(0.15 * m.volume, 0.101)
    rng = np.random.default_rng(5)
    u = history.displacement[-1].copy()
    u.reshape(-1)[m.free] += rng.uniform(-0.05, 0.05, len(m.free))
    m.unbalance(u, 0.0, with_tangent=True)
    m.tangent.factor()
    for _ in range(3):
        rhs, x, sides = rng.normal(size=len(m.free)), np.zeros(u.size), []
        x[m.free] = m.tangent.solve(rhs)
        step = 1e-4 / np.abs(x).max()
        for sign in (1, -1):
            m.unbalance(u + sign * step * x.reshape(-1, 3), 0.0, with_tangent=False)
            sides.append(m.residual[m.free].copy())
        assert (sides[0] - sides[1]) / (2 * step) == pytest.approx(rhs, abs=2e-6)


def test_pushed_membrane_rests_where_newton_does_if_viscosity_may_resist():
    history, membrane = inflate(tube(8, 4, 100.0, [0.02, 0.05]), LAW)
    found = history.displacement[-1]
    pushed = found.copy()
    pushed.reshape(-1)[membrane.free] += np.random.default_rng(5).uniform(-2, 2, len(membrane.free))
    rest = membrane.rest(pushed, 0.05)
    assert rest == pytest.approx(found, abs=1e-6)
    assert membrane.unbalance(rest, 0.05, with_tangent=True) < membrane.tolerance
    assert membrane.tangent.definite() and membrane.needed_viscosity > 0
    membrane.needed_viscosity = 1e9
    assert membrane.rest(pushed, 0.05) is None


def test_viscosity_resists_every_motion_by_the_area_of_its_node():
    history, m = inflate(tube(8, 4, 100.0, [0.02]), LAW)
    m.unbalance(history.displacement[-1], 0.02, with_tangent=True)
    motion = np.random.default_rng(5).uniform(-1, 1, (len(m.free), 1))
    before = m.tangent.times(motion)
    for viscosity in (7.0, 3.0, 0.0):
        m.resist(viscosity)
        pressure = viscosity * 0.02 / (2 * m.step_limit)
        resistance = pressure * np.repeat(m.node_area, 3)[m.free, None] * motion
        assert m.tangent.times(motion) - before == pytest.approx(resistance, abs=1e-12)
    m.resist(7.0)
    m.unbalance(history.displacement[-1], 0.02, with_tangent=True)
    assert m.resistance == 0.0
    assert m.tangent.times(motion) == pytest.approx(before, abs=1e-12)


def test_cavity_volume_of_a_box_and_of_a_slice():
    for caps, length in ((True, 60.0), (False, 40.0)):
        model = tube(8, 3, length, [0.01], caps=caps)
        mesh, fixed = model.mesh, model.fixed()
        cavity = closed_cavity(mesh.points, mesh.quads, fixed)
        volume = 0.5 * 8 * RADIUS**2 * np.sin(np.pi / 8) * length
        assert cavity.measure(mesh.points)[0] == pytest.approx(volume, rel=1e-12)
        rng, free = np.random.default_rng(1), np.setdiff1d(np.arange(mesh.points.size), fixed)
        bent = mesh.points.copy()
        bent.reshape(-1)[free] += rng.uniform(-3, 3, len(free))
        _, push = cavity.measure(bent)
        for dof in rng.choice(free, 12, replace=False):
            step = 1e-3 * (np.arange(bent.size) == dof).reshape(-1, 3)
            up, down = (cavity.measure(bent + s * step)[0] for s in (1, -1))
            assert push[dof] == pytest.approx((up - down) / 2e-3, rel=1e-7, abs=1e-6)
    assert cavity.symmetric.tolist() == [True, False, True]
    supports = {k: v for k, v in model.supports.items() if k != "end"}
    assert "the cavity is open between nodes" in complaint(
        inflate, replace(model, supports=supports)
    )


def test_step_into_contact_leaves_less_residual_or_the_tangent_as_it_was(monkeypatch):
    model = square_beam((2.0,))
    law = HypoelasticLaw.linear(5000.0, 4000.0, 200.0)
    u = MembraneSolver(1e-9).run(model, law).displacement[0]
    m = closed.closed_membrane(model, law, 1e-9, model.fixed(bent=True), STIFF)
    bodies = RigidBodies(m, model.bending, u)
    bodies.begin_bending(model.bending, u, model.pressures[-1])
    bodies.move(0.0)
    m.gas, pressure = None, 1.1 * model.pressures[-1]

    def newton_step():
        before = m.unbalance(u, pressure, with_tangent=True)
        m.tangent.factor()
        return before, -m.tangent.solve(m.residual[m.free])

    def left_after(step):
        end = u.copy()
        end.reshape(-1)[m.free] += step
        return m.unbalance(end, pressure, with_tangent=False)

    before, step = newton_step()
    corrected = m.step_into_contact(u, step)
    assert left_after(corrected) < 0.3 * before < 0.3 * left_after(step)
    _, step = newton_step()
    tangent = m.tangent.data.copy()
    monkeypatch.setattr(closed, "by_near_inverse", lambda *_, **__: None)
    assert m.step_into_contact(u, step) is step
    assert m.tangent.data == pytest.approx(tangent, abs=1e-9 * np.abs(tangent).max())
