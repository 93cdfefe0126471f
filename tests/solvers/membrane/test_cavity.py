"""solvers/membrane/closed.py: the enclosed volume."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.runs.verification.thin_walls import ISOTROPIC, RADIUS
from bubblefit.runs.verification.thin_walls import tube_model as tube
from bubblefit.solvers.membrane.closed import closed_cavity
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...support.refusals import complaint


def inflate(model, law=ISOTROPIC, tolerance=1e-09):
    solver = MembraneSolver(tolerance)
    return solver.run(model, law), solver._prepared[1]


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
