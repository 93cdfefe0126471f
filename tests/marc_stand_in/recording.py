"""Every increment as the membrane solver accepts it, while it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from bubblefit.solvers.membrane.newton import Membrane
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class State:
    """displacement (n, 3) mm, unbalance (n, 3) N: what supports take; contact (n, 3) N."""

    displacement: Array
    unbalance: Array
    contact: Array | None


@contextmanager
def recording(found: Callable[[State], None]) -> Iterator[None]:
    """Call `found` with every increment; those that the solver puts in to pass a snap left out."""
    unbalance, accept = Membrane.unbalance, Membrane.accept
    last: dict[str, Array] = {}

    def evaluated(self: Membrane, u: Array, pressure: float, with_tangent: bool) -> float:
        last["u"] = u.copy()
        return unbalance(self, u, pressure, with_tangent)

    def accepted(self: Membrane) -> None:
        accept(self)
        bodies = getattr(self, "bodies", ())
        if getattr(self, "gas", None) is not None and not bodies:
            return
        shape = self.reference.shape
        # Residuals hold the push of the bodies as well, with its sign changed: gone from there.
        contact = sum(self.contact) if bodies else None  # type: ignore[attr-defined]
        found(State(last["u"], self.residual.reshape(shape).copy(), contact))

    Membrane.unbalance, Membrane.accept = evaluated, accepted  # type: ignore[method-assign]
    try:
        yield
    finally:
        Membrane.unbalance, Membrane.accept = unbalance, accept  # type: ignore[method-assign]
