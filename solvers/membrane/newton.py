"""Newton's iteration with backtracking and chord steps, for equilibria without contact."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .factorisation import SingularTangent, Tangent

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NewtonSettings:
    """Settings of Newton's iteration; residuals are ratios to the largest load on a node."""

    max_iterations: int = 40
    max_backtracks: int = 8
    backtrack: float = 0.35  #: factor by which a step is shortened that made the residual larger
    #: A residual below `chord_below` is followed by a chord step, that is one with the previous
    #: tangent, as long as each reduces the residual to the share `chord_gain`: it costs a quarter
    #: of a Newton step and still gains one to two digits.
    chord_below: float = 1e-2
    chord_gain: float = 0.15
    #: Below `rounding_below`, a residual that `max_idle` steps do not reduce is taken for rounding
    #: (fine meshes at low pressure), and the state for an equilibrium; unless the residual falls
    #: from step to step, as it does slowly with a nearly singular tangent.
    rounding_below: float = 1e-6
    max_idle: int = 3
    #: A slack sheet at low pressure can pass from fold to fold without end: the iteration fails if,
    #: after `wandering_after` iterations, the residual is above `wandering_residual` and above
    #: `wandering_growth` times the first one, from where it has not been seen to return.
    wandering_after: int = 12
    wandering_residual: float = 1e3
    wandering_growth: float = 5.0
    #: Where a modulus jumps, full steps can alternate between two states: after this many steps
    #: without gain, every step has to reduce the residual.
    max_fruitless: int = 3
    #: A step is shortened if the residual is larger than `worse_growth` times the last one plus
    #: `worse_residual`.
    worse_growth: float = 20.0
    worse_residual: float = 1e-3


class Equations(Protocol):
    """Equations of equilibrium: a residual and its tangent.

    Attributes
    ----------
    free : (f,) ndarray of int
        Numbers of the free unknowns, 3 * node + direction.
    tangent : Tangent
        Derivative of the residual by the free unknowns.
    residual : (3 n,) ndarray, N
        Internal less external forces at the last evaluation.
    tolerance : float
        Relative residual below which a state is an equilibrium.
    step_limit : float, mm
        Largest correction of an unknown in one iteration.
    keep_tangent : bool
        Whether the tangent is to be assembled at the equilibrium that is found.
    """

    free: NDArray[np.intp]
    tangent: Tangent
    residual: Array
    tolerance: float
    step_limit: float
    keep_tangent: bool

    def unbalance(self, u: Array, pressure: float, with_tangent: bool) -> float:
        """Evaluate residual and tangent at u (n, 3) mm and a pressure (MPa).

        Returns the relative residual, inf where the stress is not valid.
        """


@dataclass(eq=False)
class NewtonIteration:
    """One search for an equilibrium by Newton's method.

    Parameters
    ----------
    equations : Equations
    start : (n, 3) array, mm
        Displacement to start from.
    pressure : float, MPa
    settings : NewtonSettings
    has_jumps : bool
        Whether a modulus of the law is a discontinuous function of the strain.
    """

    equations: Equations
    start: Array
    pressure: float
    settings: NewtonSettings
    has_jumps: bool

    def __post_init__(self) -> None:
        self.u = self.start.copy()
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
        """Return the displacement (n, 3) mm in equilibrium, or None if none is found."""
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
        """Count the steps that do not reduce the residual; return whether it is only rounding."""
        if 0.5 * self.smallest_norm < norm < self.settings.rounding_below:
            self.idle += norm > 0.5 * self.last_norm
        else:
            self.idle = 0
        return self.idle >= self.settings.max_idle

    def _is_worse(self, norm: float) -> bool:
        """Count fruitless steps, and return whether the last step has to be shortened.

        Called once an iteration, as it keeps the smallest norm of the residual.
        """
        settings = self.settings
        gains_little = norm > 0.5 * self.smallest_norm
        self.fruitless = self.fruitless + 1 if self.has_jumps and gains_little else 0
        self.smallest_norm = min(self.smallest_norm, norm)
        limit = self.last_norm
        if self.fruitless < settings.max_fruitless:
            limit = settings.worse_growth * self.last_norm + settings.worse_residual
        return len(self.step) > 0 and norm > limit

    def _backtrack(self) -> None:
        """Go back to a share of the step, where the tangent is evaluated anew."""
        self.scale = self.settings.backtrack * self.scale
        self.backtracks += 1
        self.is_chord = False
        self.unknowns[self.equations.free] = self.step_start + self.scale * self.step

    def _take_step(self, norm: float) -> bool:
        """Apply a Newton step or a chord step; return whether one could be computed."""
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
