"""solvers/membrane/closed.py: equilibrium of closed membranes with gas."""

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import ClosedGas
from bubblefit.runs.verification.thin_walls import ISOTROPIC
from bubblefit.runs.verification.thin_walls import tube_model as tube
from bubblefit.solvers.membrane.closed import ClosedMembrane
from bubblefit.solvers.membrane.relaxation import settled
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.laws import TABLE_4_2

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


def test_relaxation_rests_where_newton_does(monkeypatch):
    history, membrane = inflate(tube(8, 4, 100.0, [0.02, 0.05]), LAW)
    found = history.displacement[-1]
    pushed = found.copy()
    pushed.reshape(-1)[membrane.free] += np.random.default_rng(5).uniform(-2, 2, len(membrane.free))
    membrane.pressure = 0.05
    rest = settled(membrane, pushed)
    assert rest is not None
    assert rest == pytest.approx(found, abs=1e-6)
    assert membrane.viscosity == 0.0
    assert membrane.unbalance(rest, 0.05, with_tangent=False) < membrane.tolerance
    monkeypatch.setattr(ClosedMembrane, "equilibrium", lambda *_: None)
    assert settled(membrane, found) is None
    assert membrane.viscosity == 0.0
