"""The protocols of a kind of test: its tests, these prepared with their data, plans and presenters.

A project names tests; each is of a kind. A kind reads its section of the project into a `Test`,
which makes models. Tests of a kind that can be fitted are prepared once (their data are read, or
computed) and then give comparisons of model and data to a fit, in every process that runs a start
of it; the kind's presenter says what a fit means for a test. A plan proposes candidates for the
next test. Nothing outside the folder of a kind in this package asks which kind a test is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from ..lazy_modules import pandas as pd
from ..light_dataclasses import dataclass
from ..notes import Note, NoteKind, Objection
from ..solvers.base import Array, History
from .cap import CapEstimate
from .forward import Cards, Runs, Simulation, Studied
from .predicted import Predicted
from .sections import Place, Scales

if TYPE_CHECKING:
    from ..inference.assessment import Certainty
    from ..inference.comparison import Comparison
    from ..materials.card import MaterialCard, State
    from ..materials.law import HypoelasticLaw
    from ..readers.histories import Pace
    from ..solvers.base import Solver
    from .data_files import DataFile, Output
    from .doubts import Doubt, Expected


#: Makes a new solver, so that no two models share what it prepares for its model: the solver of
#: the project, or another by its name, with the settings that the project has for it.
MakeSolver = Callable[..., "Solver"]
#: What a model is refined in.
Refined = Literal["elements", "increments"]


@dataclass(frozen=True)
class Reach:
    """The strains that the data of a test reach, as far as they are known before any fit.

    Parameters
    ----------
    strain : tuple of 3 floats
        Largest logarithmic strains (eps1, eps2, gamma12) of the data, None where unknown.
    break_shares : tuple of 3 pairs
        For each component, the two strains, as shares of the largest, at which the measured
        stiffness changes most: where a law with regions has its breaks. None where unknown.
    """

    strain: tuple[float | None, float | None, float | None] = (None, None, None)
    break_shares: tuple[tuple[float, float] | None, ...] = (None, None, None)


class BaseTest(Protocol):
    """Base class of tests, with defaults of the members that only some kinds have."""

    @property
    def state(self) -> State:
        """Return the state of the fabric in the test, "" where it is not known."""
        return ""

    @property
    def conditioning(self) -> str | None:
        """Return the user's words for the conditioning before the test, None where there are none.

        A card takes over `state` only if a test has such words.
        """
        return None

    @property
    def pace(self) -> Pace | None:
        """Return the rate of strain and the longest hold, None where the data do not tell them."""
        return None

    @property
    def reads_files(self) -> bool:
        """Return whether the data are measured files, whose folder a user can name."""
        return False

    @property
    def own_card(self) -> MaterialCard | None:
        """Return the material card that a test is run with instead of the project's, or None."""
        return None

    @property
    def data_notes(self) -> Sequence[Note]:
        """Return notes on how the data were read."""
        return ()

    @property
    def seen(self) -> Sequence[str]:
        """Return further lines that `bubblefit check` prints on the test."""
        return ()

    def data_files(self) -> Sequence[DataFile]:
        """Return the measured files in their order; empty where the data are computed."""
        return ()


class _Defaults(BaseTest):
    """The defaults of `BaseTest`, which as a protocol has no instances."""


def with_defaults(test: Any) -> Test:
    """Return a plug-in's test, given the defaults of `BaseTest` if it does not derive from it."""
    if BaseTest not in type(test).mro():
        defaults = _Defaults()
        for name in vars(BaseTest):
            if not name.startswith("_") and not hasattr(test, name):
                object.__setattr__(test, name, getattr(defaults, name))
    return test


class Test(BaseTest, Protocol):
    """One test as its section of a project describes it, in mm, N and MPa.

    `weight` is its weight among several tests in one fit, `reach` the strains that its data reach.
    """

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
        """Return the models of the test by the names of its parts.

        Parameters
        ----------
        thickness : float, mm, or None
            Thickness of the fabric; None for that of the project.
        refined : {"elements", "increments"}
            What is divided by `factor`: the edges of elements, or the load increments.
        factor : float

        Raises
        ------
        InputError
            There is no such mesh, or there are no such increments.
        """

    def settings(self) -> Mapping[str, object]:
        """Return the settings on which a result depends beside data, law and solver, no paths."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SectionTest(BaseTest):
    """Base class of tests that are read from a section of a project.

    Attributes
    ----------
    name : str
    place : Place
        Where the section stands, with its units and the fabric.
    weight : float
        Weight among several tests in one fit.
    noise : float or None
        Standard deviation of one measured value, None where the section does not say it.
    """

    #: Names of the attributes on which a result depends beside data, law and solver.
    setting_names: ClassVar[tuple[str, ...]] = ("weight", "noise")

    name: str
    place: Place
    weight: float = 1.0
    noise: float | None = None

    def settings(self) -> Mapping[str, object]:
        """Return everything but names, measurements and how these are read."""
        return {name: getattr(self, name) for name in self.setting_names}

    def thick(self, thickness: float | None) -> float:
        """Return the given thickness, mm, or that of the fabric where none is given."""
        return self.place.fabric.thickness if thickness is None else thickness


#: Which of the measured points a fit matches: a mask (points,) by name of the comparison.
Masks = Mapping[str, NDArray[np.bool_]]


@dataclass(frozen=True)
class Weighting:
    """Hold the weight of a test in the objective of a fit.

    Parameters
    ----------
    relative : bool
        Whether the blocks of the test add up to `weight` times its mean relative RMS error, so that
        a test of many blocks does not outvote one of few; otherwise the test's own objective
        weighs them.
    weight : float
        Weight of the test where `relative` is true.
    """

    relative: bool = False
    weight: float = 1.0

    def of_block(self, blocks: int) -> float:
        """Return the weight of each block of a test that has so many; 1 unless it is relative."""
        return self.weight / max(1, blocks) if self.relative else 1.0


@dataclass(frozen=True, eq=False)
class Alternative:
    """Another assumption on a test, with one unknown amount.

    Attributes
    ----------
    words : str
        What is assumed, with a `{}` for the amount.
    assumed : str
        What the project assumes in its place.
    estimate, largest : float
        First estimate of the amount, and its bound.
    prepared : callable
        Returns the test with an amount of the alternative; may raise InputError.
    is_better : NoteKind
        Kind of the note where the alternative explains the data better.
    """

    words: str
    assumed: str
    estimate: float
    largest: float
    prepared: Callable[[float], PreparedTest]
    is_better: NoteKind


class BasePrepared(Protocol):
    """Base class of prepared tests, with defaults of the members that only some kinds have."""

    #: The law behind computed data; None where they are measured.
    known: HypoelasticLaw | None = None

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Return the number of the specimen of each point, by name of the comparison.

        It is empty where specimens cannot be left out of a fit.
        """
        return {}

    @property
    def looks_at_data(self) -> bool:
        """Return whether the data were examined, so that `data_notes` say what is wrong in them."""
        return False

    @property
    def data_notes(self) -> Sequence[Note]:
        """Return notes on the data."""
        return ()

    def closed_form(self, law: HypoelasticLaw) -> CapEstimate | None:
        """Return the moduli that the data give in closed form; None where they give none.

        Parameters
        ----------
        law : HypoelasticLaw
            Poisson's ratio and change of thickness are its.
        """
        return None

    def data_files(self) -> Sequence[DataFile]:
        """Return the measured files in their order, for the record of a run."""
        return ()

    @property
    def seen(self) -> Sequence[str]:
        """Return further lines that `bubblefit check` prints on the test."""
        return ()

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        """Return doubts about the data before a fit; their names are in `Kind.doubts`."""
        return ()

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return the comparisons of a fit: models, solvers, objectives and nuisance unknowns.

        Each has the name of the test, followed by that of its part where there are several:
        "strips: warp".

        Parameters
        ----------
        make_solver : callable
            Makes the solver of a comparison.
        weighting : Weighting
        masks : mapping, optional
            The measured points that are matched; None for all.
        """
        raise NotImplementedError(f"{type(self).__name__} needs comparisons(...)")

    def alternative(self, nuisance: Mapping[str, float]) -> Alternative | None:
        """Return another assumption on the test that its best fit makes likely, or None.

        nuisance : values of the test's nuisance parameters by name
        """
        return None

    def virtual_work(self, make_solver: MakeSolver) -> tuple[Comparison, ...]:
        """Return the comparisons of the estimate before a fit.

        They balance virtual work on the measured shape for kinds that measure one; by default they
        are those of the fit.
        """
        return self.comparisons(make_solver, Weighting())


class PreparedTest(BasePrepared, Protocol):
    """A test with its data in memory, as worker processes get it.

    Members that `BasePrepared` does not have are required, and so are `comparisons`. `objective_is`
    describes the test's own objective in words.
    """

    @property
    def test(self) -> Test: ...

    @property
    def objective_is(self) -> str: ...

    @property
    def known(self) -> HypoelasticLaw | None: ...  # type: ignore[override]  # may be read-only

    def reach(self, masks: Masks) -> Reach:
        """Return the strains that the points of masks reach; for all points, the test's reach."""


@runtime_checkable
class ProgramTest(Protocol):
    """A test that a program of its own runs, with parameters that a fit seeks beside the law."""

    def solver(self, make_solver: MakeSolver) -> Solver:
        """Return what runs its models."""

    def with_values(self, values: Mapping[str, float]) -> Test:
        """Return the test with models at these values, by name; at its start values without any.

        Raises
        ------
        InputError
            One of its parameters has no value.
        """


@runtime_checkable
class LedTest(Protocol):
    """A test whose fit may be led by the model of another test of the project."""

    def led_by(self, tests: Mapping[str, Test]) -> Test:
        """Return the test with the model that leads it, of the tests of the project by name.

        Raises
        ------
        InputError
            There is no such test, or its model cannot lead.
        """


@runtime_checkable
class Divisible(Protocol):
    """A prepared test that can leave single parts of its data out of a fit.

    Its `comparisons` take the masks of `parts`, and leave out a comparison of which a mask keeps no
    point. The objectives have `spread_over_residuals(values)`, which returns for each of the m
    residuals the value of the measured point that it belongs to; with it a bootstrap lets parts
    count several times, or not at all.
    """

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return the masks that leave out each part: the points that are kept without it.

        Keys are the sort of part ("frames", "specimens"), then the name of the part ("97 kPa").
        There are only sorts of which the test has two or more parts. Masks are given for every
        comparison of the test, over its points in the order of its data.
        """


@runtime_checkable
class Refinable(Protocol):
    """A prepared test that can replace the models of its comparisons by finer or coarser ones."""

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """Return the comparisons with edges of elements and increments divided by a factor.

        Every residual belongs to the same measured value as that of `comparisons`. Data that were
        computed with the fit's own model keep their comparisons. A factor below one leaves the
        increments as they are.

        Raises
        ------
        InputError
            There is no such mesh.
        """


class BaseKind(Protocol):
    """Base class of kinds of test, with defaults of the members that only some kinds have.

    Attributes
    ----------
    fitted : bool
        Whether a fit can match tests of the kind.
    predicted : Predicted, optional
        What predicts tests of the kind with cards; None where cards do not predict them.
    studied : Studied, optional
        The quantities that a study compares; None where no study runs tests of the kind.
    folder_key : str
        Dotted key of the folder of measured files in the section, with which a project is recorded
        with the folder that it was run with; "" where there is none. Where data may stand in one of
        several tables, their keys with blanks between; arrays are of the first.
    doubts : sequence of str
        Names of the doubts that checks of the data before a fit may raise.
    report : object, optional
        The presenter, where none is registered for the class of the kind.
    """

    fitted: bool = False
    predicted: Predicted | None = None
    studied: Studied | None = None
    folder_key: str = ""
    doubts: Sequence[str] = ()
    report: Any = None

    def with_units(self, section: Mapping[str, Any], scales: Scales) -> dict[str, Any]:
        """Return a section that names the units of its files itself.

        Those that it does not name are the units that a project's [units] give it.
        """
        return dict(section)


class Kind(BaseKind, Protocol):
    """A kind of test, as the registry holds it.

    A kind that proposes tests worth making next is also `Plannable`.

    Attributes
    ----------
    name : str
        Name of its tables in a project, [[name]].
    title : str
        What the kind is, in a few words, for help and documents.
    section : type of BaseModel
        Model of such a table; it has the key `name`, and `weight` where the kind can be fitted.
    """

    name: str
    title: str
    section: type[BaseModel]

    def read(self, section: Any, place: Place, name: str) -> Test:
        """Return the test that a section describes, in mm, N and MPa.

        Parameters
        ----------
        section : object
            Section of the project file.
        place : Place
            Where the section stands.
        name : str
            Name of the test.

        Raises
        ------
        InputError
            Names the file and the key.
        """

    def prepare(self, test: Any, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedTest:
        """Read the data of a test that is fitted, or compute them from its known solution.

        Kinds that are only predicted do not have this method.

        Parameters
        ----------
        test : Test
        law : HypoelasticLaw
            The law of the fit, whose coefficients are still to be found.
        make_solver : callable
            Makes the solver that computes data.

        Raises
        ------
        InputError
            The data are missing or wrong.
        SolverFailure
            The known solution cannot be computed.
        """


#: No test pulls so that a modulus, mostly G12, is determined.
UNMATCHED = NoteKind("unmatched direction", weight=9)
DIRECTIONS_MISSED = NoteKind(
    "directions missed",
    weight=16,
    objection=Objection(
        "the law cannot follow the directions of the strips",
        'try form = "spline-ratio" in [law], or do not use the law at an angle to the yarns',
    ),
)


@dataclass(frozen=True, eq=False)
class FittedTest:
    """One test with the results of a finished fit.

    Parameters
    ----------
    comparisons : tuple of Comparison
        The test's comparisons of model and data, in its order, weighted by `Weighting()`.
    histories : tuple of History
        The response of each comparison's model with the best law.
    nuisance : mapping of str to float
        Values of the test's nuisance unknowns by their plain names, each in its unit.
    law : HypoelasticLaw
        The law that was identified.
    laws : sequence of HypoelasticLaw
        The laws found from the best starts of the fit, best first.
    reached : (3,) array
        Largest strains (eps1, eps2, gamma12) in all tests of the fit.
    valid : (3,) array
        Largest strains up to which the moduli are identified.
    certainty : Certainty, optional
        The uncertainty of the law, where it was assessed.
    compared_with : sequence of str
        Names of all comparisons of the fit, those of its other tests included.
    without_mesh_error : mapping of str to float
        The values of `nuisance` that belong to `law`, where the error of the mesh is taken out of
        both; those of `nuisance` are of the mesh of the histories.
    """

    comparisons: tuple[Comparison, ...]
    histories: tuple[History, ...]
    nuisance: Mapping[str, float]
    law: HypoelasticLaw
    laws: Sequence[HypoelasticLaw]
    reached: Array
    valid: Array
    certainty: Certainty | None
    compared_with: Sequence[str] = ()
    without_mesh_error: Mapping[str, float] = field(default_factory=dict)

    @property
    def reported_nuisance(self) -> dict[str, float]:
        """Return the values of the nuisance unknowns that are reported with the law."""
        return {**self.nuisance, **self.without_mesh_error}


@dataclass(frozen=True, eq=False)
class Findings:
    """Hold what a finished fit means for one test, in numbers and words.

    Parameters
    ----------
    numbers : dict
        Entries of result.json.
    warnings : tuple of Note
        Why the result may not be believed.
    lines : tuple of str
        Lines for the terminal.
    quality : str
        The quality of the fit in a few words, for the material card.
    summary : str
        A clause for the head of the page of the report.
    """

    numbers: dict[str, Any]
    warnings: tuple[Note, ...] = ()
    lines: tuple[str, ...] = ()
    quality: str = ""
    summary: str = ""


class Presenter(Protocol):
    """Describe what runs need of a kind's presenter; `reports` needs further members."""

    def findings(self, prepared: Any, fitted: FittedTest) -> Findings:
        """Return what a finished fit means for a test: numbers, warnings and words.

        Parameters
        ----------
        prepared : PreparedTest
            The test with its data.
        fitted : FittedTest
            What the fit made of it.
        """

    def residuals(self, prepared: Any, fitted: FittedTest) -> pd.DataFrame:
        """Return the table of residuals, with a row for each matched value.

        Returns
        -------
        DataFrame
            Columns: part, columns that say where the value is, then quantity, measured, modelled,
            difference and unit.
        """

    def simulate(
        self,
        test: Any,
        cards: Cards,
        runs: Runs,
        out: Output,
        within_range: bool = False,
    ) -> Simulation:
        """Write files and figures of a test's forward analyses, and return their results.

        Parameters
        ----------
        test : Test
            The test that was run.
        cards : mapping of str to MaterialCard
            The cards by name.
        runs : mapping of (str, str) to CardRun
            The analyses by (name of the card, name of the part of the test).
        out : Output
            Where files are written.
        within_range : bool
            Whether curves are shown only up to the end of a card's valid range of strain.
        """


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
