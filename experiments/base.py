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
from .sections import Place, Scales

if TYPE_CHECKING:
    from ..inference.comparison import Comparison
    from ..materials.card import MaterialCard, State
    from ..materials.law import HypoelasticLaw
    from ..notes import Note
    from ..readers.histories import Pace
    from ..solvers.base import Solver
    from .data_files import DataFile
    from .doubts import Doubt, Expected

#: Makes a solver of its own for a model, so that what it prepares for the model is not shared:
#: the project's, or another by its name, with the settings that the project has for it.
MakeSolver = Callable[..., "Solver"]
Refined = Literal["elements", "increments"]


@dataclass(frozen=True)
class Reach:
    """The strains that the data of a test reach, before any fit.

    Parameters
    ----------
    strain : tuple of 3 floats
        Ends (eps1, eps2, gamma12) of the logarithmic strain, None where unknown.
    break_shares : tuple of 3 pairs
        For each of them two shares of its end where the measured stiffness changes most, for laws
        with regions; None where unknown.
    """

    strain: tuple[float | None, float | None, float | None] = (None, None, None)
    break_shares: tuple[tuple[float, float] | None, ...] = (None, None, None)


class BaseTest:
    """Base class of tests: what only some of them have, with a default."""

    @property
    def state(self) -> State:
        """Return the state of the fabric in the test, "" where it is not known."""
        return ""

    @property
    def conditioning(self) -> str | None:
        """Return the words for the conditioning of the fabric before the test."""
        return None

    @property
    def pace(self) -> Pace | None:
        """Return the rate of strain and the longest hold, where the data tell them."""
        return None

    @property
    def reads_files(self) -> bool:
        """Return whether the data are measured files, which a folder can be named for."""
        return False

    @property
    def own_card(self) -> MaterialCard | None:
        """Return the card that a test brings itself, instead of those of the project."""
        return None

    @property
    def data_notes(self) -> Sequence[Note]:
        """Return notes on the data as they were read."""
        return ()

    @property
    def seen(self) -> Sequence[str]:
        """Return further lines of `check`."""
        return ()

    def data_files(self) -> Sequence[DataFile]:
        """Return the measured files in their order; none where data are computed."""
        return ()


def with_defaults(test: Any) -> Test:
    """Return a test of a plug-in that derives from nothing with the defaults of `BaseTest`."""
    if not isinstance(test, BaseTest):
        defaults = BaseTest()
        for name in vars(BaseTest):
            if not name.startswith("_") and not hasattr(test, name):
                object.__setattr__(test, name, getattr(defaults, name))
    complete: Test = test
    return complete


class Test(Protocol):
    """One test as its section describes it: lengths mm, loads N, pressures and moduli MPa.
    weight : among several tests in one fit. reach : of its data. All else as in `BaseTest`."""

    @property
    def kind(self) -> str: ...

    @property
    def name(self) -> str: ...

    @property
    def weight(self) -> float: ...

    @property
    def reach(self) -> Reach: ...

    @property
    def state(self) -> State: ...

    @property
    def conditioning(self) -> str | None: ...

    @property
    def pace(self) -> Pace | None: ...

    @property
    def reads_files(self) -> bool: ...

    @property
    def own_card(self) -> MaterialCard | None: ...

    @property
    def data_notes(self) -> Sequence[Note]: ...

    @property
    def seen(self) -> Sequence[str]: ...

    def data_files(self) -> Sequence[DataFile]: ...

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, Any]:
        """Return models by the name of their part; raises InputError for an impossible mesh.
        thickness : mm, the fabric's unless given. refined, factor : edges of elements, or
        increments, divided by a factor."""

    def settings(self) -> Mapping[str, object]:
        """Return settings, without paths, on which a result depends beside data, law, solver."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SectionTest(BaseTest):
    """The beginning of a test of a section. noise : of one value, where the section says it."""

    name: str
    place: Place
    weight: float = 1.0
    noise: float | None = None

    def thick(self, thickness: float | None) -> float:
        """Return a thickness that is given, else the fabric's, mm."""
        return self.place.fabric.thickness if thickness is None else thickness


#: Which of the measured points a fit matches, by name of the comparison.
Masks = Mapping[str, NDArray[np.bool_]]


@dataclass(frozen=True)
class Weighting:
    """The weight of a test.

    Parameters
    ----------
    relative : bool
        Whether the blocks of the test add up to `weight` times its mean relative RMS error, so that
        a test of many blocks does not outvote one of few; otherwise its own objective weighs them.
    weight : float
    """

    relative: bool = False
    weight: float = 1.0


class BasePrepared:
    """Base class of prepared tests: what only some of them have, with a default."""

    #: The law behind computed data; None where they are measured.
    known: HypoelasticLaw | None = None

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Return the specimen of each point by comparison, where they can be left out of a fit."""
        return {}

    @property
    def looks_at_data(self) -> bool:
        """Return whether `data_notes` tell what is wrong with the data."""
        return False

    @property
    def data_notes(self) -> Sequence[Note]:
        """Return notes on the data."""
        return ()

    def data_files(self) -> Sequence[DataFile]:
        """Return the measured files in their order, for the record of a run."""
        return ()

    @property
    def seen(self) -> Sequence[str]:
        """Return further lines of `check`."""
        return ()

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        """Return doubts about the data before a fit; their names are in `Kind.doubts`."""
        return ()

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return the comparisons of a fit."""
        raise NotImplementedError(f"{type(self).__name__} needs comparisons(...)")

    def virtual_work(self, make_solver: MakeSolver) -> tuple[Comparison, ...]:
        """Return the comparisons of an estimate, of virtual work for a measured shape."""
        return self.comparisons(make_solver, Weighting())


class PreparedTest(Protocol):
    """A test with its data, in memory, as worker processes get it.
    objective_is : its own objective, in words. All else that is not required is in `BasePrepared`.
    """

    @property
    def test(self) -> Test: ...

    @property
    def objective_is(self) -> str: ...

    @property
    def known(self) -> HypoelasticLaw | None: ...

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]: ...

    @property
    def looks_at_data(self) -> bool: ...

    @property
    def data_notes(self) -> Sequence[Note]: ...

    def data_files(self) -> Sequence[DataFile]: ...

    @property
    def seen(self) -> Sequence[str]: ...

    def doubts(self, expected: Expected) -> Sequence[Doubt]: ...

    def virtual_work(self, make_solver: MakeSolver) -> tuple[Comparison, ...]: ...

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


class BaseKind:
    """Base class of kinds of test: what only some of them have, with a default.

    Attributes
    ----------
    fitted : bool
        Whether a fit can match the tests.
    predicted : Predicted, optional
        Of tests that cards predict.
    studied : Studied, optional
        What a study looks at; None where none runs the tests.
    folder_key : str
        Dotted key of the folder of measured files, by which a project can be written down with the
        folder that it was run with; "" where there is none.
    doubts : sequence of str
        Names of the doubts about data before a fit.
    report : object, optional
        The presenter, where none is registered for the class.
    """

    fitted: bool = False
    predicted: Predicted | None = None
    studied: Studied | None = None
    folder_key: str = ""
    doubts: Sequence[str] = ()
    report: Any = None

    def with_units(self, section: Mapping[str, Any], scales: Scales) -> dict[str, Any]:
        """Return a section that names the units of its files, which it has by [units]."""
        return dict(section)


class Kind(Protocol):
    """A kind of test, as the registry holds it; `BaseKind` has defaults of what is optional.
    name : of its tables in a project, [[name]]. title : in a few words, for help and documents.
    section : of such a table; `name` is among its keys, and `weight` where it is fitted. A kind
    that knows tests worth making next is `Plannable`."""

    name: str
    title: str
    section: type[BaseModel]
    fitted: bool
    predicted: Predicted | None
    studied: Studied | None
    folder_key: str
    doubts: Sequence[str]

    @property
    def report(self) -> Any: ...

    def with_units(self, section: Any, scales: Scales) -> dict[str, Any]: ...

    def read(self, section: Any, place: Place, name: str) -> Test:
        """Return the test of a section, in mm, N, MPa; raises InputError naming file and key."""

    def prepare(self, test: Any, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedTest:
        """Read the data of a test that is fitted, or compute them from its known solution.
        law : all but the coefficients. Kinds that are only predicted do not have it. Raises
        InputError in the data, SolverFailure where the known solution cannot be run."""
