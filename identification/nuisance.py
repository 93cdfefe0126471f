"""Unknowns beside the moduli: of one comparison (an offset, a pressure), or shared by all of them.

Shared are what the fabric has one of: Poisson's ratio, thickness.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


@dataclass(frozen=True)
class Nuisance:
    """An unknown beside the moduli: not wanted for itself, but the data hang on it.

    Parameters
    ----------
    name : as its objective knows it ("offset_z"), or of a parameter of the model or the law.
    lower, upper : its bounds, in `unit`.
    unit : of its values ("mm", "kPa").
    model_parameter : which of the model's `parameters` it is: `with_parameters` of the model takes
        how far it is from `start`, and a solver that differentiates does so by it. None where only
        the objective, or the law, knows of it.
    scale : the model's units in one `unit` (1e-3 from kPa to MPa).
    prior : one standard deviation around `start` of what is known of it before the data, in `unit`;
        None: nothing. weight : residual of a value that far away.
    start : from which a fit starts.
    law_parameter : which number of the law it is, beside its beta: "nu12".
    shared : one for all comparisons of a fit that have it, by its name; else each has its own.
    why : what to say where the data say nothing of it.
    """

    name: str
    lower: float
    upper: float
    unit: str
    model_parameter: str | None = None
    scale: float = 1.0
    prior: float | None = None
    weight: float = 0.0
    start: float = 0.0
    law_parameter: str | None = None
    shared: bool = False
    why: str = ""


@dataclass(frozen=True, eq=False)
class NuisanceOf:
    """The nuisance of all comparisons of a fit: what they share, then laid end to end.

    Parameters
    ----------
    comparisons : by name, in their order; those without nuisance are named too.
    """

    comparisons: Mapping[str, tuple[Nuisance, ...]] = field(default_factory=dict)

    @cached_property
    def shared(self) -> tuple[Nuisance, ...]:
        """What several comparisons may share, each once."""
        every = (n for own in self.comparisons.values() for n in own if n.shared)
        return tuple({n.name: n for n in every}.values())

    @cached_property
    def all(self) -> tuple[Nuisance, ...]:
        """What is shared, then what each comparison has of its own."""
        own = (n for several in self.comparisons.values() for n in several if not n.shared)
        return (*self.shared, *own)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all; one of its own with the comparison's name before it where there are several."""
        several = len(self.comparisons) > 1
        own = tuple(
            f"{comparison}: {n.name}" if several else n.name
            for comparison, nuisance in self.comparisons.items()
            for n in nuisance
            if not n.shared
        )
        return (*(n.name for n in self.shared), *own)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of all, in their units."""
        return np.array([n.lower for n in self.all]), np.array([n.upper for n in self.all])

    @property
    def start(self) -> Array:
        """From where a fit starts, of all, in their units."""
        return np.array([n.start for n in self.all])

    @property
    def priors(self) -> tuple[Numbers, Array]:
        """Number of each that has a prior, and residual of one unit of it."""
        known = [(k, n.weight / n.prior) for k, n in enumerate(self.all) if n.prior is not None]
        return np.array([k for k, _ in known], dtype=np.intp), np.array([c for _, c in known])

    def places(self, comparison: str) -> Numbers:
        """Where the nuisance of a comparison lies, in its order."""
        found, first = [], len(self.shared)
        shared = {n.name: k for k, n in enumerate(self.shared)}
        for name, nuisance in self.comparisons.items():
            for n in nuisance:
                if name == comparison:
                    found.append(shared[n.name] if n.shared else first)
                first += not n.shared
        return np.array(found, dtype=np.intp)

    def values(self, comparison: str, all_values: Array) -> dict[str, float]:
        """The nuisance of a comparison by plain name, from the values of all, in their units."""
        own = self.comparisons.get(comparison, ())
        values = all_values[self.places(comparison)].tolist()
        return dict(zip((n.name for n in own), values, strict=True))

    def of_law(self, all_values: Array) -> dict[str, float]:
        """The numbers of the law that are unknown, by its names, from the values of all.

        Within their bounds: a step keeps them but for rounding, and a law may end there.
        """
        return {
            n.law_parameter: float(np.clip(all_values[k], n.lower, n.upper))
            for k, n in enumerate(self.shared)
            if n.law_parameter is not None
        }
