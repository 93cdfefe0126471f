"""Nuisance: unknowns of a fit beside the moduli, as an offset, a pressure or the thickness."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..materials.forms.base import Array

Positions = NDArray[np.intp]


@dataclass(frozen=True)
class Nuisance:
    """An unknown beside the moduli, of one comparison or shared by all.

    Attributes
    ----------
    name : str
        As the objective of the comparison knows it, or of a parameter of the model or the law.
    lower, upper : float
        Bounds, in `unit`.
    unit : str
    model_parameter : str, optional
        The parameter of the model that takes the difference from `start`.
    scale : float
        Units of the model in one `unit`.
    prior : float, optional
        One standard deviation around `start`, in `unit`.
    weight : float
        Residual of a value that is one prior away from `start`.
    start : float
        Value without any correction, in `unit`.
    begin : float, optional
        Value at which a fit begins, `start` by default.
    law_parameter : str, optional
        Number of the law beside its beta, as "nu12".
    shared : bool
        Whether all comparisons have the same value.
    hint : str
        Advice where the data say nothing of it.
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
    begin: float | None = None
    law_parameter: str | None = None
    shared: bool = False
    hint: str = ""


@dataclass(frozen=True, eq=False)
class NuisanceUnknowns:
    """The nuisance of all comparisons: what they share, then comparison by comparison.

    Attributes
    ----------
    comparisons : mapping of tuples of Nuisance
        By the name of the comparison.
    """

    comparisons: Mapping[str, tuple[Nuisance, ...]] = field(default_factory=dict)

    @cached_property
    def shared(self) -> tuple[Nuisance, ...]:
        """Return those that several comparisons share, once each."""
        by_name: dict[str, Nuisance] = {}
        for nuisances in self.comparisons.values():
            by_name.update((nuisance.name, nuisance) for nuisance in nuisances if nuisance.shared)
        return tuple(by_name.values())

    @cached_property
    def all(self) -> tuple[Nuisance, ...]:
        """Return all in the order of the unknowns."""
        separate = [
            nuisance
            for nuisances in self.comparisons.values()
            for nuisance in nuisances
            if not nuisance.shared
        ]
        return (*self.shared, *separate)

    @property
    def names(self) -> tuple[str, ...]:
        """Return all names, after that of the comparison where there are several of these."""
        has_several = len(self.comparisons) > 1
        separate = tuple(
            f"{comparison}: {nuisance.name}" if has_several else nuisance.name
            for comparison, nuisances in self.comparisons.items()
            for nuisance in nuisances
            if not nuisance.shared
        )
        return (*(nuisance.name for nuisance in self.shared), *separate)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Return lower and upper bounds, (n,) each."""
        return np.array([n.lower for n in self.all]), np.array([n.upper for n in self.all])

    @property
    def start(self) -> Array:
        """Return the values (n,) without any correction."""
        return np.array([n.start for n in self.all])

    @property
    def begin(self) -> Array:
        """Return the values (n,) at which a fit begins."""
        return np.array([n.start if n.begin is None else n.begin for n in self.all])

    @property
    def priors(self) -> tuple[Positions, Array]:
        """Return the position of each that has a prior, and the residual of one unit of it."""
        with_prior = [
            (k, n.weight / n.prior) for k, n in enumerate(self.all) if n.prior is not None
        ]
        positions = np.array([k for k, _ in with_prior], dtype=np.intp)
        return positions, np.array([residual for _, residual in with_prior])

    def positions(self, comparison: str) -> Positions:
        """Return the positions of the nuisance of a comparison, in its order."""
        shared_position = {nuisance.name: k for k, nuisance in enumerate(self.shared)}
        positions = []
        separate_position = len(self.shared)
        for name, nuisances in self.comparisons.items():
            for nuisance in nuisances:
                if name == comparison:
                    position = separate_position
                    if nuisance.shared:
                        position = shared_position[nuisance.name]
                    positions.append(position)
                if not nuisance.shared:
                    separate_position += 1
        return np.array(positions, dtype=np.intp)

    def values(self, comparison: str, all_values: Array) -> dict[str, float]:
        """Return the nuisance of a comparison by plain name from the values (n,) of all."""
        names = [nuisance.name for nuisance in self.comparisons.get(comparison, ())]
        values = all_values[self.positions(comparison)].tolist()
        return dict(zip(names, values, strict=True))

    def of_law(self, all_values: Array) -> dict[str, float]:
        """Return the unknown numbers of the law by name, clipped to their bounds (steps round)."""
        return {
            nuisance.law_parameter: float(np.clip(all_values[k], nuisance.lower, nuisance.upper))
            for k, nuisance in enumerate(self.shared)
            if nuisance.law_parameter is not None
        }
