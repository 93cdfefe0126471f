"""What a fit knows of its unknowns: a normal distribution within their bounds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..materials.law import HypoelasticLaw
from .truncated import truncated_draws
from .unknowns import Unknowns

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Posterior:
    """The unknowns as the noise of the data leaves them.

    Parameters
    ----------
    unknowns : their order, units, bounds and inequalities.
    best : (n,) the best of them, which keep the inequalities.
    centre : (n,) where they would be without inequalities: where none binds, the best.
    covariance : (n, n) in the products of their units, without inequalities.
    """

    unknowns: Unknowns
    best: Array
    centre: Array
    covariance: Array

    @property
    def sigma(self) -> Array:
        """(n,) one standard deviation of each unknown, in its unit."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def coefficients(self) -> Array:
        """(size + nuisance, same): of the free coefficients, MPa, and the nuisance in its units."""
        n, size = self.unknowns.count, self.unknowns.size
        t = np.eye(n)
        t[:size, :size] = self.unknowns.to_coefficients
        return np.asarray(t @ self.covariance @ t.T)

    @property
    def of_law(self) -> Array:
        """(size, size) MPa^2, covariance of the law's free coefficients, in their order."""
        return self.coefficients[: self.unknowns.size, : self.unknowns.size]

    @property
    def labels(self) -> tuple[str, ...]:
        """Of the rows of `coefficients`."""
        return (*self.unknowns.labels, *self.unknowns.nuisance_names)

    @property
    def correlations(self) -> Array:
        """The same as `coefficients`, each in its own standard deviation: between -1 and 1."""
        sigma = np.sqrt(np.diag(self.coefficients))
        unit = np.where(sigma > 0, sigma, 1.0)
        return np.asarray(self.coefficients / unit / unit[:, None])

    def moved(self, step: Array, centre: Array, share: float) -> Posterior:
        """The same about other unknowns.

        Parameters
        ----------
        step : (n,) from the best to the other best. centre : (n,) the other centre. share : of the
            step, by which the other best is uncertain (one standard deviation).
        """
        covariance = self.covariance + share**2 * np.outer(step, step)
        return Posterior(self.unknowns, self.best + step, centre, covariance)

    def sample(self, count: int, random: np.random.Generator) -> Array:
        """`count` draws of all unknowns (count, n), all of which keep the inequalities.

        They are of the normal distribution within the inequalities (see `truncated`).
        """
        return truncated_draws(
            self.centre, self.covariance, self.unknowns.inequalities, self.best, count, random
        )

    def laws(
        self, law: HypoelasticLaw, count: int, random: np.random.Generator
    ) -> list[HypoelasticLaw]:
        """`count` laws as the data leave them, all within the bounds: `law` with other numbers."""
        return [self.unknowns.law(law, y) for y in self.sample(count, random)]
