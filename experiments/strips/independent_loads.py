"""Estimate how many of the loads of strips are independent of each other.

Specimens differ as a whole: one is stiffer along all of its curve. A hundred loads of one specimen
are therefore not a hundred measurements: five specimens reduce an uncertainty by the square root of
five, whatever the number of readings.
"""

from functools import lru_cache

import numpy as np

from ...inference.correlation import CorrelogramSettings, correlated_count
from .data import Strip

#: Number of independent loads along the curve of one specimen, where there are no two specimens to
#: compare. The published strips of three directions have 1.6, 1.2 and 1.1.
PLACES_OF_SPECIMEN = 1.25
#: Number of specimens behind a polynomial where it is unknown: as many as ISO 1421 asks for.
SPECIMENS_OF_POLYNOMIAL = 5


def correlated_loads(
    strip: Strip, loads: int, noise: float | None, specimens: int | None = None
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
    specimens : int or None
        Number of specimens behind a single curve or a polynomial, where it is given.
    """
    if noise is not None and specimens is None and len(np.unique(strip.specimen_of)) < 2:
        return 1.0
    return max(1.0, loads / independent_loads(strip, specimens))


@lru_cache(maxsize=64)
def independent_loads(strip: Strip, specimens: int | None = None) -> float:
    """Return the number of independent loads of all specimens of a direction together.

    It is the number of independent loads along one specimen times the number of specimens less one.
    With two or more measured specimens, the former follows from their deviations from the
    polynomial through all: from the correlation of a deviation along the curve, or from how much of
    it is one stiffness factor of the specimen, whichever gives fewer. Otherwise it is
    `PLACES_OF_SPECIMEN`, and the number of specimens is `specimens`, or 1 for a curve, or
    `SPECIMENS_OF_POLYNOMIAL`.

    Parameters
    ----------
    strip : Strip
        Data of the direction.
    specimens : int or None
        Number of specimens behind a single curve or a polynomial.
    """
    numbers = np.unique(strip.specimen_of).tolist()
    if len(numbers) < 2 or strip.polynomial is None:
        behind = specimens or (1 if strip.curves else SPECIMENS_OF_POLYNOMIAL)
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
