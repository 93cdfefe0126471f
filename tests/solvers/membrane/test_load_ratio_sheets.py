"""Bubbles and strips of a law that goes with the load ratio: derivatives, increments, kinks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bubblefit.materials.forms.ratio import LoadRatio
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver

LAW = HypoelasticLaw([12.0, 240.0, 120.0, 600.0, -150.0], 0.24, form=LoadRatio())
PRESSURES = (0.03, 0.1, 0.2)
BUBBLE = BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.81, PRESSURES)
MODELS = {
    "bubble": BUBBLE,
    "warp": straight_strip("warp", 20.0, 20.8, 0.81, increments=4, across=2, along=3),
    "fill": straight_strip("fill", 20.0, 21.5, 0.81, increments=4, across=2, along=3),
    "bias": bias_strip(20.0, 21.0, 0.81, increments=4, across=4, along=12),
}
TIGHT = 1e-11


def change(law: HypoelasticLaw, name: str, by: float) -> HypoelasticLaw:
    if name == "nu12":
        return replace(law, nu12=law.nu12 + by)
    return law.with_beta(law.beta + by * np.eye(5)[int(name[-1])])


@pytest.mark.parametrize("part", MODELS)
def test_derivatives_through_the_history(part: str) -> None:
    model: Any = MODELS[part]
    names = [*(f"beta_{i}" for i in range(5)), "nu12"]
    history, slope = MembraneSolver(TIGHT).run_with_sensitivity(model, LAW, names)
    for j, name in enumerate(names):
        step = 1e-5 if name == "nu12" else 1e-3  # a longer one reaches over kinks of the ratio
        ahead, behind = (
            MembraneSolver(TIGHT).run(model, change(LAW, name, by)) for by in (step, -step)
        )
        moved = (ahead.displacement - behind.displacement) / (2 * step)
        room = 1e-6 * np.abs(moved).max() + 1e-13 / step
        np.testing.assert_allclose(slope[..., j], moved, atol=room)
        if history.load_slope is not None:
            pulled = (ahead.load - behind.load) / (2 * step)
            room = 1e-6 * np.abs(pulled).max() + 1e-11 / step
            np.testing.assert_allclose(history.load_slope[:, j], pulled, atol=room)


def test_a_bubble_hardly_depends_on_the_increments() -> None:
    """Three increments are within 2e-4 of the apex, and the error goes with their square."""
    ends = {}
    for parts in (1, 2, 16):
        share = np.arange(1, parts + 1) / parts
        steps = [a + (b - a) * share for a, b in zip((0.0, *PRESSURES), PRESSURES, strict=False)]
        model = replace(BUBBLE, increments=np.concatenate(steps))
        ends[parts] = MembraneSolver(1e-10).run(model, LAW).displacement[-1]
    off = [np.abs(ends[n] - ends[16]).max() / ends[16].max() for n in (1, 2)]
    assert off[0] < 2e-4 and off[1] < 0.4 * off[0]


def test_newton_takes_no_more_iterations_than_with_constants() -> None:
    solvers = MembraneSolver(), MembraneSolver()
    flat = LAW.with_beta([12.0, 240.0, 0.0, 600.0, 0.0])
    own, known = (s.run(BUBBLE, law) for s, law in zip(solvers, (LAW, flat), strict=True))
    assert own.iterations <= known.iterations + 3


def test_a_strip_along_a_yarn_is_that_of_its_own_ratio() -> None:
    """In the middle of a strip the fill carries nothing: constants at 1:0, but for their nu."""
    gain = LAW.coupling[1:]
    at = LAW.beta[[3, 1]] + gain * (np.array([1.0, 0.0]) - np.sqrt(0.5))
    constant = HypoelasticLaw.linear(at[0], at[1], 12.0, 0.24)
    own, known = (MembraneSolver(TIGHT).run(MODELS["warp"], law).load for law in (LAW, constant))
    np.testing.assert_allclose(own, known, rtol=1e-9)
