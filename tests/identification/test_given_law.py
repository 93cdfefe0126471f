"""At a law that is given only the nuisance is fitted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from bubblefit.inference import search as room


def asked(nuisance: tuple[str, ...], differentiates: bool, first: Any = "first") -> list[Any]:
    """What is asked of a problem of two coefficients, and of the descent."""
    calls: list[Any] = []

    def evaluate(y: np.ndarray, jacobian: bool, **how: bool) -> Any:
        calls.append((jacobian, how))
        return first

    problem: Any = SimpleNamespace(
        unknowns=SimpleNamespace(
            nuisance=SimpleNamespace(all=nuisance), count=2 + len(nuisance), size=2
        ),
        differentiates=differentiates,
        evaluate=evaluate,
    )
    calls.append(room.evaluate_law(problem, np.zeros(2 + len(nuisance))))
    return calls


def test_only_what_is_no_law_is_fitted(monkeypatch) -> None:
    told: list[Any] = []

    def descend(problem: Any, first: Any, *limits: float, norms: bool, only: np.ndarray) -> Any:
        told.append((first, limits, norms, only.tolist()))
        return "best", None

    monkeypatch.setattr(room, "descend", descend)
    assert asked(("x", "y"), True) == [(True, {}), "best"]
    assert told == [("first", (room.TOLERANCE, room.MOST), True, [False, False, True, True])]
    assert asked(("x",), True, None) == [(True, {}), None]
    # Nothing but the law is unknown, or the solver cannot tell where to go: as it is, from rest.
    assert asked((), True) == [(False, {"warm": False}), "first"]
    assert asked(("x",), False) == [(False, {"warm": False}), "first"]
    assert len(told) == 1
