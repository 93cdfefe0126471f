"""Converge the membrane solver as a deck's control block asks: by residual and displacement."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from bubblefit.solvers.membrane import closed, newton
from bubblefit.solvers.membrane.factorisation import SingularTangent
from bubblefit.solvers.membrane.newton import Membrane

from .deck import Array, Content, Control, DeckError

#: displacement (n, 3) mm, unbalance (n, 3) N: what supports take; contact (n, 3) N, or 0.
State = namedtuple("State", "displacement unbalance contact")


def control_of(content: Content) -> Control:
    """Return what all load cases ask for; DeckError where they differ, which Marc would run."""
    first, *others = [case.control for case in content.cases]
    if any(other != first for other in others):
        raise DeckError("stand-in: one control for all load cases")
    return first


@contextmanager
def converging(control: Control, found: Callable[[State], None] | None = None) -> Iterator[None]:
    """Within, converge every equilibrium of the membrane solver as `control` asks, no better.

    The largest residual force is at most `residual` times the largest reaction, and the largest
    correction of the last iteration at most `correction` times the largest displacement of the
    increment so far. No increment goes without an iteration, and none has chord steps.

    found : is called with every increment but those that the solver adds to pass a snap.
    """
    unbalance, accept, plain = Membrane.unbalance, Membrane.accept, Membrane.equilibrium
    searched, chords = closed.searched_equilibrium, newton.CHORD_BELOW

    def measured(self: Any, u: Array, pressure: float, with_tangent: bool) -> float:
        ratio = unbalance(self, u, pressure, with_tangent)
        if not hasattr(self, "increment_start"):
            # A membrane without stress begins at rest; one with stress where another one ended.
            self.increment_start = u.copy() if self.strain_old.any() else np.zeros_like(u)
        self.evaluated = u.copy()
        force = np.abs(self.residual)
        reaction = float(np.delete(force, self.free).max(initial=0.0))
        if ratio == np.inf or not reaction > 0:
            return ratio
        return float(force[self.free].max()) / reaction

    def accepted(self: Any) -> None:
        accept(self)
        self.increment_start = self.evaluated
        bodies = getattr(self, "bodies", ())
        if found is None or (getattr(self, "gas", None) is not None and not bodies):
            return
        # Residuals hold the push of the bodies as well, with its sign changed: gone from there.
        residual = self.residual.reshape(self.reference.shape).copy()
        found(State(self.evaluated, residual, sum(self.contact) if bodies else 0.0))

    def full(original: Any) -> Any:
        def equilibrium(self: Any, u: Array, pressure: float) -> Array | None:
            self.tolerance = control.residual
            tangent, last = self.tangent, [np.inf]
            solve = tangent.solve

            def solved(rhs: Array) -> Array:
                answer = solve(rhs)
                last[0] = float(np.abs(answer).max())
                return answer

            tangent.solve = solved
            try:
                end = original(self, u, pressure)
            finally:
                del tangent.solve
            return None if end is None else _corrected(self, end, pressure, last[0], control)

        return equilibrium

    patched: Any = Membrane
    patched.unbalance, patched.accept, patched.equilibrium = measured, accepted, full(plain)
    closed.searched_equilibrium, newton.CHORD_BELOW = full(searched), 0.0
    try:
        yield
    finally:
        patched.unbalance, patched.accept, patched.equilibrium = unbalance, accept, plain
        closed.searched_equilibrium, newton.CHORD_BELOW = searched, chords


def _corrected(membrane: Any, u: Array, pressure: float, last: float, control: Any) -> Any:
    """Iterate from u (n, 3), whose residual is small, until the `last` correction (mm) is, too."""
    u, before = u.copy(), np.inf
    for _ in range(control.iterations):
        norm = membrane.unbalance(u, pressure, with_tangent=True)
        # A residual that is small and falls no further is rounding.
        settled = norm <= control.residual or 0.5 * before < norm < newton.ROUNDING_BELOW
        increment = float(np.abs(u - membrane.increment_start).max())
        if settled and last <= control.correction * increment:
            return u
        try:
            membrane.tangent.factor()
        except SingularTangent:
            return None
        step = -membrane.tangent.solve(membrane.residual[membrane.free])
        u.reshape(-1)[membrane.free] += step
        last, before = float(np.abs(step).max()), norm
        if not np.isfinite(last):
            return None
    return None
