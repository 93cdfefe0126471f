"""Newton's iteration with a line search, for contact and wrinkles, where the stiffness jumps.

A full step with a tangent in which a node is not yet in contact lands far inside a rigid body. The
line search uses that the work of the residual along the step changes its sign where the energy is
least (Matthies and Strang, Int. J. Numer. Methods Eng. 14 (1979) 1613); gas, contact and one
increment of the law are nearly conservative.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .factorisation import STEP_TOLERANCE, SingularTangent, near_step
from .newton import Equations

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LineSearchSettings:
    """Settings of the iteration with a line search; residuals are ratios to the largest load."""

    max_steps: int = 16  #: number of steps after which the iteration fails
    max_trials: int = 5  #: number of evaluations of the residual in one step
    #: The iteration ends where more steps do not halve the residual: below `rounding_below` that is
    #: taken for rounding, otherwise the iteration fails, as near an unstable state.
    max_fruitless: int = 4
    rounding_below: float = 1e-6
    #: A length of the step is accepted where the work of the residual along the step is at most
    #: this share of the work at its start,
    work_left: float = 0.5
    #: or where the residual falls to this share, or was smaller than `small_residual` before.
    gain: float = 0.1
    small_residual: float = 1e-2
    #: Above this residual contact that a step makes or ends is taken into account.
    contact_above: float = 1e-3
    #: Above this residual nodes come into contact, so that the last factorisation is not tried.
    reused_below: float = 0.1
    #: After a step from a residual below `chord_below` the tangent stays, without assembly, as long
    #: as each step reduces the residual to the share `chord_gain`.
    chord_below: float = 1e-2
    chord_gain: float = 0.2
    #: Multiple of the tolerance up to which a state is an equilibrium: loads of bent cylinders
    #: change by less than 1e-6.
    tolerance_factor: float = 1000.0
    #: Relative residual up to which the linear equations of a step are solved, above `chord_below`.
    step_tolerance: float = 1e-2
    #: The next trial lies in the interval that contains the solution, at a share of it between
    #: `smallest_share` and `largest_share`, or at `blind_share` if that cannot be interpolated.
    smallest_share: float = 0.1
    blind_share: float = 0.3
    largest_share: float = 0.9


SETTINGS = LineSearchSettings()


class ContactEquations(Equations, Protocol):
    """Equations of equilibrium with contact."""

    def step_into_contact(self, u: Array, step: Array) -> Array:
        """See `ClosedMembrane.step_into_contact`."""


def searched_equilibrium(
    equations: ContactEquations,
    u: Array,
    pressure: float,
    settings: LineSearchSettings = SETTINGS,
) -> Array | None:
    """Find an equilibrium by Newton's iteration with a line search.

    Parameters
    ----------
    equations : ContactEquations
    u : (n, 3) array, mm
        Displacement to start from.
    pressure : float, MPa
    settings : LineSearchSettings

    Returns
    -------
    (n, 3) array, mm, or None
        The displacement in equilibrium; None if none is found.
    """
    u = u.copy()
    tolerance = settings.tolerance_factor * equations.tolerance
    norm = equations.unbalance(u, pressure, with_tangent=True)
    halved_norm = np.inf
    fruitless = 0
    for _ in range(settings.max_steps):
        if norm < tolerance:
            return u
        fruitless += 1
        if norm <= 0.5 * halved_norm:
            halved_norm = norm
            fruitless = 0
        if fruitless > settings.max_fruitless:
            return u if norm < settings.rounding_below else None
        is_changed = norm > settings.reused_below
        step = None
        if np.isfinite(norm):
            is_chord = norm < settings.chord_below
            solved_to = STEP_TOLERANCE if is_chord else settings.step_tolerance
            step = _newton_step(equations, is_changed, solved_to)
        if step is None:
            return None
        if norm > settings.contact_above:
            step = equations.step_into_contact(u, step)
        norm = LineSearch(equations, pressure, settings).advance(u, step, norm)
    return u if norm < tolerance else None


def _newton_step(equations: Equations, is_changed: bool, tolerance: float) -> Array | None:
    """Return the step (free,) mm, or None.

    Parameters
    ----------
    is_changed, tolerance
        See `near_step`.
    """
    residual = equations.residual[equations.free]
    try:
        step = -near_step(equations.tangent, residual, is_changed, tolerance=tolerance)
    except SingularTangent:
        return None
    return step if np.isfinite(step).all() else None


@dataclass(eq=False)
class LineSearch:
    """A search along one step for the point where the residual does little work along it.

    Attributes
    ----------
    low, high : float
        Shares of the step between which that point lies.
    slope_low, slope_high : float
        Work (N mm) along the whole step of the residuals there; NaN where it cannot be used to
        interpolate.
    """

    equations: ContactEquations
    pressure: float
    settings: LineSearchSettings
    low: float = 0.0
    high: float = math.inf
    slope_low: float = math.nan
    slope_high: float = math.nan

    def advance(self, u: Array, step: Array, norm: float) -> float:
        """Move u (n, 3) along a step (free,) by an accepted share of it.

        The residual and the tangent are evaluated there.

        Parameters
        ----------
        norm : float
            Relative residual at the start; that at the end is returned.
        """
        equations = self.equations
        settings = self.settings
        unknowns = u.reshape(-1)
        start = unknowns[equations.free].copy()
        slope = float(step @ equations.residual[equations.free])
        self.slope_low = slope
        largest = float(np.abs(step).max())
        share = min(1.0, equations.step_limit / largest) if largest > 0 else 1.0
        # Most trials are taken as they are, so that they come with their tangent.
        has_tangent = norm >= settings.chord_below
        for _ in range(settings.max_trials):
            unknowns[equations.free] = start + share * step
            trial_norm = equations.unbalance(u, self.pressure, has_tangent)
            trial_slope = math.nan
            if np.isfinite(trial_norm):
                trial_slope = float(step @ equations.residual[equations.free])
            falls = trial_norm < settings.gain * norm or norm < settings.small_residual
            if falls or abs(trial_slope) <= settings.work_left * abs(slope):
                break
            falls_short = trial_slope * slope > 0 and abs(trial_slope) <= abs(slope)
            if falls_short and self.high == math.inf:
                break
            self._narrow(share, trial_slope, slope, falls_short)
            share = self._interpolated()
        tolerance = settings.tolerance_factor * equations.tolerance
        is_near = trial_norm < max(tolerance, settings.chord_gain * norm)
        if not (has_tangent or is_near):
            trial_norm = equations.unbalance(u, self.pressure, with_tangent=True)
        return trial_norm

    def _narrow(
        self,
        share: float,
        trial_slope: float,
        slope: float,
        falls_short: bool,
    ) -> None:
        """Replace one end of the interval by a share of the step that was tried.

        Parameters
        ----------
        falls_short : bool
            Whether the point that is searched lies beyond that share.
        """
        if falls_short:
            self.low = share
            self.slope_low = trial_slope
        else:
            self.high = share
            self.slope_high = trial_slope if trial_slope * slope < 0 else math.nan

    def _interpolated(self) -> float:
        """Return the share of the step to be tried next."""
        settings = self.settings
        share = self.slope_low / (self.slope_low - self.slope_high)
        if math.isnan(share):
            share = settings.blind_share
        else:
            share = min(settings.largest_share, max(settings.smallest_share, share))
        return self.low + share * (self.high - self.low)
