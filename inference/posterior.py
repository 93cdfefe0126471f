"""The posterior of a fit: a normal distribution of its unknowns within linear inequalities."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..materials.forms.base import Array
from ..materials.law import HypoelasticLaw
from .truncated_normal import TruncatedNormal
from .unknowns import Unknowns

DRAWS = 1000  # number of draws from which bands are made


@dataclass(frozen=True, eq=False)
class Posterior:
    """The distribution of the unknowns that the data leave: normal within linear inequalities.

    Attributes
    ----------
    unknowns : Unknowns
        Order, units, bounds and inequalities of the n unknowns.
    best : (n,) array
        Unknowns of the reported law, which keep the inequalities.
    centre : (n,) array
        Mean of the normal distribution without its inequalities; it equals `best` unless one of
        them is active there.
    covariance : (n, n) array
        Covariance of the normal distribution without its inequalities.
    """

    unknowns: Unknowns
    best: Array
    centre: Array
    covariance: Array

    @cached_property
    def coefficient_covariance(self) -> Array:
        """Return the covariance (n, n) of the free coefficients, MPa, and nuisance parameters."""
        n = self.unknowns.count
        size = self.unknowns.size
        t = np.eye(n)
        t[:size, :size] = self.unknowns.to_coefficients
        return t @ self.covariance @ t.T

    @property
    def labels(self) -> tuple[str, ...]:
        """Return the labels of the rows of `coefficient_covariance`."""
        return (*self.unknowns.labels, *self.unknowns.nuisance.names)

    @property
    def correlations(self) -> Array:
        """Return the correlation matrix (n, n) of the covariance `coefficient_covariance`."""
        sigma = np.sqrt(np.diag(self.coefficient_covariance))
        unit = np.where(sigma > 0, sigma, 1.0)
        return self.coefficient_covariance / unit / unit[:, None]

    def shifted(self, step: Array, centre: Array, share: float) -> Posterior:
        """Return the posterior about other unknowns, with an uncertainty of the step to them.

        Parameters
        ----------
        step : (n,) array
            Change from `best` to the best of the returned posterior.
        centre : (n,) array
            Centre of the returned posterior.
        share : float
            Standard deviation of the step, as a share of it.
        """
        covariance = self.covariance + share**2 * np.outer(step, step)
        best = self.best + step
        return replace(self, best=best, centre=centre, covariance=covariance)

    def with_information(self, information: Array) -> Posterior:
        """Return the posterior after further independent data that agree with the best.

        Parameters
        ----------
        information : (size, size) array
            Fisher information of those data on the unknowns of the law (`information.py`).
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

    def modulus_samples(self, name: str, strain: Array) -> Array:
        """Return samples of a modulus from the distribution.

        Parameters
        ----------
        name : str
            "E1", "E2" or "G12".
        strain : (n,) array
            Log strains.

        Returns
        -------
        (DRAWS, n) array, MPa
            Samples of the modulus at each strain, see `TruncatedNormal.values`.
        """
        rows = self.unknowns.modulus_rows(name, strain)
        return self.distribution.values(rows, self._draws)

    def laws(
        self, law: HypoelasticLaw, count: int, random: np.random.Generator
    ) -> list[HypoelasticLaw]:
        """Return random laws from the distribution, all within the bounds.

        Parameters
        ----------
        law : HypoelasticLaw
            Law from which all is taken that is no unknown of the fit.
        count : int
            Number of laws.
        random : Generator
        """
        return [self.unknowns.law(law, y) for y in self.sample(count, random)]
