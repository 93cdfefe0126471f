"""solvers/membrane/newton.py: Newton's method at an equilibrium."""

from dataclasses import replace

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.laws import TABLE_4_2
from ...inference.cases import MODEL as CASE_MODEL
from .cases import quarter_bubble

LAW = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.13, 0.13, 0.13])
PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])


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


def test_folded_sheet_without_progress_is_left_early():
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
