"""How many loads of strips are independent.

Specimens differ as a whole: one is stiffer along all of its curve. A hundred loads of it are not a
hundred measurements: five specimens reduce an uncertainty by the root of five, whatever the number
of readings.
"""

from functools import lru_cache

import numpy as np

from ...inference.correlation import CorrelogramSettings, correlated_count
from .data import Strip

#: Independent places along the curve of a specimen, where there are no two to compare: those of
#: the published strips have 1.6, 1.2 and 1.1.
PLACES_OF_SPECIMEN = 1.25
#: Specimens behind a polynomial where the number is unknown: as many as ISO 1421 asks for.
SPECIMENS_OF_POLYNOMIAL = 5


def correlated_loads(
    strip: Strip, loads: int, noise: float | None, specimens: int | None = None
) -> float:
    """Return the number of loads of a direction that err as one.

    Parameters
    ----------
    strip : Strip
    loads : int
        Number of loads that are matched.
    noise : float, N, or None
        That the project gives of one load.
    specimens : int or None
        Number of specimens behind a curve.
    """
    if noise is not None and specimens is None and len(np.unique(strip.specimen_of)) < 2:
        return 1.0
    return max(1.0, loads / independent_loads(strip, specimens))


@lru_cache(maxsize=64)
def independent_loads(strip: Strip, specimens: int | None = None) -> float:
    """Return the number of independent loads of all specimens of a direction together.

    Of two or more specimens: places a specimen that do not err as one, by the correlation along it
    of its deviation from the polynomial of all, or by the factor by which it is stiffer, whichever
    are fewer; times the specimens less one. Else `PLACES_OF_SPECIMEN` a specimen, likewise, with
    `specimens`, one, or `SPECIMENS_OF_POLYNOMIAL` behind a polynomial.

    Parameters
    ----------
    strip : Strip
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
    # What a specimen that is stiffer by a factor leaves, which no distance tells.
    squares_by_factor = [
        float(deviation @ specimen_mean) ** 2 / max(float(specimen_mean @ specimen_mean), 1e-300)
        for deviation, specimen_mean in zip(deviations, means, strict=True)
    ]
    count = max(by_distance, float(np.mean(squares_by_factor)) / mean_square)
    places = float(np.mean([len(deviation) for deviation in deviations])) / count
    return (len(numbers) - 1) * max(1.0, places)
