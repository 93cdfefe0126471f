"""User-defined tests in Python: the base class `OwnTest`, and its solver, objective and kind.

Such a test computes its values from a law in closed form, without a finite-element model.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..inference.comparison import Comparison
from ..inference.objective import NoiseIs
from ..materials.card import MaterialCard, State
from ..materials.law import HypoelasticLaw, law_beside, usual_step
from ..notes import Note
from ..readers.histories import Pace
from ..solvers.base import Array, History, SolverCheck
from .base import BaseKind, BaseTest, MakeSolver, Masks, Reach, Weighting
from .measured import LoadsObjective, PreparedWhole

#: The law at which the values of a test are computed to identify its code in the record of a fit.
REFERENCE_LAW = HypoelasticLaw.linear(300.0, 200.0, 10.0)


class OwnTest(BaseTest):
    """Base class of a user-defined test (`bf.OwnTest`); a subclass has `measured` and `modelled`.

    Attributes
    ----------
    name : str
    measured : (n,) array
        The measured values.
    unit : str
        Unit of the values.
    noise : float, optional
        Standard deviation of one measured value; 1 % of the largest unless given.
    strain : tuple of 3 floats
        Largest logarithmic strains (eps1, eps2, gamma12) on which the values depend, None for a
        component on which they do not.
    places : mapping of str to (n,) arrays
        Columns of the table of residuals that say where each value was measured; the first is the
        x axis of the chart.
    weight : float
        Weight among other tests of one fit.
    thickness : float
        Thickness, mm, of the fabric that the test is fitted with.
    """

    name: str = "own"
    measured: ArrayLike = ()
    unit: str = "N"
    noise: float | None = None
    strain: tuple[float | None, float | None, float | None] = (None, None, None)
    places: Mapping[str, ArrayLike] = {}
    weight: float = 1.0
    thickness: float = 1.0
    kind = "own"
    parameters = ("thickness",)
    # Attributes, which a subclass may assign, instead of the properties of `BaseTest`. A card
    # takes over `state` only beside `conditioning`, its words.
    state: State = ""
    conditioning: str | None = None
    pace: Pace | None = None
    reads_files: bool = False
    own_card: MaterialCard | None = None
    data_notes: Sequence[Note] = ()
    seen: Sequence[str] = ()

    def modelled(self, law: HypoelasticLaw) -> ArrayLike:
        """Return the values (n,) of the test that follow from a law, in the order of `measured`."""
        raise NotImplementedError(f"{type(self).__name__} needs modelled(law)")

    @property
    def reach(self) -> Reach:
        return Reach(self.strain)

    def models(self, *_: Any, **__: Any) -> Mapping[str, Any]:
        return {}

    def settings(self) -> Mapping[str, object]:
        return {"weight": self.weight, "strain": self.strain, "unit": self.unit}

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """Return the test of a fabric thicker by values["thickness"] mm."""
        return self.changed(thickness=self.thickness + values["thickness"])

    def changed(self, **values: float) -> Self:
        """Return a copy of the test with other values of some attributes."""
        test = copy.copy(self)
        vars(test).update(values)
        return test

    def values(self, law: HypoelasticLaw) -> Array:
        """Return the values of `modelled` as an array (n,).

        Raise InputError unless they are numbers, as many as are measured.
        """
        modelled = self.modelled(law)
        shape = np.shape(self.measured)
        try:
            values = np.array(modelled, dtype=float)
        except (TypeError, ValueError):
            values = np.empty(0)
        if values.shape != shape or len(shape) != 1 or not shape[0]:
            problem = f"expected {shape} values as measured, (n,), got {np.shape(modelled)}"
            raise InputError(None, f"{self.name}.modelled", problem)
        return values


class ClosedForm:
    """The solver of user-defined tests: calls `OwnTest.values`, differentiates numerically.

    The test is the model, and derivatives are central differences.
    """

    name = identity = "closed form"
    external = False
    load_ratios = True
    progress: Callable[[Any], None] | None = None

    def check(self) -> SolverCheck:
        return SolverCheck(self.name, True, "", True)

    def run(
        self,
        model: OwnTest,
        law: HypoelasticLaw,
        *_: Any,
        **__: Any,
    ) -> History:
        """Return the test's values as a history, which ends at the strains that the test names."""
        ends = np.array([end or 0.0 for end in model.strain])
        return History(model.values(law), np.zeros((1, 1, 3)), 0.0 * ends, ends, unstable=())

    def run_with_sensitivity(
        self,
        model: OwnTest,
        law: HypoelasticLaw,
        parameters: Sequence[str],
        **_: Any,
    ) -> tuple[History, Array]:
        """Return the history with the slopes (values, parameters) of its values.

        Derivatives of displacements, (frames, nodes, 3, parameters), are zero at one node: the
        model has no mesh.
        """
        slope = np.column_stack([_slope(model, law, name) for name in parameters])
        return replace(self.run(model, law), load_slope=slope), np.zeros((1, 1, 3, len(parameters)))


def _slope(
    test: OwnTest,
    law: HypoelasticLaw,
    name: str,
    relative_step: float = 1e-5,
) -> Array:
    """Return the derivative (n,) of a test's values by a parameter of the law or by "thickness".

    Parameters
    ----------
    relative_step : float
        Share by which a step of the central difference changes moduli, at most.
    """

    def values_after(change: float) -> Array:
        if name == "thickness":
            return test.with_parameters({name: change}).values(law)
        return test.values(law_beside(law, name, change))

    step = usual_step(law, name, test.thickness, relative_step)
    return (values_after(step) - values_after(-step)) / (2 * step)


class ValuesObjective(LoadsObjective):
    """The residual of a user-defined test: (model - measured) / (unit sqrt(n)), n values.

    The unit is that of the values, or, with relative weighting, the largest measured value divided
    by the weight.
    """

    #: Standard deviation of a value as a share of the largest, unless it is given.
    assumed_noise = 0.01

    def __init__(self, test: OwnTest, weighting: Weighting) -> None:
        self.load = np.array(test.measured, dtype=float)
        self.unit = test.unit
        largest = float(np.abs(self.load).max())
        self.noise_is: NoiseIs = "assumed" if test.noise is None else "given"
        self.least_noise = self.assumed_noise * largest if test.noise is None else test.noise
        self.sizes = (len(self.load),)
        unit = largest / weighting.weight if weighting.relative and largest > 0 else 1.0
        self.scale = np.full(len(self.load), unit * np.sqrt(len(self.load)))
        self._usual_values = test.values(REFERENCE_LAW)

    @property
    def data(self) -> tuple[Array, ...]:
        return self.load, self._usual_values

    def compared_values(self, loads: Array) -> Array:
        return loads

    def shifted(self, external: History, surrogate: History) -> Self:
        return self  # it is run by the same solver, whichever leads


class PreparedOwn(PreparedWhole):
    """A user-defined test prepared for a fit, with one comparison."""

    @property
    def objective_is(self) -> str:
        return f"RMS error, {self.test.unit}"

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | float | None = None
    ) -> tuple[Comparison, ...]:
        objective = ValuesObjective(self.test, weighting)
        return (Comparison(self.test.name, self.test, ClosedForm(), objective),)

    finer = comparisons  # a closed form has no mesh


class OwnKind(BaseKind):
    """The kind of all user-defined tests, which cannot stand in a project file."""

    name = "own"
    fitted = True

    def prepare(self, test: OwnTest, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedOwn:
        test.values(REFERENCE_LAW)
        return PreparedOwn(test)


KIND = OwnKind()
