"""Newton's iteration with a line search, for contact, wrinkles and folds: a descent of the energy.

A full step with a tangent in which a node is not yet in contact lands far inside a rigid body. The
line search uses that the work of the residual along the step changes its sign where the energy is
least (Matthies and Strang, Int. J. Numer. Methods Eng. 14 (1979) 1613); gas, contact and one
increment of the law are nearly conservative.

Where the wall folds or snaps, the tangent is not positive definite, and Newton's step may lead
uphill. Then a viscosity that makes it so is added: each step is one of a viscous motion down to a
stable equilibrium, the viscosity being reduced with every step (pseudo-transient continuation,
Kelley and Keyes, SIAM J. Numer. Anal. 35 (1998) 508).
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .factorisation import STEP_TOLERANCE, by_near_inverse
from .newton import Equations

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LineSearchSettings:
    """Settings of the iteration with a line search; residuals are ratios to the largest load."""

    max_steps: int = 300  #: number of steps after which the iteration fails
    max_trials: int = 6  #: number of evaluations of the residual in one step
    #: Below `rounding_below`, more steps that do not halve the residual are taken for rounding.
    max_fruitless: int = 4
    rounding_below: float = 1e-6
    #: Viscosities are multiples of pressure / size, the size being that of a typical quad in mm.
    initial_viscosity: float = 0.0  #: of the first step
    first_viscosity: float = 0.01  #: where none was needed before
    smallest_viscosity: float = 1e-4  #: below it there is none
    largest_viscosity: float = 1e6  #: the iteration fails beyond it
    viscosity_decrease: float = 0.3  #: largest factor after a step that was taken as it is
    viscosity_increase: float = 4.0  #: factor where the tangent is not definite
    #: A length of the step is accepted where the work of the residual along the step is at most
    #: this share of the work at its start,
    work_left: float = 0.5
    #: or where it has the same sign and is up to this multiple of it, as where the wall folds,
    steepening: float = 1.5
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
    """Equations of equilibrium with contact.

    Attributes
    ----------
    needed_viscosity : float
        The last viscosity that made a tangent positive definite.
    """

    needed_viscosity: float

    def step_into_contact(self, u: Array, step: Array) -> Array:
        """See `ClosedMembrane.step_into_contact`."""

    def resist(self, viscosity: float) -> None:
        """See `ClosedMembrane.resist`."""


def searched_equilibrium(
    equations: ContactEquations,
    u: Array,
    pressure: float,
    settings: LineSearchSettings = SETTINGS,
) -> Array | None:
    """Find a stable equilibrium by Newton's iteration with a line search.

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
    norm = equations.unbalance(u, pressure, with_tangent=True)
    descent = Descent(equations, settings, settings.initial_viscosity)
    for _ in range(settings.max_steps):
        if descent.has_arrived(norm):
            return u
        step = descent.step(norm) if np.isfinite(norm) else None
        if step is None:
            return None
        if norm > settings.contact_above:
            step = equations.step_into_contact(u, step)
        search = LineSearch(equations, pressure, settings)
        previous = norm
        norm = search.advance(u, step, norm)
        descent.adapt(search.trials, norm / previous)
    return None


@dataclass(eq=False)
class Descent:
    """Steps along which the residual does work, by a viscosity where the tangent is not definite.

    Attributes
    ----------
    viscosity : float
        Of the next step.
    failures : int
        Number of viscosities that were too small for the last step.
    halved_norm : float
        Residual that was the last to be half of another one.
    fruitless : int
        Number of residuals since then.
    """

    equations: ContactEquations
    settings: LineSearchSettings
    viscosity: float
    failures: int = 0
    halved_norm: float = math.inf
    fruitless: int = 0

    def has_arrived(self, norm: float) -> bool:
        """Return whether a relative residual is that of an equilibrium; called once a step.

        The last step has to be one without a viscosity, unless the residual is only rounding.
        """
        settings = self.settings
        self.fruitless += 1
        if norm <= 0.5 * self.halved_norm:
            self.halved_norm = norm
            self.fruitless = 0
        tolerance = settings.tolerance_factor * self.equations.tolerance
        if self.fruitless > settings.max_fruitless:
            return norm < max(tolerance, settings.rounding_below)
        is_static = self.viscosity == 0.0
        if norm < tolerance:
            self.viscosity = 0.0
        return norm < tolerance and is_static

    def step(self, norm: float) -> Array | None:
        """Return the step (free,) mm from a state of a relative residual, or None."""
        settings = self.settings
        tangent = self.equations.tangent
        residual = self.equations.residual[self.equations.free]
        self.equations.resist(self.viscosity)
        is_chord = norm < settings.chord_below
        tolerance = STEP_TOLERANCE if is_chord else settings.step_tolerance
        if self.viscosity == 0.0 and norm < settings.reused_below:
            step = by_near_inverse(tangent, residual, tolerance)
            if step is not None and float(step @ residual) > 0:
                return -step
        if not self._make_definite():
            return None
        step = None
        if self.viscosity == 0.0:
            step = by_near_inverse(tangent, residual, tolerance)
        inverse = tangent.near_inverse()
        if step is None and inverse is not None:
            step = inverse(residual)
        return None if step is None or not np.isfinite(step).all() else -step

    def _make_definite(self) -> bool:
        """Factorise the tangent with as much viscosity as it needs; return whether it was found."""
        settings = self.settings
        equations = self.equations
        self.failures = 0
        while not equations.tangent.renew_definite():
            least = max(settings.first_viscosity, equations.needed_viscosity)
            larger = settings.viscosity_increase * self.viscosity
            self.viscosity = larger if self.viscosity > 0 else least
            if self.viscosity > settings.largest_viscosity:
                return False
            self.failures += 1
            equations.resist(self.viscosity)
        if self.failures:
            equations.needed_viscosity = self.viscosity
        return True

    def adapt(self, trials: int, gain: float) -> None:
        """Change the viscosity after a step.

        Parameters
        ----------
        trials : int
            Number of evaluations of the residual that it took.
        gain : float
            Residual after the step over that before.
        """
        settings = self.settings
        if trials >= settings.max_trials:
            least = max(settings.first_viscosity, self.equations.needed_viscosity)
            self.viscosity = max(least, settings.viscosity_increase * self.viscosity)
        elif trials == 1 and self.failures < 2:
            self.viscosity *= min(settings.viscosity_decrease, gain)
        if self.viscosity < settings.smallest_viscosity:
            self.viscosity = 0.0


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
    trials : int
        Number of shares that were tried.
    """

    equations: ContactEquations
    pressure: float
    settings: LineSearchSettings
    low: float = 0.0
    high: float = math.inf
    slope_low: float = math.nan
    slope_high: float = math.nan
    trials: int = 0

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
        while self.trials < settings.max_trials:
            self.trials += 1
            unknowns[equations.free] = start + share * step
            trial_norm = equations.unbalance(u, self.pressure, has_tangent)
            trial_slope = math.nan
            if np.isfinite(trial_norm):
                trial_slope = float(step @ equations.residual[equations.free])
            falls = trial_norm < settings.gain * norm or norm < settings.small_residual
            if falls or abs(trial_slope) <= settings.work_left * abs(slope):
                break
            falls_short = 0 < trial_slope / slope <= settings.steepening
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
