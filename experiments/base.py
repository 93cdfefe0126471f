"""What every kind of test has: how it reads and prepares, and what it gives to a fit.

A project names tests; each is of a kind. A kind reads its section of the project into a `Test`,
which makes models. Tests of a kind that can be fitted are prepared once (data read, or computed)
and then give comparisons to a fit, in every process that runs starts; the kind's presenter says
what a fit means for a test. Nothing outside a folder of this package asks which kind a test is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from .forward import Studied
from .predicted import Predicted
from .sections import Place

if TYPE_CHECKING:
    from ..inference.comparison import Comparison
    from ..materials.law import HypoelasticLaw
    from ..solvers.base import Solver
#: Makes a solver of its own for a model, so that what it prepares for the model is not shared:
#: the project's, or another by its name, with the settings that the project has for it.
MakeSolver = Callable[..., "Solver"]
Refined = Literal["elements", "increments"]


@dataclass(frozen=True)
class Reach:
    """The strains that the data of a test reach, before any fit.
    strain : ends (eps1, eps2, gamma12) of the logarithmic strain, None where unknown. break_shares
    : for each of them two shares of its end where the measured stiffness changes most, for laws
    with regions; None where unknown."""

    strain: tuple[float | None, float | None, float | None] = (None, None, None)
    break_shares: tuple[tuple[float, float] | None, ...] = (None, None, None)


class Test(Protocol):
    """One test as its section describes it: lengths mm, loads N, pressures and moduli MPa.
    weight : among several tests in one fit. reach : of its data. Optional: `reads_files`, whether
    its data are measured files, which a folder can be named for."""

    @property
    def kind(self) -> str: ...

    @property
    def name(self) -> str: ...

    @property
    def weight(self) -> float: ...

    @property
    def reach(self) -> Reach: ...

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, Any]:
        """Return models by the name of their part; raises InputError for an impossible mesh.
        thickness : mm, the fabric's unless given. refined, factor : edges of elements, or
        increments, divided by a factor."""

    def settings(self) -> Mapping[str, object]:
        """Return settings, without paths, on which a result depends beside data, law, solver."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SectionTest:
    """The beginning of a test of a section. noise : of one value, where the section says it."""

    name: str
    place: Place
    weight: float = 1.0
    noise: float | None = None

    def thick(self, given: float | None) -> float:
        """Return a thickness that is given, else the fabric's, mm."""
        return self.place.fabric.thickness if given is None else given


#: Which of the measured points a fit matches, by name of the comparison.
Masks = Mapping[str, NDArray[np.bool_]]


@dataclass(frozen=True)
class Weighting:
    """The weight of a test.
    relative : the blocks of a test add up to `weight` times its mean relative RMS error, so that a
    test of many blocks does not outvote one of few; otherwise its own objective weighs them."""

    relative: bool = False
    weight: float = 1.0


class PreparedTest(Protocol):
    """A test with its data, in memory, as worker processes get it.
    objective_is : its own objective, in words. known : the law behind computed data. specimens : by
    comparison, of each point that can be left out of a fit. One with measured files also has
    `data_files()`, for the record of a run, as a test that is predicted does. A kind that looks at
    its data before a fit has `doubts(expected)`, and then lists the names of its doubts,
    `Kind.doubts`. `seen` : further lines of `check`."""

    @property
    def test(self) -> Test: ...

    @property
    def objective_is(self) -> str: ...

    @property
    def known(self) -> HypoelasticLaw | None: ...

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]: ...

    def reach(self, masks: Masks) -> Reach:
        """Return the strains that matched points reach; the test's own for all of them."""

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return the comparisons of a fit: models, solvers, objectives, nuisance unknowns.
        Each is named as the test, followed by its part where there are several: "strips: warp"."""


@runtime_checkable
class Divisible(Protocol):
    """A prepared test that can leave single parts out of a fit.
    Its `comparisons` take the masks of `parts`, and none is among them that leaves nothing. Their
    objectives have `of_points(values)`, (m,) for each residual, of values for the points of a mask;
    a bootstrap lets parts count several times, or not at all."""

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return by sort ("frames", "specimens") and name ("97 kPa") the points kept without it.
        Only sorts of which the test has two or more. Masks are of every comparison of the test,
        over its points in the order of its data."""


@runtime_checkable
class Refinable(Protocol):
    """A prepared test with finer, or coarser, models of its comparisons."""

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """Return its comparisons with edges of elements and increments divided by a factor.
        Every residual is of the same measured value as that of `comparisons`; data computed with
        the fit's own model have the same comparisons. A factor below one leaves the increments as
        they are. Raises InputError without such a mesh."""


class Kind(Protocol):
    """A kind of test, as the registry holds it.
    name : of its tables in a project, [[name]]. title : in a few words, for help and documents.
    section : of such a table; `name` is among its keys, and `weight` where it is fitted. fitted :
    whether a fit can match its tests. predicted : of tests that cards predict, None for others.
    studied : None where no study runs it. A kind that knows tests worth making next is `Plannable`.
    A kind with measured files in a folder has `folder_key`, the dotted key of it, by which a
    project can be written down with the folder that it was run with."""

    name: str
    title: str
    section: type[BaseModel]
    fitted: bool
    predicted: Predicted | None
    studied: Studied | None

    def read(self, section: Any, place: Place, name: str) -> Test:
        """Return the test of a section, in mm, N, MPa; raises InputError naming file and key."""

    def prepare(self, test: Any, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedTest:
        """Read the data of a test that is fitted, or compute them from its known solution.
        law : all but the coefficients. Kinds that are only predicted do not have it. Raises
        InputError in the data, SolverFailure where the known solution cannot be run."""
