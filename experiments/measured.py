"""Base classes of kinds whose tests are read with their data: prepared tests, parts, objective."""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..errors import SolverFailure
from ..inference.comparison import Comparison
from ..inference.objective import NoiseIs, Objective
from ..lazy_modules import pandas as pd
from ..light_dataclasses import dataclass
from ..materials.law import HypoelasticLaw
from ..solvers.base import Array, History
from .base import (
    BaseKind,
    BasePrepared,
    FittedTest,
    MakeSolver,
    Masks,
    PreparedTest,
    Reach,
    Weighting,
)
from .data_files import DataFile
from .forward import Runs

PERCENT = 100.0
#: Standard deviation of one measured strain with a usual extensometer, camera or encoder.
USUAL_NOISE = 1e-4


class MeasuredKind(BaseKind):
    """Base class of kinds of test that can be fitted and whose tests are read with their data.

    `prepared` makes a prepared test of the test.
    """

    fitted: bool = True
    prepared: Callable[[Any], PreparedTest]

    def prepare(self, test: Any, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedTest:
        """Return the prepared test; its data were read with the test."""
        return self.prepared(test)


def compared(
    quantity: str,
    measured: ArrayLike,
    modelled: ArrayLike,
    unit: str,
    **where: Any,
) -> pd.DataFrame:
    """Return a table of residuals with a row for each matched value.

    Parameters
    ----------
    quantity : str
        What is compared.
    measured, modelled : (n,) array
        Values in `unit`.
    unit : str
    **where
        Leading columns of the table, which say where each value is.
    """
    values = {"quantity": quantity, "measured": measured, "modelled": modelled}
    table = pd.DataFrame({**where, **values})
    return table.assign(difference=table["modelled"] - table["measured"], unit=unit)


def errors_of_cards(
    runs: Runs, errors: Callable[[History], dict[str, Any]], words: Callable[[Any], str]
) -> tuple[dict[str, Any], list[str], dict[str, History]]:
    """Compare the runs of a test that has one part with its data, card by card.

    Parameters
    ----------
    runs : mapping
        Runs by (card, part).
    errors : callable
        Returns the numbers on one history; may raise SolverFailure.
    words : callable
        Returns a line on these numbers.

    Returns
    -------
    numbers : dict
        Numbers by card; for a run that failed, the reason.
    lines : list of str
        Lines for the terminal.
    good : dict
        Histories by card, without the runs that failed.
    """
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
    """A prepared test whose data were read with it, and which is matched as a whole."""

    test: Any

    def reach(self, masks: Masks) -> Reach:
        """Return the strains that the test's data reach, whatever the masks leave."""
        reach: Reach = self.test.reach
        return reach

    def data_files(self) -> Sequence[DataFile]:
        """Return the measured files of the test."""
        files: Sequence[DataFile] = self.test.data_files()
        return files


@dataclass(frozen=True, eq=False)
class FittedPart:
    """One part of a fitted test: its data (a strip, a path) and the response of the best law."""

    data: Any
    model: Any
    objective: Any
    history: History

    @property
    def rms(self) -> Any:
        """Return the RMS error of the part, or of each of its columns, in the objective's unit."""
        return self.objective.rms(self.history)


@dataclass(frozen=True, eq=False)
class PreparedParts(PreparedWhole):
    """A prepared test of which each part (a strip, a load ratio) has a comparison of its own.

    `test.matched` holds the data of the parts by name.
    """

    def part(self, name: str) -> str:
        """Return the name of the comparison of a part."""
        return f"{self.test.name}: {name}"

    def count(self, data: Any) -> int:
        """Return the number of values of a part that are matched."""
        return len(data.load)

    @property
    def full_masks(self) -> dict[str, Any]:
        """Return the masks that keep all points, by name of the comparison."""
        parts = self.test.matched.items()
        return {self.part(name): np.ones(self.count(data), dtype=bool) for name, data in parts}

    def masks_without_each(self, sort: str) -> dict[str, dict[str, Masks]]:
        """Return the masks that leave out each part, by sort and by name of the part.

        Parameters
        ----------
        sort : str
            What the parts are called. The mapping is empty where there is only one part.
        """
        full_masks = self.full_masks
        masks: dict[str, Masks] = {}
        for name in self.test.matched:
            part = self.part(name)
            masks[name] = {**full_masks, part: ~full_masks[part]}
        return {sort: masks} if len(masks) > 1 else {}

    def matched_parts(self, masks: Masks | None) -> dict[str, Any]:
        """Return the data, by name, of the parts of which masks keep at least one point."""
        chosen = masks or {}
        return {
            name: data
            for name, data in self.test.matched.items()
            if chosen.get(self.part(name), np.True_).any()
        }

    def fitted_parts(self, fitted: FittedTest) -> tuple[FittedPart, ...]:
        """Return each part of the test with its data and the response of the fitted law."""
        parts = zip(self.test.matched.values(), fitted.comparisons, fitted.histories, strict=True)
        return tuple(
            FittedPart(data, c.model, c.objective.at(fitted.nuisance), history)
            for data, c, history in parts
        )

    def finer(
        self: Any, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """Return the comparisons with edges of elements divided by a factor.

        Models without elements stay, and so do increments, which hardly matter.
        """
        models = self.test.models(None, "elements", factor)
        parts = zip(self.test.matched, self.comparisons(make_solver, weighting), strict=True)
        return tuple(replace(comparison, model=models[name]) for name, comparison in parts)


class LoadsObjective(Objective):
    """Residuals (model - measured) / scale of values that are linear in the loads of a history.

    Attributes
    ----------
    load : (n,) array
        Measured values, in `unit`.
    """

    load: Array

    @abstractmethod
    def compared_values(self, loads: Array) -> Array:
        """Return the compared values (n, ...) of loads (frames, ...), or of their derivatives."""

    @property
    def measured(self) -> Array:
        """Return the measured values, (n,)."""
        return self.load

    def modelled(self, history: History) -> Array:
        """Return the modelled values, (n,)."""
        return self.compared_values(history.load)

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        """Return the residuals, (n,)."""
        return (self.at(nuisance or {}).modelled(history) - self.measured) / self.scale

    def jacobian(self, history: History, slope: Array) -> Array:
        """Return the derivatives of the residuals by the parameters, (n, parameters).

        They follow from `history.load_slope`; `slope`, of the displacements, is not used.
        """
        assert history.load_slope is not None
        return self.compared_values(history.load_slope) / self.scale[:, None]

    def rms(self, history: History) -> float:
        """Return the RMS error in `unit`, whatever the scale and the weight."""
        return float(np.sqrt(np.mean((self.modelled(history) - self.measured) ** 2)))

    def shifted(self, external: History, surrogate: History) -> Self:
        """Return an objective in which a surrogate model stands for an external solver.

        The measured values are shifted by the difference between the values of both.
        """
        objective = copy.copy(self)
        objective.load = self.load - self.compared_values(external.load - surrogate.load)
        return objective


class StrainObjective(Objective):
    """The residual of measured strains: weight (model - measured) / (scale sqrt(n)).

    Each column of strain is one block of n values.

    Parameters
    ----------
    load : (rows, 2 or 3) array
        Measured loads: N/mm along warp and fill, or MPa, N and N mm of a tube.
    strain : (rows, blocks) array
        The measured strains, which are not in %.
    scale : float or None
        Strain by which differences are divided; None for the largest of each column.
    weight : float
        Weight of the test in the objective.
    noise : float or None
        Standard deviation of one strain; that of a usual instrument unless given.

    Attributes
    ----------
    first_row : int
        Number of the first row that is matched.
    """

    unit = "%"
    first_row = 0

    def __init__(
        self,
        load: Array,
        strain: Array,
        scale: float | None,
        weight: float,
        noise: float | None,
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
            scales = np.maximum(np.abs(self.measured_strain).max(axis=0), USUAL_NOISE)
        self._divisors = scales * np.sqrt(count) / max(weight, 1e-300)
        self.scale = PERCENT * np.repeat(self._divisors, count)

    @property
    def measured_strain(self) -> Array:
        """Return the measured strains (rows, blocks), counted from their zero."""
        return self.strain

    @property
    def measured(self) -> Array:
        """Return the measured strains in the order of the residual, (m,) %."""
        return self.scale * self.in_blocks(self.measured_strain)

    @property
    def data(self) -> tuple[Array, ...]:
        return self.load, self.strain

    def modelled(self, history: History) -> Array:
        """Return the model's strains (rows, blocks), counted from their zero."""
        raise NotImplementedError

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        return self.in_blocks(self.modelled(history) - self.measured_strain)

    def shifted(self, external: History, surrogate: History) -> Self:
        objective = copy.copy(self)
        objective.strain = self.strain - (self.modelled(external) - self.modelled(surrogate))
        return objective

    def rms(self, history: History) -> Array:
        """Return the RMS error of each block, (blocks,) %."""
        difference = (self.modelled(history) - self.measured_strain)[self.first_row :]
        return PERCENT * np.sqrt(np.mean(difference**2, axis=0))

    def in_blocks(self, values: Array) -> Array:
        """Return values (rows, blocks, ...) of strain as residuals, block after block: (m, ...).

        m is the number of matched rows times the number of blocks.
        """
        divisors = self._divisors.reshape(1, -1, *(1,) * (values.ndim - 2))
        residuals = values[self.first_row :] / divisors
        return np.swapaxes(residuals, 0, 1).reshape(-1, *values.shape[2:])
