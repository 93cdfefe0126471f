"""Flat sheets under loads in two directions."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.forms.ratio import LoadRatio
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh, disk_modes, doubly_symmetric, monomials
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...complaints import complaint

# --- sheet ---
PRESSURES = (0.022, 0.097, 0.186)
STEPS = default_increments(PRESSURES)
LAW = HypoelasticLaw.linear(500.0, 250.0, 12.0)
MESH = disk_mesh(100.0, 64)
RIM = MESH.node_sets["rim"]
FLAT = BubbleModel(MESH, 0.81, PRESSURES, STEPS, modes=disk_modes(MESH.points, 100.0, 6))


def run(model):
    return MembraneSolver(1e-10).run(model, LAW).displacement


def with_rim(model, motion):
    """The rim moves so from the first increment on."""
    return replace(model, rim_motion=np.repeat(motion[None], len(STEPS), axis=0))


def test_a_rim_that_moves_rigidly_takes_the_bubble_along():
    shift = np.array([0.5, -0.3, 2.0])
    moved = run(with_rim(FLAT, np.tile(shift, (len(RIM), 1))))
    np.testing.assert_allclose(moved, run(FLAT) + shift, atol=1e-6)
    # The pressure follows the surface, so that the whole state turns about the y axis.
    angle = np.radians(3.0)
    turn = np.array(
        [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    )
    moved = run(with_rim(FLAT, MESH.points[RIM] @ turn.T - MESH.points[RIM]))
    places = (MESH.points + run(FLAT)) @ turn.T
    np.testing.assert_allclose(MESH.points + moved, places, atol=1e-6)


def test_a_rim_goes_straight_and_keeps_symmetry():
    """Where it is at an increment does not depend on whether the analysis stopped on the way."""
    motion = np.linspace(0.2, 1.0, len(STEPS))[:, None, None] * MESH.points[RIM] * 0.01
    model = replace(FLAT, rim_motion=motion)
    held = model.held(0.5 * (STEPS[1] + STEPS[2])).reshape(-1, 3)
    np.testing.assert_allclose(held, 0.5 * (motion[1] + motion[2]))
    np.testing.assert_allclose(model.held(0.5 * STEPS[0]).reshape(-1, 3), 0.5 * motion[0])
    np.testing.assert_allclose(run(model)[-1][RIM], motion[-1], atol=1e-12)
    mesh = disk_mesh(100.0, 64, "quarter")
    model = BubbleModel(mesh, 0.81, PRESSURES, STEPS)
    rim = mesh.node_sets["rim"]
    model = replace(model, rim_motion=np.ones((len(STEPS), len(rim), 3)))
    u = run(model)
    on_line = np.intersect1d(rim, mesh.node_sets["symmetry_x"])
    assert (u[:, on_line, 0] == 0).all() and (u[:, on_line, 1] == 1).all()


def test_a_slack_sheet_is_a_larger_disk_pushed_together():
    """0.4 % longer along the warp: the same places as of an ellipse whose rim is moved inwards."""
    slack = np.array([0.004, 0.001, 0.0])
    larger = replace(MESH, points=MESH.points * (1 + slack))
    inwards = with_rim(replace(FLAT, mesh=larger), -slack * MESH.points[RIM])
    there = larger.points + run(inwards)
    slackened = replace(FLAT, slack=(0.004, 0.001))
    np.testing.assert_allclose(MESH.points + run(slackened), there, atol=1e-6)
    apex = MESH.node_sets["apex"][0]
    assert run(slackened)[0, apex, 2] > run(FLAT)[0, apex, 2] + 0.5


def test_parameters_and_modes_of_the_sheet():
    model = FLAT.with_parameters({"z0_1": 2.0, "z0_xy": -1.0, "slack_fill": 0.001})
    heights = 2.0 * FLAT.modes["z0_1"] - FLAT.modes["z0_xy"]
    np.testing.assert_allclose(model.mesh.points[:, 2], heights)
    again = model.with_parameters({"z0_1": 1.0, "slack_fill": 0.001, "pressure_offset": 0.002})
    np.testing.assert_allclose(again.mesh.points[:, 2], heights + FLAT.modes["z0_1"])
    assert again.slack == (0.0, 0.002)
    np.testing.assert_allclose(again.pressures, np.add(PRESSURES, 0.002))
    assert FLAT.with_parameters({"z0_1": 0.0}) is FLAT
    assert "z0_9" in complaint(FLAT.with_parameters, {"z0_9": 1.0})
    assert monomials(6) == [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]
    assert list(FLAT.modes) == ["z0_1", "z0_x", "z0_y", "z0_xx", "z0_xy", "z0_yy"]
    modes = disk_modes(np.array([[50.0, -20.0], [60.0, 80.0]]), 100.0, 6)
    np.testing.assert_allclose(modes["z0_xy"], [(1 - 0.29) * 0.5 * -0.2, 0.0], atol=1e-15)
    assert modes["z0_1"][0] == pytest.approx(0.71)
    assert doubly_symmetric(1) and not doubly_symmetric(2)


@pytest.mark.parametrize(
    ("bad", "problem"),
    [
        ({"slack": (-1.0, 0.0)}, "slack: expected shares above -1"),
        ({"modes": {"z0_1": np.zeros(3)}}, r"modes\.z0_1: expected one height a node"),
        ({"rim_motion": np.zeros((1, len(RIM), 3))}, "rim_motion: expected finite numbers"),
    ],
)
def test_bad_sheets(bad, problem):
    with pytest.raises(InputError, match=problem):
        replace(FLAT, **bad)


# --- load ratio sheets ---
RATIO_LAW = HypoelasticLaw([12.0, 240.0, 120.0, 600.0, -150.0], 0.24, form=LoadRatio())
LEVELS = (0.03, 0.1, 0.2)
BUBBLE = BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.81, LEVELS)
MODELS = {
    "bubble": BUBBLE,
    "warp": straight_strip("warp", 20.0, 20.8, 0.81, increments=4, across=2, along=3),
    "fill": straight_strip("fill", 20.0, 21.5, 0.81, increments=4, across=2, along=3),
    "bias": bias_strip(20.0, 21.0, 0.81, increments=4, across=4, along=12),
}
TIGHT = 1e-11


def change(law, name, by):
    if name == "nu12":
        return replace(law, nu12=law.nu12 + by)
    return law.with_beta(law.beta + by * np.eye(5)[int(name[-1])])


@pytest.mark.parametrize("part", MODELS)
def test_derivatives_through_the_history(part):
    model: Any = MODELS[part]
    names = [*(f"beta_{i}" for i in range(5)), "nu12"]
    history, slope = MembraneSolver(TIGHT).run_with_sensitivity(model, RATIO_LAW, names)
    for j, name in enumerate(names):
        step = 1e-5 if name == "nu12" else 1e-3  # a longer one reaches over kinks of the ratio
        ahead, behind = (
            MembraneSolver(TIGHT).run(model, change(RATIO_LAW, name, by)) for by in (step, -step)
        )
        moved = (ahead.displacement - behind.displacement) / (2 * step)
        room = 1e-6 * np.abs(moved).max() + 1e-13 / step
        np.testing.assert_allclose(slope[..., j], moved, atol=room)
        if history.load_slope is not None:
            pulled = (ahead.load - behind.load) / (2 * step)
            room = 1e-6 * np.abs(pulled).max() + 1e-11 / step
            np.testing.assert_allclose(history.load_slope[:, j], pulled, atol=room)


def test_a_bubble_hardly_depends_on_the_increments():
    """Three increments are within 2e-4 of the apex, and the error goes with their square."""
    ends = {}
    for parts in (1, 2, 16):
        share = np.arange(1, parts + 1) / parts
        steps = [a + (b - a) * share for a, b in zip((0.0, *LEVELS), LEVELS, strict=False)]
        model = replace(BUBBLE, increments=np.concatenate(steps))
        ends[parts] = MembraneSolver(1e-10).run(model, RATIO_LAW).displacement[-1]
    off = [np.abs(ends[n] - ends[16]).max() / ends[16].max() for n in (1, 2)]
    assert off[0] < 2e-4 and off[1] < 0.4 * off[0]


def test_newton_takes_no_more_iterations_than_with_constants():
    solvers = MembraneSolver(), MembraneSolver()
    flat = RATIO_LAW.with_beta([12.0, 240.0, 0.0, 600.0, 0.0])
    own, known = (s.run(BUBBLE, law) for s, law in zip(solvers, (RATIO_LAW, flat), strict=True))
    assert own.iterations <= known.iterations + 3


def test_a_strip_along_a_yarn_is_that_of_its_own_ratio():
    """In the middle of a strip the fill carries nothing: constants at 1:0, but for their nu."""
    gain = RATIO_LAW.coupling[1:]
    at = RATIO_LAW.beta[[3, 1]] + gain * (np.array([1.0, 0.0]) - np.sqrt(0.5))
    constant = HypoelasticLaw.linear(at[0], at[1], 12.0, 0.24)
    own, known = (
        MembraneSolver(TIGHT).run(MODELS["warp"], law).load for law in (RATIO_LAW, constant)
    )
    np.testing.assert_allclose(own, known, rtol=1e-9)
