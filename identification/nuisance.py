"""Unknowns that belong to one comparison, beside those of the law: an offset, a pressure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Nuisance:
    """An unknown of one comparison: not wanted for itself, but the data hang on it.

    Parameters
    ----------
    name : as its objective knows it ("offset_z"), or of a parameter of the model.
    lower, upper : its bounds, in `unit`. A fit starts from zero.
    unit : of its values ("mm", "kPa").
    model_parameter : which of the model's `parameters` it is: `with_parameters` of the model takes
        it, and a solver that differentiates does so by it. None where only the objective knows of
        it.
    scale : the model's units in one `unit` (1e-3 from kPa to MPa).
    prior : one standard deviation around zero of what is known of it before the data, in `unit`;
        None: nothing. weight : residual of a value as large as that.
    """

    name: str
    lower: float
    upper: float
    unit: str
    model_parameter: str | None = None
    scale: float = 1.0
    prior: float | None = None
    weight: float = 0.0


@dataclass(frozen=True, eq=False)
class NuisanceOf:
    """The nuisance of all comparisons of a fit, laid end to end.

    Parameters
    ----------
    comparisons : by name, in their order; those without nuisance are named too.
    """

    comparisons: Mapping[str, tuple[Nuisance, ...]] = field(default_factory=dict)

    @property
    def all(self) -> tuple[Nuisance, ...]:
        """Of all comparisons."""
        return tuple(n for own in self.comparisons.values() for n in own)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all, with the name of the comparison before it where there are several."""
        several = len(self.comparisons) > 1
        return tuple(
            f"{comparison}: {n.name}" if several else n.name
            for comparison, own in self.comparisons.items()
            for n in own
        )

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of all, in their units."""
        return np.array([n.lower for n in self.all]), np.array([n.upper for n in self.all])

    @property
    def priors(self) -> tuple[NDArray[np.intp], Array]:
        """Number of each that has a prior, and residual of one unit of it."""
        known = [(k, n.weight / n.prior) for k, n in enumerate(self.all) if n.prior is not None]
        return np.array([k for k, _ in known], dtype=np.intp), np.array([c for _, c in known])

    def places(self, comparison: str) -> slice:
        """Where the nuisance of a comparison lies."""
        first = 0
        for name, own in self.comparisons.items():
            if name == comparison:
                return slice(first, first + len(own))
            first += len(own)
        return slice(first, first)

    def values(self, comparison: str, all_values: Array) -> dict[str, float]:
        """The nuisance of a comparison by plain name, from the values of all, in their units."""
        own = self.comparisons.get(comparison, ())
        values = all_values[self.places(comparison)].tolist()
        return dict(zip((n.name for n in own), values, strict=True))
