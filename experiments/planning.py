"""Candidates for the next test: what a plan compares, and what it knows of the project."""

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
#: Largest logarithmic strain to which a test is planned, also where the law has no limit.
LARGEST_STRAIN = 0.3


@dataclass(frozen=True)
class Precision:
    """The precision of the measured values of one comparison of the project.

    Parameters
    ----------
    noise : float
        Standard deviation of one value that the fit assumes, in the unit of the data.
    correlated_count : float
        Number of neighbouring values whose errors are as good as equal.
    value_count : int
        Number of values of one block: a component of displacement in one frame, or a load curve.
    """

    noise: float
    correlated_count: float
    value_count: int

    def for_values(self, value_count: int) -> float:
        """Return the noise at which `value_count` independent values are as precise as the block.

        It is noise * sqrt(correlated_count * value_count / self.value_count).
        """
        return self.noise * float(np.sqrt(self.correlated_count * value_count / self.value_count))


@dataclass(frozen=True, eq=False)
class Planning:
    """Hold what is known of a project when a test of one kind is planned.

    Parameters
    ----------
    place : Place
        Place of the planned test, with the fabric and the units.
    present : sequence of PreparedTest
        The project's tests of the kind, with their data.
    precision : mapping of str to Precision
        The precision of the project's data, by name of the comparison.
    law : HypoelasticLaw
        The law at the present optimum, with which the data of candidates are computed.
    make_solver : callable
        Makes the solver that computes them.
    noise : float, optional
        Standard deviation of one measured value of the kind (mm, N), where a user gives it.
    """

    place: Place
    present: Sequence[PreparedTest]
    precision: Mapping[str, Precision]
    law: HypoelasticLaw
    make_solver: MakeSolver
    noise: float | None = None

    def noise_is(self, template: PreparedTest | None = None) -> str:
        """Return where the noise of a candidate that is like `template` is from, in words."""
        if self.noise is not None:
            return "given"
        return "assumed" if template is None else f"that of {template.test.name}"

    @property
    def ends(self) -> Array:
        """Return the largest strains (3,) worth testing: the law's, up to `LARGEST_STRAIN`.

        They are in the order (eps1, eps2, gamma12).
        """
        return np.minimum(self.law.strain_range, LARGEST_STRAIN)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A test that could be made next.

    Parameters
    ----------
    name : str
        What the test is, in a few words; no two candidates have the same name.
    make : callable
        Returns the test prepared with data computed with the law; the noise of its objective is
        that of independent values. Raises SolverFailure where the law cannot be run, InputError
        where there is no such model.
    noise_is : str
        Where that noise is from, in words.
    specimens : int
        Number of specimens that are usually tested, all with the same information.
    """

    name: str
    make: Callable[[], PreparedTest]
    noise_is: str
    specimens: int = 1


@runtime_checkable
class Plannable(Protocol):
    """A kind of test that proposes candidates for the next test."""

    def candidates(self, planning: Planning) -> Sequence[Candidate]:
        """Return the tests of the kind that a plan is to compare."""
