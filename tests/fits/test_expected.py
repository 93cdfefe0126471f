"""What the bounds of a law let its moduli be at rest."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from bubblefit.inference.unknowns import LawBounds
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs.check import expected_of

LAW = HypoelasticLaw.linear(600.0, 120.0, 15.0)
LEAST = {"E1": 5.0, "E2": 6.0, "G12": 0.5}


def expected(bounds: LawBounds) -> dict[str, tuple[float, float]]:
    setup: Any = SimpleNamespace(bounds=bounds, law=LAW)
    return dict(expected_of(setup).moduli)


def test_of_bounded_moduli() -> None:
    ranges = {"E1": (20.0, 2000.0), "E2": (20.0, 1000.0), "G12": (0.5, 200.0)}
    assert expected(LawBounds.of_moduli(ranges)) == ranges


def test_of_bounded_coefficients() -> None:
    """Between the moduli that the ends of the box make at rest, but nowhere below the margin."""
    free = list(LAW.form.free)
    lower, upper = 0.5 * LAW.beta[free], 2.0 * LAW.beta[free]
    found = expected(LawBounds.of_entries(lower, upper, LEAST))
    for name, value in (("E1", 600.0), ("E2", 120.0), ("G12", 15.0)):
        np.testing.assert_allclose(found[name], (0.5 * value, 2.0 * value))
    soft = expected(LawBounds.of_entries(-upper, lower, LEAST))
    for name, value in (("E1", 600.0), ("E2", 120.0), ("G12", 15.0)):
        np.testing.assert_allclose(soft[name], (LEAST[name], 0.5 * value))
    none = expected(LawBounds.of_entries(-upper, -lower, LEAST))
    assert none == {name: (least, least) for name, least in LEAST.items()}
