"""The objective of a comparison: residuals between model and data, and the noise of the data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..materials.forms.base import Array
from ..solvers.base import History

#: How the noise of an objective's data is known: given by the project, from the scatter of the
#: specimens, or assumed as usual for such an instrument.
NoiseIs = Literal["given", "specimens' scatter", "assumed"]


class Objective(ABC):
    """The residuals of one comparison in blocks, with the unit and noise of its data.

    A subclass has to define the first four attributes and the abstract methods; all other members
    have a default for data of which they are not known.

    Attributes
    ----------
    unit : str
        Unit of the data: "mm", "N", "%".
    least_noise : float
        Standard deviation of the noise of one measured value, in `unit`.
    sizes : tuple of int
        Number of residuals of each block; m is their sum.
    scale : (m,) array
        Deviation of a value, in `unit`, that makes a residual of one.
    noise_is : str
        How `least_noise` is known, see `NoiseIs`.
    correlated_count : float
        Least number of values that err together, as those of one specimen do.
    specimens : (m,) int array, optional
        Number of the specimen that each value belongs to.
    columns : int
        Number of successive blocks that a user's function (`FunctionObjective`) takes as columns of
        one array: 3 for the components of displacements, 1 for loads; 0 where there is no such
        array.
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
        """Return all measured arrays, by which a stored result is recognised as one of them."""

    @abstractmethod
    def residual(self, history: History, nuisance: Mapping[str, float]) -> Array:
        """Return the residuals of a run, block after block.

        Parameters
        ----------
        history : History
            Run of the model.
        nuisance : mapping of float
            Values of the nuisance parameters by name, in their units.

        Returns
        -------
        (m,) array
        """

    @abstractmethod
    def jacobian(self, history: History, slope: Array) -> Array:
        """Return the derivatives of the residuals by the parameters of a run.

        Parameters
        ----------
        history : History
            Run of the model, which may contain derivatives of its loads.
        slope : (frames, nodes, 3, parameters) array
            Derivatives of the model's displacements, mm per unit of each parameter.

        Returns
        -------
        (m, parameters) array
        """

    @abstractmethod
    def shifted(self, external: History, surrogate: History) -> Objective:
        """Return the objective for a surrogate that takes the place of an external solver.

        Parameters
        ----------
        external, surrogate : History
            Runs of both solvers at the same unknowns; the data are shifted by their difference.
        """

    @property
    def measured(self) -> Array:
        """Return the measured values in `unit`; empty where they are not compared themselves."""
        return np.zeros(0)

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return where the values of each block were measured, for the correlation of their errors.

        (n, 2) in mm on a sheet, or (n, 1) along a curve; empty where this is not known.
        """
        return ()

    def causes(self, history: History) -> dict[str, Array]:
        """Return what may be wrong in such a test, as `discrepancy.ranked_causes` takes it.

        The keys describe a cause with a `{}` for each of its k amounts, the values (m, k) are the
        change of the residuals by one unit of each amount.
        """
        return {}

    def nuisance_columns(self, names: Sequence[str], nuisance: Mapping[str, float]) -> Array:
        """Return derivatives of the residuals by nuisance parameters of the data, as an offset.

        Parameters
        ----------
        names : sequence of str
            Those parameters, which neither the model nor the law has.
        nuisance : mapping of float
            Values of the nuisance parameters by name, in their units.

        Returns
        -------
        (m, names) array
        """
        raise NotImplementedError(f"{type(self).__name__} has no nuisance")

    def of_points(self, values: NDArray[Any]) -> NDArray[Any] | None:
        """Spread a value of each measured point over the residuals that belong to the point.

        Parameters
        ----------
        values : (points,) array
            A number or flag for each point.

        Returns
        -------
        (m,) array or None
            None where it is not known which residual belongs to which point.
        """
        return None
