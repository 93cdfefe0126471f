"""Ratios of loads along warp and fill: their spellings, and the nearest one of two loads."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...materials.designers import RATIOS, shares

#: Ratios that a pair of loads may be taken for.
USUAL_RATIOS = (*RATIOS, "3:1", "1:3", "3:2", "2:3", "4:1", "1:4", "5:1", "1:5")


def plain_ratio(ratio: str) -> str:
    """Return one name for every spelling of a ratio: "2:1" for "2/1", "2.0 : 1" and "4:2"."""
    warp, fill = shares(ratio)
    smallest = min(share for share in (warp, fill) if share > 0)
    multiples = [round(share / smallest, 3) for share in (warp, fill)]
    for factor in range(1, 6):
        scaled = [factor * multiple for multiple in multiples]
        if all(math.isclose(x, round(x), abs_tol=0.005 * factor) for x in scaled):
            return ":".join(f"{round(x)}" for x in scaled)
    return f"{round(warp, 3):g}:{round(fill, 3):g}"


def nearest_ratio(loads: Sequence[float], *, tolerance: float = 4.0) -> str:
    """Return the ratio of loads along warp and fill; their own numbers where none is near.

    Parameters
    ----------
    loads : (2,) sequence
    tolerance : float, degrees
        Between the direction of the loads and that of a ratio.

    Examples
    --------
    >>> nearest_ratio([30.0, 14.8]), nearest_ratio([25.0, 0.5])
    ('2:1', '1:0')
    """
    warp, fill = (max(load, 0.0) for load in loads)
    larger = max(warp, fill)
    angle = math.degrees(math.atan2(fill, warp))
    deviations = {
        name: abs(math.degrees(math.atan2(*shares(name)[::-1])) - angle) for name in USUAL_RATIOS
    }
    best = min(deviations, key=lambda name: deviations[name])
    if deviations[best] <= tolerance or not larger > 0:
        return best
    return f"{warp / larger:.2g}:{fill / larger:.2g}"
