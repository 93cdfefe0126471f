"""Compare a tube test with its model in a fit: residuals of strains, comparison, data file."""

from collections.abc import Sequence

import numpy as np

from ...inference.comparison import Comparison
from ...readers.frames import FrameSource
from ...solvers.base import Array, History
from ..base import MakeSolver, Masks, Weighting
from ..data_files import DataFile
from ..measured import PreparedWhole, StrainObjective
from .test import TubeTest


class TubeObjective(StrainObjective):
    """Residuals of the measured strains, each over its largest value.

    The zero of a strain is not known, so that each strain is compared less its mean over the test.

    Parameters
    ----------
    test : TubeTest
        Test with at least one measured strain.
    weight : float
        Weight of the test in the objective.
    """

    def __init__(self, test: TubeTest, weight: float) -> None:
        (self.model,) = test.models().values()
        self.components = np.flatnonzero(~np.isnan(test.strain).any(axis=0))
        strain = test.strain[:, self.components]
        super().__init__(self.model.loads, strain, None, weight, test.noise)

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the number (n, 1) of each row, over which errors may be correlated."""
        rows = np.arange(1.0, 1 + self.sizes[0])
        return (rows[:, None],) * len(self.sizes)

    @property
    def measured_strain(self) -> Array:
        """Return the measured strains (n, blocks) less their means, a block for each component."""
        return _centred(self.strain)

    def modelled(self, history: History) -> Array:
        """Return the model's strains (n, blocks) less their means."""
        return _centred(self.model.strains(history.displacement)[:, self.components])

    def jacobian(self, history: History, slope: Array) -> Array:
        """Return the derivatives (m, parameters) of the residuals by the parameters.

        Parameters
        ----------
        slope : (n, 4, 3, parameters) array, mm
            Derivatives of the displacements of the patch's corners.
        """
        slopes = self.model.strain_slopes(history.displacement, slope)[:, self.components]
        return self.in_blocks(_centred(slopes))


def _centred(values: Array) -> Array:
    """Return values (n, ...) less their means over the n rows."""
    return values - values.mean(axis=0)


class PreparedTube(PreparedWhole):
    """A tube with its data."""

    objective_is = "sum of the RMS errors of the measured strains over their largest"

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | float | None = None
    ) -> tuple[Comparison, ...]:
        """Return the one comparison, each measured strain of equal weight."""
        test = self.test
        count = int((~np.isnan(test.strain).any(axis=0)).sum())
        objective = TubeObjective(test, weighting.of_block(count))
        return (Comparison(test.name, objective.model, make_solver(), objective, contracts=True),)

    finer = comparisons  # there is no mesh

    def data_files(self) -> Sequence[DataFile]:
        """Return the file of loads and strains."""
        path = self.test.path
        if path is None:
            return []
        return [DataFile(path, FrameSource("csv"), len(self.test.loads), {})]
