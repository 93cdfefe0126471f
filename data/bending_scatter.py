"""Repetitions of a bending test together, and how far a model is from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .bending import BendingCurve

Array = NDArray[np.float64]

PLACES = 61  # of the grid


@dataclass(frozen=True, eq=False)
class BendingScatter:
    """Repetitions on one grid of deflections (k,) mm.

    mean, deviation : (k,) N over the repetitions that reach so far; the deviation is NaN where
    that is one. count : (k,) how many do.
    """

    deflection: Array
    mean: Array
    deviation: Array
    count: NDArray[np.intp]


@dataclass(frozen=True)
class BendingError:
    """How far a model's curve is from all readings that it reaches.

    rms, mean : N; the mean is positive where the model is too stiff. relative : rms over the
    largest load among these readings. compared, beyond : readings up to the model's last
    deflection, and after it.
    """

    rms: float
    mean: float
    relative: float
    compared: int
    beyond: int


def scatter(curves: Sequence[BendingCurve], places: int = PLACES) -> BendingScatter:
    """Mean and sample standard deviation of the repetitions, interpolated between readings.

    The grid goes from the smallest to the largest deflection read.

    Raises
    ------
    ValueError : no curves.
    """
    if not curves:
        raise ValueError("scatter: no repetitions")
    low = min(float(c.deflection[0]) for c in curves)
    high = max(float(c.deflection[-1]) for c in curves)
    grid = np.linspace(low, high, places)
    loads = np.array([np.interp(grid, *_single(c), left=np.nan, right=np.nan) for c in curves])
    there = np.isfinite(loads)
    count = there.sum(axis=0)
    total = np.where(there, loads, 0.0).sum(axis=0)
    mean = np.divide(total, count, out=np.full(places, np.nan), where=count > 0)
    square = (np.where(there, loads - mean, 0.0) ** 2).sum(axis=0)
    variance = np.divide(square, count - 1, out=np.full(places, np.nan), where=count > 1)
    return BendingScatter(grid, mean, np.sqrt(variance), count)


def model_error(
    curves: Sequence[BendingCurve], deflection: ArrayLike, load: ArrayLike
) -> BendingError | None:
    """The model's load less that read, at every reading from zero to the model's end.

    Parameters
    ----------
    deflection, load : (frames,) mm, rising, and N, of the model.

    Returns
    -------
    None where the model reaches no reading of a load.
    """
    x, y = np.asarray(deflection, dtype=float), np.asarray(load, dtype=float)
    way = np.concatenate([c.deflection for c in curves]) if curves else np.empty(0)
    read = np.concatenate([c.load for c in curves]) if curves else np.empty(0)
    inside = (way >= x[0]) & (way <= x[-1])
    largest = float(np.abs(read[inside]).max(initial=0.0))
    if not largest > 0:
        return None
    off = np.interp(way[inside], x, y) - read[inside]
    rms = float(np.sqrt(np.mean(off**2)))
    return BendingError(
        rms, float(off.mean()), rms / largest, int(inside.sum()), int((way > x[-1]).sum())
    )


def _single(curve: BendingCurve) -> tuple[Array, Array]:
    """Deflections without repeats, with the mean load of each."""
    x, whose = np.unique(curve.deflection, return_inverse=True)
    return x, np.bincount(whose, curve.load) / np.bincount(whose)
