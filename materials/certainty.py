"""How sure a card is: laws one standard deviation off, along directions independent of each other.

The covariance of the free coefficients is the sum of the products of the directions with
themselves. Kept like that it is never indefinite, and the first directions are those in which the
moduli are least certain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .forms.base import COMPONENTS, UNLIMITED, ratios_of
from .law import HypoelasticLaw

Array = NDArray[np.float64]

#: Share of a normal distribution inside a band, and standard deviations to its ends.
LEVEL, BAND = 0.95, 1.96
#: Of the largest: a direction in which the moduli are so much surer is left out.
SMALLEST = 1e-6
#: Strains a modulus at which directions are weighed and laws looked at.
PLACES = 41
#: Draws for each law that is asked for, before it is given up.
TRIES = 200


@dataclass(frozen=True, eq=False)
class CardCertainty:
    """What a fit leaves open of its law.

    directions : (k, free) MPa, one standard deviation each, of the free coefficients in their
    order; the least certain first. words : what is in them, and of what.
    """

    directions: Array
    words: str = ""

    @property
    def covariance(self) -> Array:
        """(free, free) MPa^2, of the law's free coefficients."""
        return np.asarray(self.directions.T @ self.directions)

    def sigma(self, law: HypoelasticLaw, name: str, strain: ArrayLike) -> Array:
        """(n,) MPa, one standard deviation of a modulus of the law at strains (n,)."""
        rows = law.modulus_rows(name, strain)[:, list(law.form.free)]
        return np.asarray(np.sqrt(((rows @ self.directions.T) ** 2).sum(axis=1)))

    def band(self, law: HypoelasticLaw, name: str, strain: ArrayLike) -> tuple[Array, Array]:
        """(n,) MPa each, lower and upper end of 95 % of a modulus; none is below zero."""
        modulus, off = law.modulus(name, strain), BAND * self.sigma(law, name, strain)
        return np.maximum(modulus - off, 0.0), modulus + off

    def shifted(self, law: HypoelasticLaw, along: ArrayLike) -> HypoelasticLaw:
        """The law off by so many standard deviations along each of the first directions."""
        steps = np.asarray(along, dtype=float)
        beta = law.beta.copy()
        beta[list(law.form.free)] += steps @ self.directions[: len(steps)]
        return law.with_beta(beta)

    def laws(
        self, law: HypoelasticLaw, count: int, random: np.random.Generator
    ) -> list[HypoelasticLaw]:
        """`count` laws, drawn from a normal distribution; only those of positive moduli.

        Raises
        ------
        ValueError : hardly any draw has them.
        """
        drawn: list[HypoelasticLaw] = []
        for _ in range(TRIES * count):
            if len(drawn) == count:
                break
            other = self.shifted(law, random.standard_normal(len(self.directions)))
            if positive(other):
                drawn.append(other)
        if len(drawn) < count:
            raise ValueError("hardly any law of this card's certainty has positive moduli")
        return drawn


def certainty_of(law: HypoelasticLaw, coefficients: Array, words: str = "") -> CardCertainty:
    """Of draws of the free coefficients (draws, free) MPa, about those of the law."""
    spread = (coefficients - law.beta[list(law.form.free)]) / np.sqrt(len(coefficients))
    relative = np.vstack(
        [
            law.modulus_rows(name, strain, ratio)[:, list(law.form.free)]
            / law.modulus(name, strain, ratio)[:, None]
            for name, strain in strains_of(law).items()
            for ratio in ratios_of(law.form, name)
        ]
    )
    _, sizes, turned = np.linalg.svd(relative @ spread.T, full_matrices=False)
    kept = turned[(sizes > SMALLEST * sizes[0]) & (sizes > 0)][: spread.shape[1]]
    return CardCertainty(np.asarray(kept @ spread), words)


def strains_of(law: HypoelasticLaw) -> dict[str, Array]:
    """Strains (n,) by modulus, up to where the law is known; zero alone where it has no end."""
    ends = {name: float(law.strain_range[c]) for name, c in COMPONENTS.items()}
    return {
        name: np.linspace(0.0, end, PLACES) if end < UNLIMITED else np.zeros(1)
        for name, end in ends.items()
    }


def positive(law: HypoelasticLaw) -> bool:
    """Whether every modulus is above zero as far as the law is known, at every load ratio."""
    return all(
        (law.modulus(name, strain, ratio) > 0).all()
        for name, strain in strains_of(law).items()
        for ratio in ratios_of(law.form, name)
    )


def words_of(tests: Sequence[str], values: int, mesh: bool) -> str:
    """What a card's certainty is of: noise, mesh, tests, number of values."""
    named = ", ".join(tests)
    also = "noise of the data and error of the mesh" if mesh else "noise of the data alone"
    return f"{also}; {values} values of {named}; the form of the law is taken for right"
