"""What a comparison compares: residual blocks, their scale, and what is known of the data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..materials.forms.base import Array
from ..solvers.base import History

#: Where the noise of an objective's data is from: the project says it, it is the scatter of the
#: specimens, or what such an instrument is good for.
NoiseIs = Literal["given", "specimens' scatter", "assumed"]


class Objective(ABC):
    """Residual blocks of one comparison.

    A subclass has to have the first four attributes, and the abstract methods; all other members
    have a default for data of which that is not known.

    Attributes
    ----------
    unit : str
        Of the data: "mm", "N", "%".
    least_noise : float
        Standard deviation of one value by the noise of the data, in `unit`.
    sizes : tuple of int
        Number of residuals of each block, m together.
    scale : (m,) array
        `unit`s in one unit of residual.
    noise_is : str
        Where `least_noise` is from, see `NoiseIs`.
    correlated_count : float
        How many values err together, at least.
    specimens : (m,) int array, optional
        Number of the specimen of each value.
    columns : int
        Number of successive blocks that a function takes as columns of one array: 3 components of
        a displacement, 1 of loads; 0 where the values are not for a function.
    """

    unit: str
    least_noise: float
    sizes: tuple[int, ...]
    scale: Array
    noise_is: NoiseIs = "assumed"
    correlated_count: float = 1.0
    specimens: NDArray[Any] | None = None
    columns: int = 0

    @property
    @abstractmethod
    def data(self) -> tuple[Array, ...]:
        """Return all that was measured: results belong to these data."""

    @abstractmethod
    def residual(self, history: History, nuisance: Mapping[str, float]) -> Array:
        """Return the residuals.

        Parameters
        ----------
        history : History
            Of the model.
        nuisance : mapping of float
            Values by name, in their units.

        Returns
        -------
        (m,) array
        """

    @abstractmethod
    def jacobian(self, history: History, slope: Array) -> Array:
        """Return the slopes of the residuals.

        Parameters
        ----------
        history : History
            Of the model; its loads may have slopes too.
        slope : (frames, nodes, 3, parameters) array
            Of the model's displacements, mm per unit of each parameter.

        Returns
        -------
        (m, parameters) array
        """

    @abstractmethod
    def shifted(self, external: History, surrogate: History) -> Objective:
        """Return the objective for a surrogate that stands for an external solver.

        Parameters
        ----------
        external, surrogate : History
            Of both solvers at the same unknowns: the data are shifted by what they differ.
        """

    @property
    def measured(self) -> Array:
        """Return the measured values in `unit`; empty where they are not compared themselves."""
        return np.zeros(0)

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return positions of the values of each block, between which errors are correlated.

        (n, 2) mm on a sheet, or (n, 1) along a curve; empty where they are not known.
        """
        return ()

    def causes(self, history: History) -> dict[str, Array]:
        """Return what may be wrong in such a test: slopes (m, k) of the residual by a description.

        The description has a `{}` for each of k amounts; see `discrepancy.ranked_causes`.
        """
        return {}

    def nuisance_columns(self, names: Sequence[str], nuisance: Mapping[str, float]) -> Array:
        """Return slopes of the residuals by nuisance that no model has, as an offset.

        Parameters
        ----------
        names : sequence of str
        nuisance : mapping of float
            Values by name, in their units.

        Returns
        -------
        (m, names) array
        """
        raise NotImplementedError(f"{type(self).__name__} has no nuisance")

    def of_points(self, values: NDArray[Any]) -> NDArray[Any] | None:
        """Return values of the points of the data as values of the residuals.

        Parameters
        ----------
        values : (points,) array

        Returns
        -------
        (m,) array or None
            None where it is not known which residual is of which point.
        """
        return None
