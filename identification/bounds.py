"""What a fit allows the law: bounds on its moduli, or on the numbers that make them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..materials.forms.base import Form

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LawBounds:
    """Bounds of a law's numbers; made by `of_moduli` or `of_entries`.

    Parameters
    ----------
    least : MPa, by modulus: nowhere on the strain range may it be less.
    largest : MPa, by modulus: nor may it be more; None where the coefficients are bounded.
    lower, upper : (free,) MPa, of the free coefficients; None where the moduli are bounded.
    """

    least: Mapping[str, float]
    largest: Mapping[str, float] | None = None
    lower: Array | None = None
    upper: Array | None = None

    @classmethod
    def of_moduli(cls, ranges: Mapping[str, tuple[float, float]]) -> LawBounds:
        """Every modulus between its (least, largest), MPa; starts are drawn from modulus values.

        Raises
        ------
        InputError : a least modulus that is not positive and below the largest.
        """
        for name, (low, high) in ranges.items():
            if not 0 < low < high:
                problem = f"expected 0 < least < largest, got [{low:g}, {high:g}]"
                raise InputError(None, f"bounds.{name}", problem)
        return cls(
            {name: float(low) for name, (low, _) in ranges.items()},
            {name: float(high) for name, (_, high) in ranges.items()},
        )

    @classmethod
    def of_entries(
        cls, lower: ArrayLike, upper: ArrayLike, margins: Mapping[str, float]
    ) -> LawBounds:
        """Every coefficient between `lower` and `upper` (free,) MPa; starts are drawn from there.

        margins : MPa, by modulus, the least that it may be anywhere on the strain range.

        Raises
        ------
        InputError : a lower bound above its upper one.
        """
        low, high = np.array(lower, dtype=float), np.array(upper, dtype=float)
        if low.shape != high.shape or not (low <= high).all():
            problem = f"expected lower <= upper, got {low.tolist()} and {high.tolist()}"
            raise InputError(None, "bounds", problem)
        return cls(dict(margins), None, low, high)

    def check(self, form: Form) -> None:
        """Say what does not go with a form.

        Raises
        ------
        InputError : a modulus without bounds, or bounds of another number of coefficients.
        """
        missing = [name for name in dict.fromkeys(form.modulus_of) if name not in self.least]
        if missing:
            raise InputError(None, f"bounds.{missing[0]}", "this key is missing; add it")
        count = len(form.free)
        if self.lower is not None and self.lower.shape != (count,):
            problem = f"expected {count} of a {form.name} law, got {len(self.lower)}"
            raise InputError(None, "bounds.lower", problem)

    def box(self, form: Form, from_values: Array) -> tuple[Array, Array]:
        """Lower and upper (free,) of the free coefficients, MPa.

        Where the moduli are bounded this is the smallest box that holds every law whose moduli
        are between their bounds at the form's control strains.
        """
        if self.lower is not None and self.upper is not None:
            return self.lower, self.upper
        ends = self.control(form)
        low, high = from_values * ends[0], from_values * ends[1]
        return np.minimum(low, high).sum(axis=1), np.maximum(low, high).sum(axis=1)

    def control(self, form: Form) -> tuple[Array, Array]:
        """Least and largest (free,) modulus at the form's control strains, MPa."""
        assert self.largest is not None
        least = np.array([self.least[name] for name in form.modulus_of])
        return least, np.array([self.largest[name] for name in form.modulus_of])
