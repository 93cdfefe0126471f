"""Compare a biaxial test with its model in a fit: residuals, comparisons and data files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...inference.comparison import Comparison, ErrorColumns
from ...inference.nuisance import Nuisance, prior_weight
from ...materials.law import HypoelasticLaw
from ...meshes.strip_models import elongations
from ...readers.biaxial import BiaxialTable
from ...solvers.base import Array, History
from ..base import MakeSolver, Masks, Reach, Weighting
from ..data_files import DataFile
from ..doubts import Doubt, Expected
from ..measured import PreparedParts, StrainObjective
from .doubts import doubts_of_paths
from .paths import BiaxialPath
from .test import BiaxialTest, reach_of

NO_SHARE = (
    "all of the measured load is taken to reach the field where strains are measured; arms and "
    "corners carry a part of it, also with slits: give what is known of it as load_share (0.85), "
    "with load_share_deviation"
)


class PathObjective(StrainObjective):
    """Residuals of the strains of one path: those along warp, then those along fill.

    Strains count from the first row of the path, which has no residual.
    """

    # Strains count from the first row, so that it matches for any law.
    first_row = 1
    quantities = ("warp strain", "fill strain")
    #: Nuisance parameter of the share of the loads that reaches the field, and its start.
    load_share: tuple[str, float] | None = None

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        residual = super().residual(history)
        if self.load_share is None or not nuisance:
            return residual
        name, start = self.load_share
        return residual + (nuisance[name] / start - 1.0) * self._by_load()

    def nuisance_columns(
        self, names: Sequence[str], nuisance: Mapping[str, float], history: History
    ) -> Array:
        assert self.load_share is not None
        return self._by_load()[:, None] / self.load_share[1]

    def _by_load(self) -> Array:
        """Return the derivatives (m,) of the residuals by a relative change of the loads.

        The strain at the stated load is then smaller by the slope of the measured curve.
        """
        larger = self.load.max(axis=1) / self.load.max()
        powers = np.arange(min(5, len(larger)))
        curves = np.linalg.lstsq(larger[:, None] ** powers, self.strain, rcond=None)[0]
        slopes = (powers * larger[:, None] ** powers) @ curves
        return self.in_blocks(slopes - slopes[0])

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the larger load (n, 1) N/mm of each residual along warp, then along fill.

        Errors at neighbouring loads are correlated.
        """
        return (self.load[1:].max(axis=1, keepdims=True),) * 2

    def modelled(self, history: History) -> Array:
        """Return the model's strains (n, 2) since the beginning of the path."""
        strains = elongations(history.displacement)
        return strains - strains[0]

    def jacobian(self, history: History, slope: Array) -> Array:
        slopes = elongations(slope)
        return self.in_blocks(slopes - slopes[0])

    def spread_over_residuals(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return values (n,) of the rows of the path repeated for each residual."""
        return np.tile(values[1:], 2)


@dataclass(frozen=True, eq=False)
class PreparedBiaxial(PreparedParts):
    """A biaxial test with its data."""

    test: BiaxialTest
    objective_is = "sum of the ratios' RMS errors of strain, warp and fill, over their largest"

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return the masks that leave out each ratio, where there are several."""
        return self.masks_without_each("ratios")

    def reach(self, masks: Masks) -> Reach:
        """Return the largest strains of the ratios that `masks` keep."""
        return reach_of(self.matched_parts(masks).values())

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return a comparison of measured and modelled strains for each ratio that `masks` keep."""
        test = self.test
        models = self.test.models()
        fitted_paths = self.matched_parts(masks)
        comparisons = []
        weight = weighting.of_block(2 * len(fitted_paths))
        for path in fitted_paths.values():
            largest = float(np.abs(path.strain_change).max())
            if not largest > 0:
                raise test.place.error("data", f"the strains of ratio {path.ratio} are all zero")
            objective = PathObjective(path.load, path.strain_change, largest, weight, test.noise)
            parts = self.part(path.ratio), models[path.ratio], make_solver(), objective
            nuisance = load_share_nuisance(test, objective)
            comparisons.append(
                Comparison(*parts, nuisance, contracts=True, shared_errors=first_row_errors)
            )
        return tuple(comparisons)

    @property
    def seen(self) -> Sequence[str]:
        return () if self.test.section.load_share is not None else (NO_SHARE,)

    def data_files(self) -> Sequence[DataFile]:
        used_rows_of = {id(table): 0 for table in self.test.tables}
        for path in self.test.paths:
            used_rows_of[id(path.table)] += len(path.load)
        files = []
        for table in self.test.tables:
            used_rows = used_rows_of[id(table)]
            loading_rows = count_loading_rows(self.test.paths, table)
            thinned = f"thinned to at most {self.test.section.points} of a ratio"
            dropped = {
                "not of an evaluated loading": len(table.load) - loading_rows,
                thinned: loading_rows - used_rows,
            }
            arrays = () if table.path is not None else (table.load, table.strain)
            file = table.path or Path(table.name)
            files.append(DataFile(file, table.source, used_rows, dropped, arrays))
            fill = table.partner
            if fill is not None and fill.path is not None:
                files.append(DataFile(fill.path, fill.source, len(fill.load)))
        return files

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        """Return the doubts about the load paths of the test."""
        return doubts_of_paths(self.test.paths, self.test.place.fabric.thickness, expected)


def first_row_errors(
    comparison: Comparison,
    law: HypoelasticLaw,
    nuisance: Mapping[str, float],
    history: History,
) -> ErrorColumns:
    """Return the errors of the first row of a path, from which its strains count.

    They err as much as the other rows scatter about their mean.
    """
    objective = comparison.objective
    deviation = objective.scale * objective.residual(history, nuisance)
    blocks = np.split(deviation, np.cumsum(objective.sizes)[:-1])
    scatter = np.sqrt(np.mean([block.var() for block in blocks]))
    level = max(objective.least_noise, float(scatter))
    by_block = np.repeat(np.eye(len(blocks)), objective.sizes, axis=0)
    return ErrorColumns.independent(level * by_block / objective.scale[:, None])


def count_loading_rows(paths: Sequence[BiaxialPath], table: BiaxialTable) -> int:
    """Return how many rows of a table lie within its evaluated loadings and their range."""
    count = 0
    for path in paths:
        if path.table is table:
            larger = table.load[path.cycle.first : path.cycle.last + 1].max(axis=1)
            lowest, highest = path.larger.min(), path.larger.max()
            count += int(((larger >= lowest) & (larger <= highest)).sum())
    return count


def load_share_nuisance(test: BiaxialTest, objective: PathObjective) -> tuple[Nuisance, ...]:
    """Return the unknown share of the loads that reaches the field, where its deviation is given.

    All ratios of the test have the same; `objective` is told its name.
    """
    section = test.section
    deviation = section.load_share_deviation
    if deviation is None:
        return ()
    start = float(np.mean(1.0 if section.load_share is None else section.load_share))
    name = f"load_share of {test.name}"
    objective.load_share = name, start
    furthest = min(4 * deviation, 0.9 * start)
    return (
        Nuisance(
            name,
            start - furthest,
            start + furthest,
            "",
            prior=deviation,
            weight=prior_weight(objective.least_noise, objective.scale),
            start=start,
            shared=True,
        ),
    )
