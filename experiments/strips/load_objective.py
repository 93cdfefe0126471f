"""Residuals of the loads of strips.

References
----------
Equations 3.4 to 3.7 of the thesis.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ...inference.objective import NoiseIs, Objective
from ...solvers.base import Array, History


class LoadObjective(Objective):
    """Residuals (model - measured) / (scale sqrt(n)) at n elongations of the gauge.

    Parameters
    ----------
    increments : (frames,) array, mm
        Of the model; its load is interpolated by a cubic spline from the origin.
    elongation : (n,) array, mm
    load : (n,) array, N
        Measured.
    scale : float, N
        1 for errors in N, the largest load for relative errors.
    weight : float
        Of the error in the objective.
    least_noise : float, N
    noise_is : str
        Origin of the noise.
    correlated_count : float
        Number of loads that err as one, at least.
    specimens : (n,) array of int or None
        Number of each load's specimen.
    """

    unit = "N"
    columns = 1

    def __init__(
        self,
        increments: ArrayLike,
        elongation: ArrayLike,
        load: ArrayLike,
        scale: float = 1.0,
        weight: float = 1.0,
        least_noise: float = 0.0,
        noise_is: NoiseIs = "assumed",
        correlated_count: float = 1.0,
        specimens: ArrayLike | None = None,
    ) -> None:
        knots = np.concatenate([[0.0], np.asarray(increments, float)])
        self.elongation = np.asarray(elongation, float)
        self.load = np.asarray(load, float)
        count = len(self.load)
        # Interpolation is linear in the loads; the first knot is the unloaded strip.
        curve = scipy.interpolate.CubicSpline(knots, np.eye(len(knots)))
        self.sample = curve(self.elongation)[:, 1:]
        self.slope_sample = curve(self.elongation, 1)[:, 1:]
        self.sizes = (count,)
        self.least_noise = least_noise
        self.noise_is = noise_is
        self.specimens = None if specimens is None else np.asarray(specimens)
        self.correlated_count = min(max(correlated_count, 1.0), float(count))
        self.scale = np.full(count, scale * np.sqrt(count) / weight)

    @property
    def data(self) -> tuple[Array, ...]:
        """Return the arrays on which residuals depend beside the model."""
        return self.elongation, self.load

    @property
    def measured(self) -> Array:
        """Return the measured loads, (n,) N."""
        return self.load

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the elongation of every reading, (n, 1) mm: neighbours may err as one."""
        return (self.elongation[:, None],)

    def of_points(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return (n,) for each residual, of values for each point."""
        return values

    def shifted(self, external: History, surrogate: History) -> LoadObjective:
        """Return the objective of a surrogate that stands for an external solver."""
        objective = copy.copy(self)
        objective.load = self.load - self.sample @ (external.load - surrogate.load)
        return objective

    def modelled(self, history: History) -> Array:
        """Return the model's load at the measured elongations, (n,) N."""
        return np.asarray(self.sample @ history.load)

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        """Return the residuals, (n,)."""
        return np.asarray((self.modelled(history) - self.measured) / self.scale)

    def jacobian(self, history: History, slope: Array) -> Array:
        """Return the derivatives of the residuals by the parameters, (n, parameters)."""
        assert history.load_slope is not None
        return np.asarray(self.sample @ history.load_slope / self.scale[:, None])

    def rms(self, history: History) -> float:
        """Return RMS error in N, whatever the scale and the weight."""
        return float(np.sqrt(np.mean((self.modelled(history) - self.measured) ** 2)))


class StripObjective(LoadObjective):
    """Residuals of a strip's loads, with what may be wrong in such a test."""

    def causes(self, history: History) -> dict[str, Array]:
        """Return (n, 1) a cause, by its words, the slope of the residual by one unit of it."""
        by_load = 1.0 / self.scale
        by_elongation = self.slope_sample @ history.load / self.scale
        by_length = by_elongation * self.elongation
        return {
            "loads off by {:+.2g} N (zero the load cell, name the preload)": by_load[:, None],
            "elongations off by {:+.2g} mm (count them from the preload)": -by_elongation[:, None],
            "a gauge length off by {:+.1%} (measure it)": by_length[:, None],
        }
