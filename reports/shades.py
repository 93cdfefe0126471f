"""The colours of maps: few classes that stay apart for colour-blind readers, light or dark."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from numpy.typing import NDArray

from .maps import Shades

#: Classes of a map's values; odd, so that one of them is about zero.
CLASSES = 13


def _colours(name: str, first: float, last: float) -> tuple[str, ...]:
    return tuple(to_hex(colormaps[name](t)) for t in np.linspace(first, last, CLASSES))


COLOURS: Mapping[Shades, tuple[str, ...]] = {
    "from least": _colours("viridis", 0.0, 1.0),
    "about zero": _colours("RdBu_r", 0.04, 0.96),
}


def ends(values: NDArray[np.float64], shades: Shades) -> tuple[float, float]:
    """Values of the first and the last colour."""
    known = values[np.isfinite(values)]
    if not len(known):
        return 0.0, 1.0
    if shades == "about zero":
        most = float(np.abs(known).max()) or 1.0
        return -most, most
    low, high = float(known.min()), float(known.max())
    return (low, high) if high > low else (low, low + 1.0)


def classes(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.intp]:
    """Number of each value's colour, -1 where there is no value."""
    share = (values - low) / (high - low)
    number = np.clip(np.floor(np.nan_to_num(share) * CLASSES), 0, CLASSES - 1).astype(np.intp)
    return np.where(np.isfinite(values), number, -1)
