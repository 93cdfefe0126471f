"""Kinds whose tests are read with their data: what they prepare, compare and report alike."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from ..errors import SolverFailure
from ..inference.comparison import Comparison
from ..inference.objective import NoiseIs, Objective
from ..lazy_modules import pandas as pd
from ..materials.law import HypoelasticLaw
from ..solvers.base import Array, History
from .base import BaseKind, BasePrepared, MakeSolver, Masks, PreparedTest, Reach, Weighting
from .fitted import FittedTest
from .forward import Runs

PERCENT = 100.0
#: Of one measured strain: what an extensometer, a camera or an encoder is good for.
USUAL_NOISE = 1e-4


class MeasuredKind(BaseKind):
    """A kind of test that is fitted, and read with its data. prepared : makes one of a test."""

    fitted: bool = True
    prepared: type[Any]

    def prepare(self, test: Any, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedTest:
        """Return the test, which was read with its data."""
        return cast(PreparedTest, self.prepared(test))


def compared(
    quantity: str, measured: ArrayLike, modelled: ArrayLike, unit: str, **where: Any
) -> pd.DataFrame:
    """Return a row a matched value: where it is, measured, modelled, and their difference."""
    values = {"quantity": quantity, "measured": measured, "modelled": modelled}
    table = pd.DataFrame({**where, **values})
    return table.assign(difference=table["modelled"] - table["measured"], unit=unit)


def errors_of_cards(
    runs: Runs, errors: Callable[[History], dict[str, Any]], words: Callable[[Any], str]
) -> tuple[dict[str, Any], list[str], dict[str, History]]:
    """Return numbers, lines and histories by card, of a test of one part; failures in words."""
    numbers = dict[str, Any]()
    lines = list[str]()
    good = dict[str, History]()
    for (name, _), run in runs.items():
        try:
            if isinstance(run.outcome, SolverFailure):
                raise run.outcome
            numbers[name] = errors(run.outcome)
            lines += [f"{name}: {words(numbers[name])}"] if numbers[name] else []
            good[name] = run.outcome
        except SolverFailure as failure:
            numbers[name] = {"failed": failure.reason}
            lines.append(f"{name}: failed: {failure.reason}")
    return numbers, lines, good


@dataclass(frozen=True, eq=False)
class PreparedWhole(BasePrepared):
    """A test, read with its data, that is matched whole."""

    test: Any

    def reach(self, masks: Masks) -> Reach:
        """Return the reach of the test."""
        return cast(Reach, self.test.reach)


@dataclass(frozen=True, eq=False)
class FittedPart:
    """One part of a finished fit: its data (a strip, a path) and the best law's response."""

    data: Any
    model: Any
    objective: Any
    history: History

    @property
    def rms(self) -> Any:
        """Return the RMS error, or those of its columns, in the unit of the data."""
        return self.objective.rms(self.history)


@dataclass(frozen=True, eq=False)
class PreparedParts(PreparedWhole):
    """A test of which each part (a strip, a ratio) has its comparison.
    test.matched : the data of the parts by name."""

    def part(self, name: str) -> str:
        """Return the name of the comparison of a part."""
        return f"{self.test.name}: {name}"

    def count(self, data: Any) -> int:
        """Return the number of values of a part that are matched."""
        return len(data.load)

    @property
    def full_masks(self) -> dict[str, Any]:
        """Return the masks that leave everything, by comparison."""
        parts = self.test.matched.items()
        return {self.part(name): np.ones(self.count(data), dtype=bool) for name, data in parts}

    def masks_without_each(self, sort: str) -> dict[str, dict[str, Masks]]:
        """Return masks without each part, by sort and name; nothing where there is one part."""
        full_masks = self.full_masks
        masks: dict[str, Masks] = {}
        for name in self.test.matched:
            part = self.part(name)
            masks[name] = {**full_masks, part: ~full_masks[part]}
        return {sort: masks} if len(masks) > 1 else {}

    def matched_parts(self, masks: Masks | None) -> dict[str, Any]:
        """Return the data of the parts in which masks leave anything to match, by name."""
        chosen = masks or {}
        return {
            name: data
            for name, data in self.test.matched.items()
            if chosen.get(self.part(name), np.True_).any()
        }

    def fitted_parts(self, fitted: FittedTest) -> tuple[FittedPart, ...]:
        """Return the data of each part of a fit, with what was found."""
        parts = zip(self.test.matched.values(), fitted.comparisons, fitted.histories, strict=True)
        return tuple(FittedPart(data, c.model, c.objective, history) for data, c, history in parts)

    def finer(
        self: Any, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """Return the comparisons with other elements, if any; increments hardly matter."""
        models = self.test.models(None, "elements", factor)
        parts = zip(self.test.matched, self.comparisons(make_solver, weighting), strict=True)
        return tuple(replace(comparison, model=models[name]) for name, comparison in parts)


class StrainObjective(Objective):
    """Residuals (model - measured) / (scale sqrt(n)) of columns of strain, one block each.

    Parameters
    ----------
    load : (rows, 2 or 3) array
    strain : (rows, blocks) array
        Measured.
    scale : float or None
        Strain in one unit of the residuals; None for the largest of each column.
    weight : float
        Of the error in the objective.
    noise : float or None
        Of one strain; that of a usual instrument unless given.

    Attributes
    ----------
    first_row : int
        From which rows are matched.
    """

    unit = "%"
    first_row = 0

    def __init__(
        self, load: Array, strain: Array, scale: float | None, weight: float, noise: float | None
    ) -> None:
        self.load = load
        self.strain = strain
        self.least_noise = PERCENT * (USUAL_NOISE if noise is None else noise)
        self.noise_is: NoiseIs = "assumed" if noise is None else "given"
        count = len(strain) - self.first_row
        blocks = strain.shape[1]
        self.sizes = (count,) * blocks
        scales = np.full(blocks, scale)
        if scale is None:
            scales = np.maximum(np.abs(self.measured).max(axis=0), USUAL_NOISE)
        self._unit = scales * np.sqrt(count) / max(weight, 1e-300)
        self.scale = PERCENT * np.repeat(self._unit, count)

    @property
    def measured(self) -> Array:
        """Return the measured strains (rows, blocks) from their zero on."""
        return self.strain

    @property
    def data(self) -> tuple[Array, ...]:
        return self.load, self.strain

    def modelled(self, history: History) -> Array:
        """Return the model's strains (rows, blocks) from their zero on."""
        raise NotImplementedError

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        return self.in_blocks(self.modelled(history) - self.measured)

    def shifted(self, external: History, surrogate: History) -> Self:
        objective = copy.copy(self)
        objective.strain = self.strain - (self.modelled(external) - self.modelled(surrogate))
        return objective

    def rms(self, history: History) -> Array:
        """Return the RMS error of each block, %."""
        difference = (self.modelled(history) - self.measured)[self.first_row :]
        return np.asarray(PERCENT * np.sqrt(np.mean(difference**2, axis=0)))

    def in_blocks(self, values: Array) -> Array:
        """Return values (rows, blocks, ...) block after block, in units of the residual."""
        rows = values[self.first_row :] / self._unit.reshape(1, -1, *(1,) * (values.ndim - 2))
        return np.asarray(np.swapaxes(rows, 0, 1).reshape(-1, *values.shape[2:]))
