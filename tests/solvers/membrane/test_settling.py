"""Motion to rest: the same equilibrium without viscosity, and a beam bent beyond its limit load."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.solvers.membrane.bending import settled
from bubblefit.solvers.membrane.bubble import Walls
from bubblefit.solvers.membrane.closed import ClosedMembrane
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...solvers.membrane.test_inflated import LAW, run, tube


@pytest.fixture
def inflated() -> tuple[np.ndarray, ClosedMembrane]:
    """A tube at 50 kPa, and the membrane with the strain and stress of that increment."""
    history, membrane = run(tube(8, 4, 100.0, [0.02, 0.05]), LAW)
    return history.displacement[-1], membrane


def test_it_rests_where_newton_would(inflated: tuple[np.ndarray, ClosedMembrane]) -> None:
    found, membrane = inflated
    pushed = found.copy()
    pushed.reshape(-1)[membrane.free] += np.random.default_rng(5).uniform(-2, 2, len(membrane.free))
    membrane.pressure = 0.05
    rest = settled(membrane, pushed)
    assert rest is not None
    assert rest == pytest.approx(found, abs=1e-6)
    assert membrane.viscosity == 0.0
    assert membrane.unbalance(rest, 0.05, with_tangent=False) < membrane.tolerance


def test_nothing_is_said_to_rest_that_does_not(
    inflated: tuple[np.ndarray, ClosedMembrane], monkeypatch: pytest.MonkeyPatch
) -> None:
    found, membrane = inflated
    monkeypatch.setattr(ClosedMembrane, "equilibrium", lambda *_: None)
    assert settled(membrane, found) is None
    assert membrane.viscosity == 0.0


@pytest.mark.parametrize("wall", ["stiff", "tension field"])
def test_a_beam_goes_beyond_its_limit_load(wall: Walls) -> None:
    """The thesis' cylinder of 150 mm at 90 kPa, coarse: all frames there, the forces in balance."""
    model = inflated_cylinder(150.0, 0.09, 0.81, 40.0, deflections=np.arange(8.0, 201.0, 8.0))
    history = MembraneSolver(1e-8, wall=wall).run(model, LAW)
    assert len(history.load) == 1 + len(model.deflections)
    first, last = history.load[5] / 40.0, (history.load[-1] - history.load[-6]) / 40.0
    assert last < 0.1 * first
    total = history.reactions["collar"] + history.reactions["supports"]
    assert np.abs(total).max() < 1e-4 * history.load.max()
    assert history.wrinkled[-1] > history.wrinkled[0] + 0.02
    left = [r for r in history.remarks if "left to wrinkles" in r]
    assert bool(left) == (wall == "tension field")
