"""Residuals of a ratio: strains along warp and fill since the beginning of the path, two blocks."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError
from ...inference.comparison import NoiseIs
from ...meshes.strip_models import elongations
from ...solvers.base import History

Array = NDArray[np.float64]

#: Of one measured strain: what an extensometer or a camera on a cruciform is good for.
EXTENSOMETER = 1e-4
PERCENT = 100.0


class StrainObjective:
    """Residuals (model - measured) / (scale sqrt(n)) of n strains along warp, then fill.

    The norm of a block is the RMS error of a strain over the scale, times the weight. Both are
    counted from the first load of the path: what the fabric kept of earlier cycles is no part.

    load : (n, 2) N/mm, by which the values lie along their path. strain : (n, 2) measured since the
    beginning of the path, as shares. scale : share of strain that counts as one. weight : of both
    blocks. noise : of one measured strain; None: `EXTENSOMETER` is reckoned with.
    """

    #: What the residuals are in after `scale`.
    unit = "%"

    def __init__(
        self,
        load: ArrayLike,
        strain: ArrayLike,
        scale: float = 1.0,
        weight: float = 1.0,
        noise: float | None = None,
    ) -> None:
        self.load, self.strain = np.asarray(load, float), np.asarray(strain, float)
        if len(self.strain) < 2:
            raise InputError(None, "path", "expected two loads at least")
        self.least_noise = PERCENT * (EXTENSOMETER if noise is None else noise)
        self.noise_is: NoiseIs = "assumed" if noise is None else "given"
        # The first row is the zero of the others and matches whatever the law is.
        self.sizes = (len(self.strain) - 1,) * 2
        self._unit = scale * np.sqrt(len(self.strain) - 1) / weight

    @property
    def scale(self) -> Array:
        """Return % of strain in one unit of each residual, (2 n,)."""
        return np.full(sum(self.sizes), PERCENT * self._unit)

    @property
    def places(self) -> tuple[Array, ...]:
        """Return the load (n, 1) N/mm of each block's values: neighbours err as one."""
        return (self.load[1:].max(axis=1, keepdims=True),) * 2

    @property
    def data(self) -> tuple[Array, ...]:
        """Return everything measured that the residual depends on."""
        return self.load, self.strain

    def modelled(self, history: History) -> Array:
        """Return the model's strains (n, 2) since the beginning of the path."""
        own = elongations(history.displacement)
        return np.asarray(own - own[0])

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        """Return both blocks, (2 n,)."""
        return self._blocks(self.modelled(history) - self.strain)

    def jacobian(self, history: History, slope: Array) -> Array:
        """Return (2 n, parameters) from the slope of the displacements."""
        own = elongations(slope)
        return self._blocks(own - own[0])

    def nuisance_columns(self, names: Sequence[str]) -> Array:
        """Return (2 n, 0): there are no nuisance unknowns."""
        if names:
            raise InputError(None, "nuisance", f"a biaxial path knows no {', '.join(names)}")
        return np.empty((sum(self.sizes), 0))

    def of_points(self, values: Array) -> Array:
        """Return values for each residual from values for each load of the path."""
        return np.tile(values[1:], 2)

    def shifted(self, here: History, there: History) -> StrainObjective:
        """Return the objective of a model that shows `here` where this one shows `there`."""
        other = copy.copy(self)
        other.strain = self.strain - (self.modelled(here) - self.modelled(there))
        return other

    def rms(self, history: History) -> Array:
        """Return the RMS errors (2,) of the strains along warp and fill, %."""
        off = (self.modelled(history) - self.strain)[1:]
        return np.asarray(PERCENT * np.sqrt(np.mean(off**2, axis=0)))

    def _blocks(self, values: Array) -> Array:
        """Return rows (n, 2, ...) without the first as one column of values, the warp's first."""
        rows = np.swapaxes(values[1:], 0, 1)
        return np.asarray(rows.reshape(-1, *values.shape[2:]) / self._unit)
