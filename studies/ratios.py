"""A response at several nu12, relative to that at a base nu12 and to their mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Ratios:
    """A response at several nu12.

    values, to_base, to_mean : (n,) the response itself, relative to that at the base nu12, and
    relative to the mean of all n.
    """

    nu12: Array
    values: Array
    to_base: Array
    to_mean: Array

    @property
    def spread(self) -> tuple[float, float]:
        """Lowest and highest `to_base`, less one; NaN where no run ended."""
        known = self.to_base[np.isfinite(self.to_base)]
        return (float(known.min() - 1), float(known.max() - 1)) if len(known) else (np.nan, np.nan)


def ratios(nu12: Sequence[float], values: ArrayLike, base: float) -> Ratios:
    """Normalise a response (n,); NaN where a run failed, left out of the mean."""
    v = np.asarray(values, dtype=float)
    mean = float(np.mean(v[np.isfinite(v)])) if np.isfinite(v).any() else np.nan
    return Ratios(np.asarray(nu12, dtype=float), v, v / base, v / mean)


def by_response(
    nu12: Sequence[float],
    responses: Sequence[Mapping[str, float] | None],
    base: Mapping[str, float],
) -> dict[str, Ratios]:
    """Ratios of every response that the run at the base nu12 has.

    responses : of each nu12, by name; None where the run failed, without those it did not reach.
    """
    return {
        name: ratios(nu12, [np.nan if r is None else r.get(name, np.nan) for r in responses], value)
        for name, value in base.items()
    }
