"""Tests that could be made next."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from ..solvers.base import Array
from .base import MakeSolver, PreparedTest
from .sections import Place

if TYPE_CHECKING:
    from ..materials.law import HypoelasticLaw
#: Of an unlimited law: no fabric is planned to be strained further (logarithmic).
LARGEST_STRAIN = 0.3


@dataclass(frozen=True)
class Precision:
    """The precision of the values of one comparison of the project.

    Parameters
    ----------
    noise : float
        In the unit of its data, as its fit reckons with.
    correlated_count : float
        Number of neighbours with one error.
    values : int
        Of one block: a direction of displacement in one frame, or a load curve.
    """

    noise: float
    correlated_count: float
    values: int

    def at(self, values: int) -> float:
        """Return the noise of independent values if `values` of them are to say as much."""
        return self.noise * float(np.sqrt(self.correlated_count * values / self.values))


@dataclass(frozen=True, eq=False)
class Planning:
    """The project as it is known when a test is planned.

    Parameters
    ----------
    place : Place
        Of the test that is planned.
    present : sequence of PreparedTest
        The project's tests of the kind, with their data.
    precision : mapping of str to Precision
        By name of a comparison.
    law : HypoelasticLaw
        At the present optimum; candidates get their data from it.
    make_solver : callable
    noise : float, optional
        Of the kind's measured values (mm, N), where a user gives it.
    """

    place: Place
    present: Sequence[PreparedTest]
    precision: Mapping[str, Precision]
    law: HypoelasticLaw
    make_solver: MakeSolver
    noise: float | None = None

    @property
    def ends(self) -> Array:
        """Return (3,) largest strains (eps1, eps2, gamma12) worth testing: those of the law."""
        return np.minimum(self.law.strain_range, LARGEST_STRAIN)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A test that could be made.

    Parameters
    ----------
    name : str
        In a few words; no two candidates have the same.
    make : callable
        Returns the test with data of the law, its objective's least noise that of independent
        values; raises SolverFailure where the law cannot be run, InputError where there is no such
        model.
    noise_is : str
        The source of that noise.
    specimens : int
        Number that is usually tested, each as good as the others.
    """

    name: str
    make: Callable[[], PreparedTest]
    noise_is: str
    specimens: int = 1


@runtime_checkable
class Plannable(Protocol):
    """A kind of test that offers candidates."""

    def candidates(self, planning: Planning) -> Sequence[Candidate]:
        """Return tests of the kind, as many as are worth comparing."""
