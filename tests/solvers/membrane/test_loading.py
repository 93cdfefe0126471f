"""solvers/membrane/loading.py: rims that move, slack and raised sheets, starts from guesses."""

from dataclasses import replace

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh, disk_modes
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane import loading
from bubblefit.solvers.membrane.solver import MembraneSolver

PRESSURES = (0.022, 0.097, 0.186)
STEPS = default_increments(PRESSURES)
LAW = HypoelasticLaw.linear(500.0, 250.0, 12.0)
MESH = disk_mesh(100.0, 64)
RIM = MESH.node_sets["rim"]
FLAT = BubbleModel(MESH, 0.81, PRESSURES, STEPS, modes=disk_modes(MESH.points / 100.0, 6))


def displacements_of(model, rim=None):
    """Displacements; with `rim`, it moves so from the first increment on."""
    if rim is not None:
        model = replace(model, rim_motion=np.repeat(rim[None], len(STEPS), axis=0))
    return MembraneSolver(1e-10).run(model, LAW).displacement


def test_rim_that_moves_rigidly_moves_the_bubble():
    shift, still = np.array([0.5, -0.3, 2.0]), displacements_of(FLAT)
    moved = displacements_of(FLAT, np.tile(shift, (len(RIM), 1)))
    np.testing.assert_allclose(moved, still + shift, atol=1e-6)
    # The pressure follows the surface, so that the whole state turns about the y axis.
    c, s = np.cos(np.radians(3.0)), np.sin(np.radians(3.0))
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    moved = displacements_of(FLAT, MESH.points[RIM] @ turn.T - MESH.points[RIM])
    np.testing.assert_allclose(MESH.points + moved, (MESH.points + still) @ turn.T, atol=1e-6)


def test_rim_moves_in_proportion_and_keeps_symmetry():
    motion = np.linspace(0.2, 1.0, len(STEPS))[:, None, None] * MESH.points[RIM] * 0.01
    model = replace(FLAT, rim_motion=motion)
    held = model.prescribed(0.5 * (STEPS[1] + STEPS[2])).reshape(-1, 3)
    np.testing.assert_allclose(held, 0.5 * (motion[1] + motion[2]))
    np.testing.assert_allclose(model.prescribed(0.5 * STEPS[0]).reshape(-1, 3), 0.5 * motion[0])
    np.testing.assert_allclose(displacements_of(model)[-1][RIM], motion[-1], atol=1e-12)
    mesh = disk_mesh(100.0, 64, "quarter")
    model = BubbleModel(mesh, 0.81, PRESSURES, STEPS)
    rim = mesh.node_sets["rim"]
    model = replace(model, rim_motion=np.ones((len(STEPS), len(rim), 3)))
    u = displacements_of(model)
    on_line = np.intersect1d(rim, mesh.node_sets["symmetry_x"])
    assert (u[:, on_line, 0] == 0).all() and (u[:, on_line, 1] == 1).all()


def test_slack_sheet_is_a_larger_disk_pushed_together():
    """0.4 % longer along the warp: the same places as of an ellipse whose rim is moved inwards."""
    slack = np.array([0.004, 0.001, 0.0])
    larger = replace(MESH, points=MESH.points * (1 + slack))
    there = larger.points + displacements_of(replace(FLAT, mesh=larger), -slack * MESH.points[RIM])
    slackened = displacements_of(replace(FLAT, slack=(0.004, 0.001)))
    np.testing.assert_allclose(MESH.points + slackened, there, atol=1e-6)
    apex = MESH.node_sets["apex"][0]
    assert slackened[0, apex, 2] > displacements_of(FLAT)[0, apex, 2] + 0.5
    # The same as an even strain of the yarns.
    even = replace(FLAT, strain=np.broadcast_to(slack, MESH.points.shape))
    np.testing.assert_allclose(displacements_of(even), slackened, atol=1e-6)
    told = [replace(History(np.array(PRESSURES), slackened, *np.zeros((2, 3))), model=one)
            for one in (even, replace(FLAT, slack=(0.004, 0.001)))]  # fmt: skip
    for at in ("elements", "points"):
        np.testing.assert_allclose(told[0].strain(at), told[1].strain(at), atol=1e-9)


def test_initial_surface_is_a_metric_of_a_flat_sheet():
    """C = I + grad z grad z of a surface z, whose square root stretches the flat disk."""
    mesh = disk_mesh(100.0, 432)
    x, y = mesh.points[:, :2].T / 100
    dome, ridge = 1 - x**2 - y**2, 4.0 + 0.8 * np.sin(3 * x)
    by = [0.024 * np.cos(3 * x) * dome - 0.02 * x * ridge, -0.02 * y * ridge]
    slope = np.stack(by, axis=1)
    size = (slope**2).sum(axis=1)
    share = (np.sqrt(1 + size) - 1) / size
    strain = share[:, None] * np.stack([by[0] ** 2, by[1] ** 2, 2 * by[0] * by[1]], axis=1)
    flat = BubbleModel(mesh, 0.81, PRESSURES, STEPS)
    points = mesh.points + np.outer(dome * ridge, [0, 0, 1.0])
    raised_sheet = replace(flat, mesh=replace(mesh, points=points))
    there, taut = points + displacements_of(raised_sheet), mesh.points + displacements_of(flat)
    off = np.abs(mesh.points + displacements_of(replace(flat, strain=strain)) - there).max(
        axis=(1, 2)
    )
    assert (off < 0.02 * np.abs(taut - there).max(axis=(1, 2))).all()


def test_extrapolation_is_exact_for_polynomials():
    x = np.array([0.0, 1.0, 2.5, 4.0])
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.3])
    known = cubic(x)[:, None, None] * np.ones((4, 2, 3))
    np.testing.assert_allclose(loading.lagrange(x, known, 5.0), cubic(5.0), rtol=1e-12)
    path = [np.full((1, 3), 2.0), np.full((1, 3), 3.0)]
    np.testing.assert_allclose(loading.straight_on([1.0, 3.0], path, 4.0), 3.5)
    assert loading.straight_on([1.0], path[:1], 4.0) is path[0]


def test_first_level_is_reached_from_a_later_guess_with_what_guesses_lack_in_common():
    """All guesses lack 0.3, and only at the last level such a start leads to the equilibrium."""
    exact = {1.0: 1.0, 2.0: 4.0, 3.0: 9.0}
    tried = []

    class Near(loading.Loading):
        def equilibrium(self, start, level):
            tried.append(level)
            reach = 1.0 if level == 3.0 else 0.1
            solution = np.full((1, 3), exact[level])
            return solution if np.abs(start - solution).max() < reach else None

    guess = np.array(list(exact.values()))[:, None, None] - 0.3 * np.ones((3, 1, 3))
    request = loading.RunRequest(guess=guess)
    u = loading.equilibrium_at(Near(), list(exact), 0, -1, request, ([], []))
    assert u.tolist() == [[1.0] * 3]
    assert tried == [1.0, 2.0, 3.0, 2.0, 1.0]
