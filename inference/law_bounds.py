"""Bounds that a fit keeps: of the moduli or the coefficients of a law, and of its work."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..materials.forms.base import Array, LawForm


@dataclass(frozen=True, eq=False)
class LawBounds:
    """Bounds of the moduli or of the coefficients of a law, and of the work of closed paths.

    Attributes
    ----------
    smallest : mapping of float, MPa
        Smallest value of each modulus ("E1", "E2", "G12") anywhere on the strain range, and of the
        form's other constants, if it has any with bounds.
    largest : mapping of float, MPa, optional
        Largest values likewise; None where the coefficients are bounded instead.
    lower, upper : (free,) arrays, MPa, optional
        Bounds of the free coefficients; None where the moduli are bounded.
    work : float
        Largest work that the law may do along a closed path of strain, as a share of the work of
        loading (`ClosedPath.share`).
    """

    smallest: Mapping[str, float]
    largest: Mapping[str, float] | None = None
    lower: Array | None = None
    upper: Array | None = None
    work: float = np.inf

    @classmethod
    def of_moduli(cls, ranges: Mapping[str, tuple[float, float]]) -> LawBounds:
        """Return bounds of the moduli from (smallest, largest) of each, MPa."""
        return cls(
            {name: float(low) for name, (low, _) in ranges.items()},
            {name: float(high) for name, (_, high) in ranges.items()},
        )

    def with_constants(self, ranges: Mapping[str, tuple[float, float]]) -> LawBounds:
        """Return these bounds and those of a form's own constants, (smallest, largest) in MPa."""
        smallest = {name: low for name, (low, _) in ranges.items()}
        smallest.update(self.smallest)
        largest = None
        if self.largest is not None:
            largest = {name: high for name, (_, high) in ranges.items()}
            largest.update(self.largest)
        return replace(self, smallest=smallest, largest=largest)

    def at_control_strains(self, form: LawForm) -> tuple[Array, Array]:
        """Return the smallest and largest moduli (free,) at the form's control strains, MPa."""
        assert self.largest is not None
        smallest = np.array([self.smallest[name] for name in form.modulus_of])
        return smallest, np.array([self.largest[name] for name in form.modulus_of])
