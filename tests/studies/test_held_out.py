"""What is said of a law beside its errors at a test that it was not fitted to."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs import validation as room
from bubblefit.solvers.base import History

LAW = replace(
    HypoelasticLaw.linear(350.0, 190.0, 60.0, 0.0), strain_range=np.array([0.1, 0.14, 0.1])
)


def history(warp: float, shear: float, unstable: tuple[str, ...] = ()) -> History:
    return History(
        np.ones(1), np.zeros((1, 1, 3)), np.array([0.0, 0.0, shear]), np.array([warp, 0.14, 0.0]),
        iterations=1, unstable=unstable,
    )  # fmt: skip


def notes(*histories: History) -> list[str]:
    names = ("one: warp", "one: fill")[: len(histories)]
    problem: Any = SimpleNamespace(comparisons=[SimpleNamespace(name=name) for name in names])
    point: Any = SimpleNamespace(histories=histories)
    return [note.about("one").line for note in room._notes(problem, point, LAW)]


def test_strains_beyond_the_law_and_unstable_equilibria_with_their_part() -> None:
    known = "up to which the law is known: modulus held there"
    beyond = f"warp strain 0.118 is beyond 0.100, {known}"
    shear = f"shear strain 0.250 is beyond 0.100, {known}"
    unstable = "unstable equilibrium at 2 mm: the model would not stay there"
    assert notes(history(0.1181, 0.0), history(0.05, -0.25, ("2 mm",))) == [
        f"one, one: warp: {beyond}", f"one, one: fill: {shear}", f"one, one: fill: {unstable}"
    ]  # fmt: skip
    # Of the only comparison nothing else could be meant.
    assert notes(history(0.1181, 0.0, ("2 mm",))) == [f"one: {beyond}", f"one: {unstable}"]
    assert notes(history(0.1, -0.1)) == []
