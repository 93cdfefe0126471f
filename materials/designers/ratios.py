"""Load ratios, warp to fill, by their names: the five of which designers' constants are made."""

from __future__ import annotations

import math
import re

from ...errors import InputError

#: The five of which designers' constants are made.
RATIOS = ("1:1", "2:1", "1:2", "1:0", "0:1")

_RATIO = re.compile(r"^\s*(\d+(?:[.,]\d+)?)\s*[:/]\s*(\d+(?:[.,]\d+)?)\s*$")


def shares(ratio: str) -> tuple[float, float]:
    """Loads along warp and fill where the larger is 1.

    >>> shares("1:2"), shares("2/1")
    ((0.5, 1.0), (1.0, 0.5))

    Raises
    ------
    InputError : no such ratio.
    """
    found = _RATIO.match(ratio)
    pair = [float(text.replace(",", ".")) for text in found.groups()] if found else [0.0]
    if not 0 < max(pair) < math.inf:
        problem = f"expected a load ratio such as 2:1 (warp to fill), got {ratio[:40]!r}"
        raise InputError(None, "ratio", problem)
    return pair[0] / max(pair), pair[1] / max(pair)
