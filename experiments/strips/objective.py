"""Residuals of a strip test (Eqs 3.4-3.6): one block, whose norm is the RMS error of the load."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from ...errors import InputError
from ...inference.comparison import NoiseIs
from ...solvers.base import History

Array = NDArray[np.float64]


class LoadObjective:
    """Residuals (model - measured) / (scale sqrt(n)) at n elongations of the gauge.

    increments : (frames,) mm, elongations that the model reports. elongation, load : (n,) mm, N:
    what was measured, inside the increments. The model's load is interpolated by a cubic spline
    from the origin through its increments. scale : N: 1 for errors in N (Eq. 3.7), the largest load
    for relative errors. weight : of the block in e. least_noise : N, to reckon with at least;
    noise_is : where it is from. alike : how many of the loads err as one, at least, because their
    specimen is stiffer or softer. specimens : (n,) number of the specimen of each load, None where
    that is not known.
    Raises InputError: nothing measured, or measured outside the increments.
    """

    unit = "N"

    def __init__(
        self,
        increments: ArrayLike,
        elongation: ArrayLike,
        load: ArrayLike,
        scale: float = 1.0,
        weight: float = 1.0,
        least_noise: float = 0.0,
        noise_is: NoiseIs = "assumed",
        alike: float = 1.0,
        specimens: ArrayLike | None = None,
    ) -> None:
        knots = np.concatenate([[0.0], np.asarray(increments, float)])
        self.elongation, self.load = np.asarray(elongation, float), np.asarray(load, float)
        if not len(self.load):
            raise InputError(None, "load curve", "holds no point to match")
        beyond = (self.elongation < 0) | (self.elongation > knots[-1] * (1 + 1e-9))
        if beyond.any():
            problem = f"expected elongations from 0 to {knots[-1]:g} mm, got "
            raise InputError(None, "load curve", f"{problem}{self.elongation[beyond][0]:g}")
        # Interpolation is linear in the loads; the first knot is the unloaded strip.
        self.sample = CubicSpline(knots, np.eye(len(knots)))(self.elongation)[:, 1:]
        self.sizes = (len(self.load),)
        self.weight, self.least_noise, self.noise_is = weight, least_noise, noise_is
        self.specimens = None if specimens is None else np.asarray(specimens)
        self.alike = min(max(alike, 1.0), float(len(self.load)))
        self._unit = scale * np.sqrt(len(self.load)) / weight

    @property
    def scale(self) -> Array:
        """Return newtons in one unit of each residual, (n,)."""
        return np.full(len(self.load), self._unit)

    @property
    def data(self) -> tuple[Array, ...]:
        """Return everything measured that the residual depends on."""
        return self.elongation, self.load

    @property
    def places(self) -> tuple[Array, ...]:
        """Return the elongation of every reading, (n, 1) mm: neighbours may err as one."""
        return (self.elongation[:, None],)

    def of_points(self, values: Array) -> Array:
        """Return values for each residual from values for each measured point."""
        return values

    def shifted(self, here: History, there: History) -> LoadObjective:
        """Return the objective of a model that carries `here` where this one carries `there`."""
        other = copy.copy(self)
        other.load = self.load - self.sample @ (here.load - there.load)
        return other

    def modelled(self, history: History) -> Array:
        """Return the model's load at the measured elongations, (n,) N."""
        return np.asarray(self.sample @ history.load)

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        """Return the block, (n,)."""
        return np.asarray((self.modelled(history) - self.load) / self._unit)

    def jacobian(self, history: History, slope: Array) -> Array:
        """Return (n, parameters) from the history's load slope."""
        if history.load_slope is None:
            raise InputError(None, "history", "the solver gives no derivatives of the load")
        return np.asarray(self.sample @ history.load_slope / self._unit)

    def nuisance_columns(self, names: Sequence[str]) -> Array:
        """Return (n, 0): a load curve has no nuisance unknowns."""
        if names:
            raise InputError(None, "nuisance", f"a load curve knows no {', '.join(names)}")
        return np.empty((len(self.load), 0))

    def rms(self, history: History) -> float:
        """Return RMS error in N (Eqs 3.4-3.6), whatever the scale and the weight."""
        return float(np.sqrt(np.mean((self.modelled(history) - self.load) ** 2)))
