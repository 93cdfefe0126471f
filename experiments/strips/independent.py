"""How many independent loads the curves of a direction hold.

Specimens differ as a whole: one is stiffer along all of its curve. A hundred loads of it are not a
hundred measurements, and what a fit knows better for five specimens is by a factor of the root of
five, whatever the number of readings.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...identification.correlation import alike
from .strip import Strip

#: Independent places along the curve of a specimen, where there are no two to compare: those of
#: the published strips have 1.6, 1.2 and 1.1 (benchmarks/bench_strips_certainty.py).
PLACES = 1.25
#: Specimens behind a polynomial of which nobody says it: as many as ISO 1421 asks for.
SPECIMENS = 5
#: Distances along a curve, up to its whole length, at which loads are compared: a specimen may have
#: ten of them.
RINGS = 8


def loads_alike(
    strip: Strip, loads: int, noise: float | None, specimens: int | None = None
) -> float:
    """How many of so many loads of a direction err as one.

    noise : N, that the project gives of one load: independent of the others' where no two specimens
    tell. specimens : as for `independent_loads`.
    """
    if noise is not None and specimens is None and len(np.unique(strip.specimen_of)) < 2:
        return 1.0
    return max(1.0, loads / independent_loads(strip, specimens))


@lru_cache(maxsize=64)
def independent_loads(strip: Strip, specimens: int | None = None) -> float:
    """Of all specimens of a direction together, up to the end of the model.

    Of two or more whose points are there: as many places a specimen as do not err as one, by the
    correlation along it of what it lies beside the polynomial of all, or as the factor says by
    which it is stiffer, whichever are fewer; times the specimens less one, which that polynomial
    has taken up. Else `PLACES` a specimen, likewise.

    Parameters
    ----------
    specimens : how many there are behind a polynomial, or behind points that do not tell them
        apart; `SPECIMENS` behind a polynomial, and one of points, where nobody says it.
    """
    numbers = np.unique(strip.specimen_of).tolist()
    if len(numbers) < 2 or strip.polynomial is None:
        behind = specimens or (1 if strip.curves else SPECIMENS)
        return PLACES * max(1, behind - 1)
    elongation, load = strip.points
    mean = strip.polynomial(elongation)
    rows = [np.flatnonzero(strip.specimen_of == number) for number in numbers]
    blocks = [load[own] - mean[own] for own in rows]
    square = float(np.mean(np.concatenate(blocks) ** 2))
    if not square > 0:
        return float(len(numbers) - 1)
    places = [elongation[own][:, None] for own in rows]
    along = alike(blocks, places, 1.0 + 1e-9, RINGS)
    # What a specimen that is stiffer by a factor leaves, which no distance tells.
    by_factor = [
        float(block @ mean[own]) ** 2 / max(float(mean[own] @ mean[own]), 1e-300)
        for block, own in zip(blocks, rows, strict=True)
    ]
    together = max(along, float(np.mean(by_factor)) / square)
    each = float(np.mean([len(block) for block in blocks])) / together
    return (len(numbers) - 1) * max(1.0, each)
