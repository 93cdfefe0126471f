"""Residuals of modelled against measured loads, and how many of the loads are independent.

Specimens differ as a whole: one is stiffer along all of its curve. A hundred loads of one specimen
are therefore not a hundred measurements: five specimens reduce an uncertainty by the square root of
five, whatever the number of readings.

References
----------
Equations 3.4 to 3.7 of the thesis (docs/references.md).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...inference.noise import CorrelogramSettings, correlated_count
from ...inference.objective import NoiseIs
from ...materials.cubic_curves import hermite_slope_weights, hermite_weights, spline_slopes
from ...solvers.base import Array, History
from ..measured import LoadsObjective
from .data import Strip


class LoadObjective(LoadsObjective):
    """Residuals weight (model - measured) / (unit_error sqrt(n)) at n elongations of the gauge.

    Parameters
    ----------
    modelled_elongation : (frames,) array, mm
        Elongations at which the model gives loads; between them the load is interpolated by a
        cubic spline from the origin.
    elongation : (n,) array, mm
        Elongations of the measured loads.
    load : (n,) array, N
        Measured loads.
    unit_error : float, N
        Error that counts as 1: 1 N for errors in N, the largest load for relative errors.
    weight : float
        Weight of the error in the objective.
    least_noise : float, N
        Lower bound of the standard deviation of one load.
    noise_is : str
        Where the noise comes from, in words.
    correlated_count : float
        Lower bound of the number of loads that share one error.
    specimens : (n,) array of int or None
        Number of the specimen of each load.

    Attributes
    ----------
    sample : (n, frames) array
        Derivatives of the interpolated loads by the model's loads: `sample @ history.load` are the
        n loads. A subclass whose history has a frame at rest inserts a column of zeros for it.
    """

    unit = "N"
    columns = 1

    def __init__(
        self,
        modelled_elongation: ArrayLike,
        elongation: ArrayLike,
        load: ArrayLike,
        unit_error: float = 1.0,
        weight: float = 1.0,
        least_noise: float = 0.0,
        noise_is: NoiseIs = "assumed",
        correlated_count: float = 1.0,
        specimens: ArrayLike | None = None,
    ) -> None:
        knots = np.concatenate([[0.0], np.asarray(modelled_elongation, float)])
        self.elongation: Array = np.asarray(elongation, float)
        self.load = np.asarray(load, float)
        count = len(self.load)
        # Interpolation is linear in the loads; the first knot is the unloaded strip.
        self.knots = knots
        self.spline_slopes = spline_slopes(knots)
        self._sample()
        self.sizes = (count,)
        self.least_noise = least_noise
        self.noise_is = noise_is
        self.specimens = None if specimens is None else np.asarray(specimens)
        self.correlated_count = min(max(correlated_count, 1.0), float(count))
        self.scale = np.full(count, unit_error * np.sqrt(count) / weight)

    def _sample(self) -> None:
        """Set the matrices that give the model's loads and their slopes at the elongations."""
        by_value, by_slope = hermite_weights(self.knots, self.elongation)
        self.sample = (by_value + by_slope @ self.spline_slopes)[:, 1:]
        by_value, by_slope = hermite_slope_weights(self.knots, self.elongation)
        self.slope_sample = (by_value + by_slope @ self.spline_slopes)[:, 1:]

    @property
    def data(self) -> tuple[Array, ...]:
        """Return the measured arrays on which the residuals depend."""
        return self.elongation, self.load

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the elongation (n, 1) mm of every load, over which errors may be correlated."""
        return (self.elongation[:, None],)

    def spread_over_residuals(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the value (n,) of each residual from values (n,) of the points: here the same."""
        return values

    def compared_values(self, loads: Array) -> Array:
        """Return loads of the model, or their derivatives, at the measured elongations."""
        return self.sample @ loads


COMPLIANCE = (
    "machine and grips that give {:+.2g} mm for each N (measure it with a stiff bar: compliance, "
    "or let a fit find it: compliance_prior)"
)


class StripObjective(LoadObjective):
    """Residuals of a strip's loads, with the systematic errors that a strip test may have.

    Attributes
    ----------
    compliance : (str, float) or None
        Name of the nuisance parameter for what machine and grips give (mm/N), and the value that
        is off the elongations already; None where it is no unknown.
    """

    compliance: tuple[str, float] | None = None

    def at(self, nuisance: Mapping[str, float]) -> StripObjective:
        """Return the objective with elongations less what machine and grips give."""
        if self.compliance is None or not nuisance:
            return self
        name, removed = self.compliance
        corrected = copy.copy(self)
        corrected.compliance = None
        corrected.elongation = self.elongation - (nuisance[name] - removed) * self.load
        corrected._sample()
        return corrected

    def nuisance_columns(
        self, names: Sequence[str], nuisance: Mapping[str, float], history: History
    ) -> Array:
        slopes = self.at(nuisance).slope_sample @ history.load
        return (-slopes * self.load / self.scale)[:, None]

    def causes(self, history: History) -> dict[str, Array]:
        """Return possible systematic errors: the derivative (n, 1) of the residuals by each one.

        The keys are words in which the size of the error is filled in.
        """
        by_load = 1.0 / self.scale
        by_elongation = self.slope_sample @ history.load / self.scale
        by_length = by_elongation * self.elongation
        return {
            "loads off by {:+.2g} N (zero the load cell, name the preload)": by_load[:, None],
            "elongations off by {:+.2g} mm (count them from the preload)": -by_elongation[:, None],
            "a gauge length off by {:+.1%} (measure it)": by_length[:, None],
            COMPLIANCE: -(by_elongation * self.load)[:, None],
        }


#: Number of independent loads along the curve of one specimen, where there are no two specimens to
#: compare. The published strips of three directions have 1.6, 1.2 and 1.1.
PLACES_OF_SPECIMEN = 1.25
#: Number of specimens behind a polynomial where it is unknown: as many as ISO 1421 asks for.
SPECIMENS_OF_POLYNOMIAL = 5


def correlated_loads(
    strip: Strip,
    loads: int,
    noise: float | None,
    specimen_count: int | None = None,
) -> float:
    """Return how many loads of a direction share one error: all loads over the independent ones.

    It is 1 where the project gives the noise and there are no specimens to tell otherwise.

    Parameters
    ----------
    strip : Strip
        Data of the direction.
    loads : int
        Number of loads that are matched.
    noise : float, N, or None
        Standard deviation of one load that the project gives.
    specimen_count : int or None
        Number of specimens behind a single curve or a polynomial, where it is given.
    """
    if noise is not None and specimen_count is None and len(np.unique(strip.specimen_of)) < 2:
        return 1.0
    return max(1.0, loads / independent_loads(strip, specimen_count))


@lru_cache(maxsize=64)
def independent_loads(strip: Strip, specimen_count: int | None = None) -> float:
    """Return the number of independent loads of all specimens of a direction together.

    It is the number of independent loads along one specimen times the number of specimens less one.
    With two or more measured specimens, the former follows from their deviations from the
    polynomial through all: from the correlation of a deviation along the curve, or from how much of
    it is one stiffness factor of the specimen, whichever gives fewer. Otherwise it is
    `PLACES_OF_SPECIMEN`, and the number of specimens is `specimen_count`, or 1 for a curve, or
    `SPECIMENS_OF_POLYNOMIAL`.

    Parameters
    ----------
    strip : Strip
        Data of the direction.
    specimen_count : int or None
        Number of specimens behind a single curve or a polynomial.
    """
    numbers = np.unique(strip.specimen_of).tolist()
    if len(numbers) < 2 or strip.polynomial is None:
        behind = specimen_count or (1 if strip.curves else SPECIMENS_OF_POLYNOMIAL)
        return PLACES_OF_SPECIMEN * max(1, behind - 1)
    elongation, load = strip.points
    mean = strip.polynomial(elongation)
    rows = [np.flatnonzero(strip.specimen_of == number) for number in numbers]
    means = [mean[of_specimen] for of_specimen in rows]
    deviations = [load[of_specimen] - mean[of_specimen] for of_specimen in rows]
    mean_square = float(np.mean(np.concatenate(deviations) ** 2))
    if not mean_square > 0:
        return float(len(numbers) - 1)
    positions = [elongation[of_specimen][:, None] for of_specimen in rows]
    # Along the whole curve of a specimen, in few bins: it may have ten loads.
    settings = CorrelogramSettings(max_distance=1.0 + 1e-9, bins=8)
    by_distance = correlated_count(deviations, positions, settings)
    # The part of each deviation that is proportional to the mean curve, that is a stiffness factor
    # of the specimen: correlation over distance does not show it.
    squares_by_factor = [
        float(deviation @ specimen_mean) ** 2 / max(float(specimen_mean @ specimen_mean), 1e-300)
        for deviation, specimen_mean in zip(deviations, means, strict=True)
    ]
    count = max(by_distance, float(np.mean(squares_by_factor)) / mean_square)
    places = float(np.mean([len(deviation) for deviation in deviations])) / count
    return (len(numbers) - 1) * max(1.0, places)
