"""Load ratios, warp to fill, by the names that files have for them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...materials.designers.ratios import RATIOS, shares

#: Those that a pair of loads may be taken for.
KNOWN = (*RATIOS, "3:1", "1:3", "3:2", "2:3", "4:1", "1:4", "5:1", "1:5")
#: Degrees between the direction of a pair of loads and that of a ratio: no more than it.
NEAR = 4.0


def plain_ratio(ratio: str) -> str:
    """The same name for each spelling of a ratio: "2:1" of "2/1", "2.0 : 1" and "4:2".

    Raises
    ------
    InputError : no such ratio.
    """
    warp, fill = shares(ratio)
    least = min(x for x in (warp, fill) if x > 0)
    whole = [round(x / least, 3) for x in (warp, fill)]
    for factor in range(1, 6):
        if all(math.isclose(factor * x, round(factor * x), abs_tol=0.005 * factor) for x in whole):
            return ":".join(f"{round(factor * x)}" for x in whole)
    return ":".join(f"{x:g}" for x in (round(warp, 3), round(fill, 3)))


def nearest_ratio(loads: Sequence[float]) -> str:
    """The ratio that loads along warp and fill are of; their own numbers where it is none.

    >>> nearest_ratio([30.0, 14.8]), nearest_ratio([25.0, 0.5])
    ('2:1', '1:0')
    """
    warp, fill = (max(x, 0.0) for x in loads)
    own = math.degrees(math.atan2(fill, warp))

    def off(name: str) -> float:
        a, b = shares(name)
        return abs(math.degrees(math.atan2(b, a)) - own)

    best = min(KNOWN, key=off)
    if off(best) <= NEAR or not max(warp, fill) > 0:
        return best
    larger = max(warp, fill)
    return f"{warp / larger:.2g}:{fill / larger:.2g}"
