"""The march through levels: extrapolation, halving, where it gives up, what it tells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.base import analysis_of
from bubblefit.solvers.membrane.newton import Asked, Loading, NoEquilibrium, lagrange, march
from bubblefit.solvers.membrane.newton import straight_on as line
from bubblefit.solvers.membrane.solver import MembraneSolver

LAW = HypoelasticLaw.linear(300.0, 300.0, 100.0, 0.3)


class Ladder(Loading):
    """u = level, found only from a start nearer than `reach`; every look is noted."""

    most_cuts = 3

    def __init__(self, reach: float, top: float = np.inf) -> None:
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


def ends(loading: Loading, levels: Sequence[float], **options) -> list[float]:
    return [float(u[0, 0]) for u in march(loading, levels, Asked(), **options)]


def test_what_is_near_is_reached_directly() -> None:
    ladder = Ladder(1.0)
    assert ends(ladder, [1.0, 2.0, 3.0]) == [1.0, 2.0, 3.0]
    assert ladder.looks == [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0)]


def test_what_is_far_is_reached_in_halves_and_quarters() -> None:
    ladder = Ladder(1.0)
    assert ends(ladder, [1.0, 5.0]) == [1.0, 5.0]
    assert [level for _, level in ladder.looks] == [1.0, 5.0, 3.0, 2.0, 3.0, 5.0, 4.0, 5.0]
    assert ends(Ladder(0.125), [1.0]) == [1.0]  # eighths: three cuts
    with pytest.raises(NoEquilibrium, match="nothing between 0 and 1, increment 1 of 1"):
        ends(Ladder(0.1), [1.0])


def test_the_levels_before_the_last_one_are_not_lost() -> None:
    found = []
    with pytest.raises(SolverFailure, match="nothing between 2 and 3, increment 3 of 3"):
        for u in march(Ladder(1.0, top=2.0), [1.0, 2.0, 3.0], Asked()):
            found.append(float(u[0, 0]))
    assert found == [1.0, 2.0]


def test_a_march_goes_on_from_where_another_ended() -> None:
    ladder = Ladder(1.0)
    assert ends(ladder, [6.0], begun=(5.0, np.full((1, 3), 5.0))) == [6.0]
    assert ladder.looks == [(5.0, 6.0)]


def test_a_good_guess_is_taken_and_a_bad_one_costs_a_look() -> None:
    ladder, guess = Ladder(1.0), np.array([1.0, 9.0])[:, None, None] * np.ones((2, 1, 3))
    found = [float(u[0, 0]) for u in march(ladder, [2.0, 3.0], Asked(guess=guess))]
    assert found == [2.0, 3.0]
    assert ladder.looks == [(1.0, 2.0), (9.0, 3.0), (2.0, 3.0)]


def test_extrapolation() -> None:
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
def test_the_embedded_solver_tells_its_increments(model) -> None:
    solver, told = MembraneSolver(), []
    solver.progress = told.append
    solver.run(model, LAW)
    assert [one.time for one in told] == [1, 2, 3]


def test_a_model_that_is_not_in_the_table_is_refused() -> None:
    class Mine(BubbleModel):
        pass

    assert analysis_of({BubbleModel: 1, object: 2}, Mine(disk_mesh(9.0, 48), 1.0, (0.1,)), "") == 1
    with pytest.raises(SolverFailure, match="membrane: cannot run a str, only: BubbleModel, Uni"):
        MembraneSolver().run("a bubble", LAW)
