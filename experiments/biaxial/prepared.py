"""Compare a biaxial test with its model in a fit: residuals, comparisons and data files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...inference.comparison import Comparison
from ...meshes.strip_models import elongations
from ...solvers.base import Array, History
from ..base import MakeSolver, Masks, Reach, Weighting
from ..data_files import DataFile
from ..doubts import Doubt, Expected
from ..measured import PreparedParts, StrainObjective
from .doubts import doubts_of_paths
from .test import BiaxialTest, reach_of


class PathObjective(StrainObjective):
    """Residuals of the strains of one path: those along warp, then those along fill.

    Strains count from the first row of the path, which has no residual.
    """

    # Strains count from the first row, so that it matches for any law.
    first_row = 1
    quantities = ("warp strain", "fill strain")

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the larger load (n, 1) N/mm of each residual along warp, then along fill.

        Errors at neighbouring loads are correlated.
        """
        return (self.load[1:].max(axis=1, keepdims=True),) * 2

    def modelled(self, history: History) -> Array:
        """Return the model's strains (n, 2) since the beginning of the path."""
        strains = elongations(history.displacement)
        return np.asarray(strains - strains[0])

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
        share = weighting.weight / (2 * max(1, len(fitted_paths))) if weighting.relative else 1.0
        for path in fitted_paths.values():
            largest = float(np.abs(path.strain_change).max())
            if not largest > 0:
                raise test.place.error("data", f"the strains of ratio {path.ratio} are all zero")
            objective = PathObjective(path.load, path.strain_change, largest, share, test.noise)
            parts = self.part(path.ratio), models[path.ratio], make_solver(), objective
            comparisons.append(Comparison(*parts, contracts=True))
        return tuple(comparisons)

    def data_files(self) -> Sequence[DataFile]:
        used = {id(table): 0 for table in self.test.tables}
        for path in self.test.paths:
            used[id(path.table)] += len(path.load)
        files = []
        for table in self.test.tables:
            rows = used[id(table)]
            dropped = {"not of an evaluated loading": len(table.load) - rows}
            arrays = () if table.path is not None else (table.load, table.strain)
            file = table.path or Path(table.name)
            files.append(DataFile(file, table.source, rows, dropped, arrays))
        return files

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        """Return the doubts about the load paths of the test."""
        return doubts_of_paths(self.test.paths, self.test.place.fabric.thickness, expected)
