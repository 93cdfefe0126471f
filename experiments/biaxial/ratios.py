"""Normalise the spelling of load ratios warp:fill, and find the ratio of a pair of loads."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...materials.designers import RATIOS, shares

#: Ratios among which that of a pair of measured loads is looked for.
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
    """Return the usual ratio closest to a pair of loads, or their own ratio where none is close.

    Parameters
    ----------
    loads : (2,) sequence
        Loads along warp and fill; negative ones count as zero.
    tolerance : float, degrees
        Largest angle between the loads and a usual ratio as vectors (warp, fill).

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
