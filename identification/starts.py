"""Where starts begin: at random, at the points of a Sobol sequence, or where earlier ones led.

Each gives the candidates of a start by its number alone, in order: the same on any machine, and
whichever other starts there are.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .draws import allowed, coefficients_at, dimensions, draw
from .unknowns import Unknowns

Array = NDArray[np.float64]

MOST_DRAWS = 200_000
BATCH = 500
#: Points of a Sobol sequence that are even in every box come in powers of two.
SOBOL_BATCH = 512
#: Random candidates among which the most promising is a proposed start, and evaluations that a
#: prediction is made of.
CANDIDATES, NEIGHBOURS = 64, 5
EXTRA = "scikit-learn is not installed; pip install 'bubblefit[proposals]'"


class Starts(Protocol):
    """A way to choose starts."""

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """Free coefficients (size,) MPa of allowed moduli, the one to begin at first."""
        ...


@dataclass(frozen=True)
class RandomStarts:
    """Every start is drawn by itself."""

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """As many as there are among 200,000 draws."""
        random = np.random.default_rng([seed, number])
        for _ in range(MOST_DRAWS // BATCH):
            draws = draw(unknowns, random, BATCH)
            yield from draws[allowed(unknowns, draws)]


@dataclass(frozen=True)
class SobolStarts:
    """Starts spread evenly: start k is allowed point k of the sequence that the seed scrambles.

    Where that cannot be analysed, random points follow.
    """

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """The point, and random ones after it."""
        from scipy.stats import qmc

        sequence, before = qmc.Sobol(dimensions(unknowns), seed=seed), 0
        for _ in range(MOST_DRAWS // SOBOL_BATCH):
            points = coefficients_at(unknowns, sequence.random(SOBOL_BATCH))
            good = points[allowed(unknowns, points)]
            if number < before + len(good):
                yield good[number - before]
                break
            before += len(good)
        yield from RandomStarts().candidates(unknowns, seed, number)


@dataclass(frozen=True, eq=False)
class ProposedStarts:
    """Starts where earlier evaluations of the same model were good.

    Start k is the one of 64 random candidates for which least is predicted: starts differ, since
    each has candidates of its own.

    Parameters
    ----------
    coefficients : (n, size) MPa, of the earlier evaluations. objectives : (n,).

    Raises
    ------
    InputError : scikit-learn is not installed.
    """

    coefficients: Array
    objectives: Array

    def __post_init__(self) -> None:
        try:
            import sklearn  # noqa: F401
        except ImportError:
            raise InputError(None, "fit.starts_from", EXTRA) from None

    def candidates(self, unknowns: Unknowns, seed: int, number: int) -> Iterator[Array]:
        """The most promising first."""
        random = RandomStarts().candidates(unknowns, seed, number)
        first = list(islice(random, CANDIDATES))
        if first:
            expected = self.predicted(unknowns, np.array(first))
            yield from (first[k] for k in np.argsort(expected, kind="stable"))
        yield from random

    def predicted(self, unknowns: Unknowns, coefficients: Array) -> Array:
        """(n,) decadic logarithm of the objective to be expected at coefficients (n, size)."""
        return np.asarray(self._regression(unknowns).predict(_places(unknowns, coefficients)))

    def _regression(self, unknowns: Unknowns) -> Any:
        from sklearn.neighbors import KNeighborsRegressor

        if "regression" not in self._made:
            near = KNeighborsRegressor(min(NEIGHBOURS, len(self.objectives)), weights="distance")
            values = np.log10(np.maximum(self.objectives, np.finfo(float).tiny))
            self._made["regression"] = near.fit(_places(unknowns, self.coefficients), values)
        return self._made["regression"]

    @cached_property
    def _made(self) -> dict[str, Any]:
        return {}


def _places(unknowns: Unknowns, coefficients: Array) -> Array:
    """(n, size) logarithm of the moduli at the control strains: equal steps mean equal ratios."""
    moduli = np.linalg.solve(unknowns.from_values, coefficients.T).T
    return np.asarray(np.log(np.maximum(moduli, 1e-6)))
