"""Newton's iteration with backtracking and chord steps, for smooth equations."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .factorisation import SingularTangent, Tangent

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NewtonSettings:
    """Settings of Newton's iteration. Residuals are relative: force over the largest load."""

    max_iterations: int = 40
    max_backtracks: int = 8
    backtrack: float = 0.35  #: factor of a step that made the residual larger
    #: Below this residual, a step that shrank the residual to this share is followed by a chord
    #: step (no new tangent): it costs a quarter of a Newton step and still gains one to two digits.
    chord_below: float = 1e-2
    chord_gain: float = 0.15
    #: Below this residual, so many steps that gain no digits are rounding (fine meshes at low
    #: pressure), unless the residual falls from step to step (a tangent that is nearly singular).
    rounding_below: float = 1e-6
    max_idle: int = 3
    #: A slack sheet at low pressure can wander among folds without end: after so many iterations a
    #: residual beyond this, and so many times the first one, has not been seen to come back.
    wandering_after: int = 12
    wandering_residual: float = 1e3
    wandering_growth: float = 5.0
    #: Where a modulus jumps full steps go to and fro: after so many, every step has to gain.
    max_fruitless: int = 3
    #: A residual that is larger than so many times the last one, plus this, is worse.
    worse_growth: float = 20.0
    worse_residual: float = 1e-3


class Equations(Protocol):
    """Equations of equilibrium: a residual and its tangent.

    Attributes
    ----------
    free : (f,) ndarray of int
        Numbers of the unknowns, 3 * node + direction.
    tangent : Tangent
        Of the free unknowns.
    residual : (3 n,) ndarray, N
        Internal less external forces at the last evaluation.
    tolerance : float
        Relative residual that is equilibrium.
    step_limit : float, mm
        Largest correction of one iteration.
    keep_tangent : bool
        Whether every iteration ends with its tangent assembled.
    """

    free: NDArray[np.intp]
    tangent: Tangent
    residual: Array
    tolerance: float
    step_limit: float
    keep_tangent: bool

    def unbalance(self, u: Array, pressure: float, with_tangent: bool) -> float:
        """Evaluate at a displacement; return the relative residual, inf without stress."""


class NewtonIteration:
    """An iteration from a start u (n, 3) mm at a pressure (MPa).

    has_jumps : whether a modulus jumps somewhere.
    """

    def __init__(
        self,
        equations: Equations,
        start: Array,
        pressure: float,
        settings: NewtonSettings,
        has_jumps: bool,
    ) -> None:
        self.equations = equations
        self.pressure = pressure
        self.settings = settings
        self.has_jumps = has_jumps
        self.u = start.copy()
        self.unknowns = self.u.reshape(-1)
        self.step = np.empty(0)
        self.step_start = np.empty(0)
        self.scale = 1.0
        self.backtracks = 0
        self.is_chord = False
        self.last_norm = np.inf
        self.smallest_norm = np.inf
        self.idle = 0
        self.fruitless = 0

    def run(self) -> Array | None:
        """Return the displacement (n, 3) in equilibrium, or None."""
        equations = self.equations
        first_norm = np.inf
        for k in range(self.settings.max_iterations):
            with_tangent = equations.keep_tangent or not self.is_chord
            norm = equations.unbalance(self.u, self.pressure, with_tangent)
            if k == 0:
                first_norm = norm
            if k >= self.settings.wandering_after and self._wanders(norm, first_norm):
                return None
            if norm < equations.tolerance or self._only_rounds(norm):
                return self.u
            if self._is_worse(norm) and self.backtracks < self.settings.max_backtracks:
                self._backtrack()
            elif not self._take_step(norm):
                return None
        return None

    def _wanders(self, norm: float, first_norm: float) -> bool:
        settings = self.settings
        return norm > max(settings.wandering_residual, settings.wandering_growth * first_norm)

    def _only_rounds(self, norm: float) -> bool:
        """Count steps that gain no digits; return whether they are rounding."""
        if 0.5 * self.smallest_norm < norm < self.settings.rounding_below:
            self.idle += norm > 0.5 * self.last_norm
        else:
            self.idle = 0
        return self.idle >= self.settings.max_idle

    def _is_worse(self, norm: float) -> bool:
        """Return whether the last step has to be shortened."""
        settings = self.settings
        gains_little = norm > 0.5 * self.smallest_norm
        self.fruitless = self.fruitless + 1 if self.has_jumps and gains_little else 0
        self.smallest_norm = min(self.smallest_norm, norm)
        limit = self.last_norm
        if self.fruitless < settings.max_fruitless:
            limit = settings.worse_growth * self.last_norm + settings.worse_residual
        return len(self.step) > 0 and norm > limit

    def _backtrack(self) -> None:
        self.scale = self.settings.backtrack * self.scale
        self.backtracks += 1
        self.is_chord = False
        self.unknowns[self.equations.free] = self.step_start + self.scale * self.step

    def _take_step(self, norm: float) -> bool:
        """Go on by a step of Newton's or of a chord; return whether there is one."""
        equations = self.equations
        if not np.isfinite(norm):
            return False
        if self.is_chord and norm > self.settings.chord_gain * self.last_norm:
            self.is_chord = False
            if not equations.keep_tangent:
                equations.unbalance(self.u, self.pressure, with_tangent=True)
        try:
            residual = equations.residual[equations.free]
            self.step = -equations.tangent.step(residual, not self.is_chord)
        except SingularTangent:
            return False
        largest = float(np.abs(self.step).max())
        if not np.isfinite(largest):
            return False
        self.step_start = self.unknowns[equations.free].copy()
        self.scale = min(1.0, equations.step_limit / largest) if largest > 0 else 1.0
        self.unknowns[equations.free] = self.step_start + self.scale * self.step
        self.last_norm = norm
        self.backtracks = 0
        self.is_chord = norm < self.settings.chord_below and self.scale == 1.0
        return True
