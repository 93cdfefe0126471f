"""The posterior of a fit: a normal distribution of its unknowns within linear inequalities."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from .truncated_normal import TruncatedNormal
from .unknowns import Unknowns

DRAWS = 1000  # of which bands are made


@dataclass(frozen=True, eq=False)
class Posterior:
    """The unknowns as the noise of the data leaves them: normal, within their inequalities.

    Attributes
    ----------
    unknowns : Unknowns
        Their order, units, bounds and inequalities.
    best : (n,) array
        Keeps the inequalities.
    centre : (n,) array
        Mean without inequalities: where none binds, `best`.
    covariance : (n, n) array
        Without inequalities.
    """

    unknowns: Unknowns
    best: Array
    centre: Array
    covariance: Array

    @cached_property
    def coefficients(self) -> Array:
        """Return the covariance of the free coefficients, MPa, and of the nuisance in its units."""
        n = self.unknowns.count
        size = self.unknowns.size
        t = np.eye(n)
        t[:size, :size] = self.unknowns.to_coefficients
        return np.asarray(t @ self.covariance @ t.T)

    @property
    def labels(self) -> tuple[str, ...]:
        """Return the labels of the rows of `coefficients`."""
        return (*self.unknowns.labels, *self.unknowns.nuisance.names)

    @property
    def correlations(self) -> Array:
        """Return the correlations that belong to `coefficients`."""
        sigma = np.sqrt(np.diag(self.coefficients))
        unit = np.where(sigma > 0, sigma, 1.0)
        return np.asarray(self.coefficients / unit / unit[:, None])

    def shifted(self, step: Array, centre: Array, share: float) -> Posterior:
        """Return the posterior about another best and centre.

        Parameters
        ----------
        step : (n,) array
            From `best` to the other one.
        centre : (n,) array
        share : float
            Of the step, by which the other best is uncertain (one standard deviation).
        """
        covariance = self.covariance + share**2 * np.outer(step, step)
        return Posterior(self.unknowns, self.best + step, centre, covariance)

    def with_information(self, information: Array) -> Posterior:
        """Return the posterior with independent data that agree with the best.

        Parameters
        ----------
        information : (size, size) array
            Fisher information of those data on the unknowns of the law.
        """
        size = self.unknowns.size
        count = self.unknowns.count
        values, axes = np.linalg.eigh(information)
        slopes = np.zeros((count, size))
        slopes[:size] = axes * np.sqrt(np.maximum(values, 0.0))
        cross_covariance = self.covariance @ slopes
        data_covariance = np.eye(size) + slopes.T @ cross_covariance
        gain = np.linalg.solve(data_covariance, cross_covariance.T).T
        covariance = self.covariance - gain @ cross_covariance.T
        centre = self.centre - gain @ (slopes.T @ (self.centre - self.best))
        covariance = 0.5 * (covariance + covariance.T)
        return Posterior(self.unknowns, self.best, np.asarray(centre), covariance)

    @cached_property
    def distribution(self) -> TruncatedNormal:
        """Return the distribution of the unknowns within bounds and inequalities."""
        rows, limits = self.unknowns.inequalities
        work_rows, work_limits = self.unknowns.work_rows(self.best)
        a = np.concatenate([rows, work_rows])
        c = np.concatenate([limits, work_limits])
        c = np.minimum(c, a @ self.best)  # steps of a fit keep off the bound of the work
        return TruncatedNormal.of(self.centre, self.covariance, (a, c), self.best)

    def sample(self, count: int, random: np.random.Generator) -> Array:
        """Return draws of all unknowns, all of which keep the inequalities.

        Parameters
        ----------
        count : int
        random : Generator

        Returns
        -------
        (count, n) array
        """
        return self.distribution.y(self.distribution.draw(count, random))

    @cached_property
    def _draws(self) -> Array:
        """Return `DRAWS` draws, always the same ones, of the standardised unknowns."""
        return self.distribution.draw(DRAWS, np.random.default_rng(0))

    @property
    def law_draws(self) -> Array:
        """Return `DRAWS` draws of the law's unknowns, always the same ones."""
        return self.distribution.y(self._draws)[:, : self.unknowns.size]

    def moduli(self, name: str, strain: Array) -> Array:
        """Return values of a modulus of the law's distribution.

        Parameters
        ----------
        name : str
        strain : (n,) array, logarithmic

        Returns
        -------
        (DRAWS, n) array, MPa
        """
        unknowns = self.unknowns
        rows = np.zeros((len(strain), unknowns.count))
        rows[:, : unknowns.size] = unknowns.rows(name, strain) @ unknowns.to_coefficients
        return self.distribution.values(rows, self._draws)

    def laws(
        self, law: HypoelasticLaw, count: int, random: np.random.Generator
    ) -> list[HypoelasticLaw]:
        """Return random laws that the data allow, all within the bounds.

        Parameters
        ----------
        law : HypoelasticLaw
            Gives all numbers that are not unknown.
        count : int
        random : Generator
        """
        return [self.unknowns.law(law, y) for y in self.sample(count, random)]
