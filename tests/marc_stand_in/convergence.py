"""When an increment has converged, as the deck's control block says it: residual and displacement.

The membrane solver's own iteration is told when to stop, and that it is a full one: no chord steps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from bubblefit.solvers.membrane import closed, newton
from bubblefit.solvers.membrane.factorisation import SingularTangent
from bubblefit.solvers.membrane.newton import Membrane
from numpy.typing import NDArray

from .content import Content, Control
from .fields import DeckError

Array = NDArray[np.float64]
Equilibrium = Callable[[Membrane, Array, float], Array | None]


def control_of(content: Content) -> Control:
    """What all load cases ask for.

    Raises
    ------
    DeckError : they do not ask for the same; Marc would run this, the stand-in cannot.
    """
    first, *others = [case.control for case in content.cases]
    if first is None or any(other != first for other in others):
        raise DeckError("stand-in: one control for all load cases")
    return first


@contextmanager
def converging(control: Control) -> Iterator[None]:
    """Within, every equilibrium of the membrane solver is converged as `control` says, no better.

    The largest residual force is at most `residual` times the largest reaction, and the largest
    correction of the last iteration at most `correction` times the largest displacement of the
    increment so far. No increment goes without an iteration.
    """
    unbalance, accept, plain = Membrane.unbalance, Membrane.accept, Membrane.equilibrium
    searched, chords = closed.searched_equilibrium, newton.CHORD_BELOW

    def measured(self: Membrane, u: Array, pressure: float, with_tangent: bool) -> float:
        ratio = unbalance(self, u, pressure, with_tangent)
        if not hasattr(self, "increment_start"):
            # A membrane without stress begins at rest; one with stress where another one ended.
            rests = not self.strain_old.any()
            self.increment_start = np.zeros_like(u) if rests else u.copy()  # type: ignore[attr-defined]
        self.evaluated = u.copy()  # type: ignore[attr-defined]
        force = np.abs(self.residual)
        reaction = float(np.delete(force, self.free).max(initial=0.0))
        if ratio == np.inf or not reaction > 0:
            return ratio
        return float(force[self.free].max()) / reaction

    def accepted(self: Membrane) -> None:
        accept(self)
        self.increment_start = self.evaluated  # type: ignore[attr-defined]

    def full(original: Equilibrium) -> Equilibrium:
        def equilibrium(self: Membrane, u: Array, pressure: float) -> Array | None:
            self.tolerance = control.residual
            with _corrections(self) as corrections:
                found = original(self, u, pressure)
            last = corrections[-1] if corrections else np.inf
            return None if found is None else _corrected(self, found, pressure, last, control)

        return equilibrium

    Membrane.unbalance, Membrane.accept = measured, accepted  # type: ignore[method-assign]
    Membrane.equilibrium = full(plain)  # type: ignore[method-assign]
    closed.searched_equilibrium = full(searched)  # type: ignore[assignment]
    newton.CHORD_BELOW = 0.0
    try:
        yield
    finally:
        Membrane.unbalance, Membrane.accept = unbalance, accept  # type: ignore[method-assign]
        Membrane.equilibrium = plain  # type: ignore[method-assign]
        closed.searched_equilibrium, newton.CHORD_BELOW = searched, chords


@contextmanager
def _corrections(membrane: Membrane) -> Iterator[list[float]]:
    """Largest entry (mm) of every solution for a correction, as they are found."""
    found: list[float] = []
    tangent: Any = membrane.tangent
    solve = tangent.solve

    def solved(rhs: Array) -> Array:
        answer = solve(rhs)
        found.append(float(np.abs(answer).max()))
        return answer

    tangent.solve = solved
    try:
        yield found
    finally:
        del tangent.solve


def _corrected(
    membrane: Membrane, u: Array, pressure: float, last: float, control: Control
) -> Array | None:
    """On from u (n, 3), whose residual is small, until the `last` correction (mm) is, too."""
    u, free, before = u.copy(), membrane.free, np.inf
    for _ in range(control.iterations):
        norm = membrane.unbalance(u, pressure, with_tangent=True)
        # A residual that is small and falls no further is rounding.
        settled = norm <= control.residual or 0.5 * before < norm < newton.ROUNDING_BELOW
        increment = float(np.abs(u - membrane.increment_start).max())  # type: ignore[attr-defined]
        if settled and last <= control.correction * increment:
            return u
        try:
            membrane.tangent.factor()
        except SingularTangent:
            return None
        step = -membrane.tangent.solve(membrane.residual[free])
        u.reshape(-1)[free] += step
        last, before = float(np.abs(step).max()), norm
        if not np.isfinite(last):
            return None
    return None
