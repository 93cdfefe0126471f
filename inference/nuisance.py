"""Nuisance parameters: unknowns of a fit beside the moduli, as an offset or the thickness."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..light_dataclasses import dataclass
from ..materials.forms.base import Array

Positions = NDArray[np.intp]
#: Slopes by shared parameters, and the least value of their sum.
LinearCondition = tuple[Mapping[str, float], float]
#: Ratio of bounds from which on a value between them is drawn by its logarithm.
WIDE = 10.0


@dataclass(frozen=True)
class Nuisance:
    """A nuisance parameter, an unknown beside the moduli, of one comparison or shared by several.

    Attributes
    ----------
    name : str
        Name by which the objective of the comparison knows it, or that of a parameter of the model
        or the law.
    lower, upper : float
        Bounds, in `unit`.
    unit : str
    model_parameter : str, optional
        Parameter of the model that is changed by `scale` times (value - `start`).
    scale : float
        Units of the model in one `unit`.
    prior : float, optional
        Standard deviation with which it is known to be `start` before the test, in `unit`; None
        where only the bounds are known.
    weight : float
        Residual that the fit counts for a value one `prior` away from `start`.
    start : float
        Value that corrects nothing, in `unit`.
    begin : float, optional
        Value at which a fit begins, `start` by default.
    law_parameter : str, optional
        Name of a parameter of the law beside its beta, as "nu12".
    shared : bool
        Whether all comparisons that have it take the same value.
    hint : str
        Advice to the user where the data do not determine it.
    drawn : bool
        Whether random starts draw it within its bounds; otherwise they have it at `begin`.
    conditions : tuple of LinearCondition
        Linear conditions on shared parameters, itself among them.
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
    drawn: bool = False
    conditions: tuple[LinearCondition, ...] = ()


@dataclass(frozen=True, eq=False)
class NuisanceUnknowns:
    """The nuisance parameters of a fit: first those that comparisons share, then one by one.

    Attributes
    ----------
    comparisons : mapping of tuples of Nuisance
        Nuisance parameters of each comparison, by its name.
    """

    comparisons: Mapping[str, tuple[Nuisance, ...]] = field(default_factory=dict)

    @cached_property
    def shared(self) -> tuple[Nuisance, ...]:
        """Return the parameters that several comparisons share, once each."""
        by_name: dict[str, Nuisance] = {}
        for nuisances in self.comparisons.values():
            by_name.update((nuisance.name, nuisance) for nuisance in nuisances if nuisance.shared)
        return tuple(by_name.values())

    @cached_property
    def all(self) -> tuple[Nuisance, ...]:
        """Return all n parameters in the order of the unknowns."""
        separate = [
            nuisance
            for nuisances in self.comparisons.values()
            for nuisance in nuisances
            if not nuisance.shared
        ]
        return (*self.shared, *separate)

    @property
    def names(self) -> tuple[str, ...]:
        """Return all names; with several comparisons, "comparison: name" where not shared."""
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
    def conditions(self) -> tuple[Array, Array]:
        """Return A (conditions, n), c of the linear conditions A @ values >= c."""
        conditions = [condition for n in self.shared for condition in n.conditions]
        rows = np.zeros((len(conditions), len(self.all)))
        position = {nuisance.name: k for k, nuisance in enumerate(self.shared)}
        for row, (slopes, _) in zip(rows, conditions, strict=True):
            row[[position[name] for name in slopes]] = list(slopes.values())
        return rows, np.array([limit for _, limit in conditions])

    @property
    def start(self) -> Array:
        """Return the values (n,) that correct nothing."""
        return np.array([n.start for n in self.all])

    @property
    def begin(self) -> Array:
        """Return the values (n,) at which a fit begins."""
        return np.array([n.start if n.begin is None else n.begin for n in self.all])

    @property
    def priors(self) -> tuple[Positions, Array]:
        """Return the positions of those with a prior, and the residual per unit of each."""
        slope_at = {k: n.weight / n.prior for k, n in enumerate(self.all) if n.prior is not None}
        return np.array([*slope_at], dtype=np.intp), np.array([*slope_at.values()])

    def drawn(self, random: np.random.Generator) -> Array:
        """Return values (n,): those that starts draw within their bounds, by logarithm if wide."""
        values = self.begin
        for k, nuisance in enumerate(self.all):
            if nuisance.drawn:
                lower, upper = nuisance.lower, nuisance.upper
                share = random.random()
                is_wide = lower > 0 and upper > WIDE * lower
                values[k] = lower + share * (upper - lower)
                if is_wide:
                    values[k] = lower * (upper / lower) ** share
        return values

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
        """Return the values of one comparison's parameters by name.

        Parameters
        ----------
        comparison : str
            Name of the comparison.
        all_values : (n,) array
            Values of all nuisance parameters.
        """
        names = [nuisance.name for nuisance in self.comparisons.get(comparison, ())]
        values = all_values[self.positions(comparison)].tolist()
        return dict(zip(names, values, strict=True))

    def of_law(self, all_values: Array) -> dict[str, float]:
        """Return values of the law's unknown parameters by name.

        They are clipped to their bounds, which a step may miss by rounding.

        Parameters
        ----------
        all_values : (n,) array
            Values of all nuisance parameters.
        """
        return {
            nuisance.law_parameter: float(np.clip(all_values[k], nuisance.lower, nuisance.upper))
            for k, nuisance in enumerate(self.shared)
            if nuisance.law_parameter is not None
        }


def prior_weight(misfit: float, scale: Array, *, correlated: float = 20) -> float:
    """Return the residual that an unknown adds at one standard deviation of its prior.

    Parameters
    ----------
    misfit : float
        RMS of modelled less measured values that a good model has, in the unit of the data.
    scale : (m,) array
        Deviation of a value, in the unit of the data, that makes a residual of one.
    correlated : float
        Number of neighbouring points whose misfits are as good as equal, and count as one.
    """
    return float(misfit * np.sqrt(correlated) / np.median(scale))
