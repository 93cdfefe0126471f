"""What a kind of test is to the rest of the house.

A project names tests; each is of a kind. A kind reads its section of the project into a `Test`,
which makes models. Tests of a kind that can be fitted are prepared once (data read, or computed)
and then give comparisons to a fit, in every process that runs starts; what a fit means for a test
is told by the test itself. Nothing outside a folder of this package asks which kind a test is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..notes import Note
from ..sections import ModulusUnit

if TYPE_CHECKING:  # a module of types: whoever reads a project need not wait for figures
    import pandas as pd
    from pydantic import BaseModel

    from ..identification.assessment import Certainty
    from ..identification.comparison import Comparison
    from ..materials.card import MaterialCard
    from ..materials.law import HypoelasticLaw, ThicknessChange
    from ..reports import Table
    from ..reports.content import Part
    from ..solvers.base import BandEnd, History, Solver
    from .spread import Around

Array = NDArray[np.float64]
#: Makes a solver of its own for a model, so that what it prepares for the model is not shared:
#: the project's, or another by its name, with the settings that the project has for it.
MakeSolver = Callable[..., "Solver"]
#: Which of the measured points a fit matches, by name of the comparison.
Masks = Mapping[str, NDArray[np.bool_]]
#: A file below the output folder, and its caption or what it is.
Shown = tuple[str, str]
#: Bytes of a test's name in the names of its files.
LONGEST = 80
Refined = Literal["elements", "increments"]


@dataclass(frozen=True)
class Fabric:
    """The one fabric that all tests of a project are of; thickness in mm before the test."""

    name: str
    thickness: float
    thickness_change: ThicknessChange = "constant"


@dataclass(frozen=True)
class Scales:
    """Units of a project file by name, and what they are: MPa, MPa and mm per unit."""

    modulus: float = 1000.0
    pressure: float = 1e-3
    length: float = 1.0
    modulus_unit: ModulusUnit = "GPa"
    pressure_unit: str = "kPa"
    length_unit: str = "mm"


@dataclass(frozen=True)
class Place:
    """Where a test stands: in which file, under which key, in which units, beside which data.

    at : dotted key of its section, "bubble[0]". data_folder : instead of the folder that the
    section names. need_data : whether measured files must be there (a forward analysis does
    without).
    """

    path: Path
    at: str
    fabric: Fabric
    scales: Scales = Scales()
    data_folder: Path | None = None
    need_data: bool = True

    def error(self, field: str, problem: str) -> InputError:
        """An error in the section; `field` is the dotted key below it, "" for itself."""
        return InputError(self.path, f"{self.at}.{field}" if field else self.at, problem)


@dataclass(frozen=True)
class Reach:
    """What the data of a test say of the law, before any fit.

    strain : ends (eps1, eps2, gamma12) of the logarithmic strain that the test can reach, None
    where it does not tell. break_shares : for each of them two shares of its end where the measured
    stiffness changes most, for laws with regions; None where it does not tell.
    """

    strain: tuple[float | None, float | None, float | None] = (None, None, None)
    break_shares: tuple[tuple[float, float] | None, ...] = (None, None, None)


@dataclass(frozen=True)
class Weighting:
    """How much a test counts.

    relative : the blocks of a test add up to `weight` times its mean relative RMS error, so that a
    test of many blocks does not outvote one of few; otherwise they are as its own objective has
    them.
    """

    relative: bool = False
    weight: float = 1.0


class Test(Protocol):
    """One test as its section says: lengths mm, loads N, pressures and moduli MPa."""

    @property
    def kind(self) -> str:
        """Name of its kind."""

    @property
    def name(self) -> str:
        """Its own name in the project."""

    @property
    def weight(self) -> float:
        """How much it counts among several tests in one fit."""

    @property
    def reach(self) -> Reach:
        """What its data say of the law."""

    @property
    def reads_files(self) -> bool:
        """Whether its data are measured files, which a folder can be named for."""

    def models(
        self, thickness: float | None = None, what: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, Any]:
        """Models by the name of their part.

        thickness : mm, the fabric's unless given. what, factor : edges of elements, or increments,
        divided by a factor.

        Raises
        ------
        InputError : a mesh or increments that cannot be had.
        """

    def settings(self) -> Mapping[str, object]:
        """What a result depends on beside data, law and solver: for fingerprints; without paths."""


class FittableTest(Test, Protocol):
    """A test whose measurement a fit can match."""

    def prepare(self, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedTest:
        """Read the data, or compute them with the law where the section has a known solution.

        law : all but the coefficients.

        Raises
        ------
        InputError : in the data. SolverFailure : the known solution cannot be run.
        """


class PreparedTest(Protocol):
    """A test with its data, in memory: what worker processes are given.

    One whose data are measured files also offers them for the record of a run
    (`data_files.OfFiles`), as a test that is predicted does.

    A kind that looks at its data before a fit also has `doubts(expected)`, what makes them doubtful
    (`doubts.Doubt`), and `examine(out)`, what was seen, as an `Exhibit`; the kind itself then lists
    the names of its doubts, `Kind.doubts`.
    """

    @property
    def test(self) -> FittableTest:
        """The test."""

    @property
    def objective_is(self) -> str:
        """What its own objective is, in words."""

    @property
    def known(self) -> HypoelasticLaw | None:
        """The law behind computed data."""

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Number of the specimen of each point that can be left out of a fit.

        By name of the comparison; empty where nothing can be left out.
        """

    def reach(self, masks: Masks) -> Reach:
        """What the points matched say of the law; as the test's own where nothing is left out."""

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """What a fit compares: models, solvers, objectives, nuisance unknowns.

        Each is named as the test, followed by its part where there are several: "strips: warp".
        """

    def findings(self, fitted: FittedTest) -> Findings:
        """What the best fit means for this test."""

    def show(self, fitted: FittedTest, findings: Findings, out: Output) -> Exhibit:
        """Write the test's own figures, tables and files."""

    def residuals(self, fitted: FittedTest) -> pd.DataFrame:
        """Every matched value: part, where, quantity, measured, modelled, difference, unit."""


@dataclass(frozen=True, eq=False)
class FittedTest:
    """One test in the light of a finished fit.

    comparisons, histories : its own, in its own order, as `Weighting()` gives them. nuisance : by
    plain name, in the unit of each. law : the best; laws : of the best starts, best first.
    reached : (3,) largest strain (eps1, eps2, gamma12) in all tests. valid : (3,) the ends up to
    which the moduli are fitted.
    """

    comparisons: tuple[Comparison, ...]
    histories: tuple[History, ...]
    nuisance: Mapping[str, float]
    law: HypoelasticLaw
    laws: Sequence[HypoelasticLaw]
    reached: Array
    valid: Array
    certainty: Certainty | None


@dataclass(frozen=True, eq=False)
class Findings:
    """What a fit means for one test.

    numbers : for result.json. warnings : what a reader should know. lines : for the terminal.
    quality : in a few words, for the card. summary : a clause for the head of the page.
    """

    numbers: dict[str, Any]
    warnings: tuple[Note, ...] = ()
    lines: tuple[str, ...] = ()
    quality: str = ""
    summary: str = ""


@dataclass(frozen=True, eq=False)
class Exhibit:
    """What a test puts on a page: facts, figures, tables, files that it wrote.

    parts : charts, maps and solids of its own, which stand before the pictures in `figures`.
    record : tables of how it was measured, for the record at the end of the page.
    """

    facts: Sequence[tuple[str, object]] = ()
    figures: Sequence[Shown] = ()
    tables: Sequence[Table] = ()
    files: Sequence[Shown] = ()
    parts: Sequence[Part] = ()
    record: Sequence[Table] = ()

    def all_parts(self, title: str = "") -> list[Part]:
        """What stands in the body of the page, in order; title : before it, "" for none."""
        from ..reports import Facts, pictures

        facts = [Facts(self.facts, title)] if self.facts or title else []
        return [*facts, *self.parts, *pictures(self.figures), *self.tables]


@dataclass(frozen=True)
class Output:
    """Where a test writes: below `folder`, names with `prefix` where several tests share it."""

    folder: Path
    prefix: str = ""

    @classmethod
    def of(cls, folder: Path, test: str, several: bool) -> Output:
        """Of a test by its name: before every file's where there are several tests.

        What the name of a file should not hold becomes a dash, and what is too long is cut; a few
        digits then tell such names apart.
        """
        plain = "".join(c if c.isalnum() or c in "._" else "-" for c in test)
        plain = plain.encode()[:LONGEST].decode(errors="ignore").strip("-.")
        if plain != test.replace(" ", "-"):
            plain += f"-{hashlib.sha256(test.encode()).hexdigest()[:6]}"
            plain = plain.strip("-")
        return cls(folder, f"{plain}-" if several else "")

    def name(self, file: str) -> str:
        """The file's name below the folder."""
        return self.prefix + file

    def path(self, file: str) -> Path:
        """The file."""
        return self.folder / self.name(file)


@dataclass(frozen=True, eq=False)
class Studied:
    """How a kind of test is studied with a card: what refinement, or nu12, changes.

    steps : load levels of a model. quantities : of interest in a study of the mesh; responses : of
    a study of nu12, in words `response`. curve : (x, y) along which levels are compared, None where
    there is none.
    """

    steps: Callable[[Any], Sequence[float]]
    quantities: Callable[[Any, History], Mapping[str, float]]
    responses: Callable[[Any, History], Mapping[str, float]]
    response: str
    curve: Callable[[Any, History], tuple[Array, Array]] | None = None


@dataclass(frozen=True, eq=False)
class RunRecord:
    """How a run of one test with one card ended, as it is stored.

    seconds : wall clock, of when it was made. failure : why there is no result, "" where there is
    one; early : the solver's own word for why it could go no further than it did, "" where it came
    to the end. strain : (3,) largest (eps1, eps2, gamma12). arrays : what the kind of test keeps of
    the history. iterations, unstable, remarks : as the solver says them. from_cache : it was made
    earlier and taken from the cache of runs.
    """

    seconds: float
    failure: str = ""
    early: str = ""
    strain: Array | None = None
    arrays: Mapping[str, Array] = field(default_factory=dict)
    iterations: int = 0
    unstable: tuple[str, ...] | None = None
    remarks: tuple[Note, ...] = ()
    from_cache: bool = False


@dataclass(frozen=True, eq=False)
class PredictedRun:
    """One test with one card: what was run, how it ended, what a reader should know of it.

    end : of the band that the solver gives for the model, None where it has one answer. around :
    runs with laws around the card's, None where there are none.
    """

    test: Any
    card: str
    material: MaterialCard
    model: Any
    record: RunRecord
    notes: Sequence[Note] = ()
    end: BandEnd | None = None
    around: Around | None = None

    @property
    def wall(self) -> str:
        """Name of the wall that was run, "" where the solver has one answer."""
        return "" if self.end is None else self.end.name

    @property
    def predicted(self) -> bool:
        """Whether it is what the solver predicts, not only the other end of its band."""
        return self.end is None or self.end.predicted

    @property
    def title(self) -> str:
        """Test and card; and the wall where it is the other end of a band."""
        of = f"{self.test.name} with {self.card}"
        return of if self.predicted else f"{of}, {self.wall}"


def band_of(runs: Iterable[PredictedRun]) -> list[BandEnd]:
    """The ends of the band that the solver gave, first what is predicted; empty without one."""
    ends = [run.end for run in runs if run.end is not None]
    return list({end.name: end for end in ends}.values())


class Predicted(Protocol):
    """What a kind of test offers whose tests are predicted with cards, not fitted."""

    def depends_on(self, model: Any) -> Sequence[object]:
        """All of a model that its result depends on: numbers, words, arrays, dataclasses."""

    def arrays(self, model: Any, history: History) -> Mapping[str, Array]:
        """What is kept of a history, for everything that is told of it later.

        Raises
        ------
        SolverFailure : the history is not what the model asks for.
        """

    def early(self, model: Any, history: History) -> str:
        """The solver's own word for an end before the last frame, "" where it came so far."""

    def measured(self, test: Any) -> bool:
        """Whether a test has anything measured to compare runs with."""

    def outcome(self, runs: Sequence[PredictedRun]) -> PredictedOutcome:
        """What runs of tests of this kind say, in the order given."""


class PredictedOutcome(Protocol):
    """What runs of one kind of test say; runs are named by their number in the order given."""

    def ended(self, number: int) -> str:
        """Whether a run came to its end ("finished"), how far it came, or why it failed."""

    def error(self, number: int) -> float | None:
        """RMS of model less measured over the largest measured value; None where there is none."""

    def numbers(self, number: int) -> Mapping[str, Any]:
        """Of a run that did not fail, for result.json."""

    def columns(self, number: int) -> Mapping[str, object]:
        """The same as one row of a table: by the names of the columns, units in the names."""

    def curve(self, number: int) -> pd.DataFrame:
        """Frame by frame; no rows where the run failed."""

    def test_numbers(self, test: Any) -> Mapping[str, Any]:
        """What a test is, for result.json."""

    def lines(self) -> Sequence[str]:
        """A table for the terminal."""

    def show(self, out: Output) -> Exhibit:
        """Write figures, tables and files of the runs."""


@dataclass(frozen=True, eq=False)
class CardRun:
    """One card on one part of a test: the model that was run, and how it ended."""

    model: Any
    outcome: History | SolverFailure


@dataclass(frozen=True, eq=False)
class Simulation:
    """What forward analyses gave: numbers for result.json, lines for the terminal, figures."""

    numbers: dict[str, Any]
    lines: Sequence[str] = ()
    figures: Sequence[Shown] = ()


class Kind(Protocol):
    """A kind of test, as the registry holds it.

    name : of its tables in a project, [[name]]. title : in a few words, for help and documents.
    section : what such a table may say; `name` is among it, and `weight` where it is fitted.
    fitted : whether its tests are `FittableTest`s. predicted : what tests offer that cards predict,
    None for others. studied : None where no study runs it. A kind that knows tests worth making
    next offers them (`candidates.Plannable`). A kind whose section names the folder of
    measured files has `folder_key`, the dotted key of it, by which a project can be written down
    with the folder that it was run with.
    """

    name: str
    title: str
    section: type[BaseModel]
    fitted: bool
    predicted: Predicted | None
    studied: Studied | None

    def read(self, section: Any, place: Place, name: str) -> Test:
        """The test of a section, in mm, N, MPa.

        Raises
        ------
        InputError : naming the file and the dotted key, or a data file.
        """

    def simulate(
        self,
        test: Any,
        cards: Mapping[str, MaterialCard],
        runs: Mapping[tuple[str, str], CardRun],
        out: Output,
        within_range: bool = False,
    ) -> Simulation:
        """Write and tell what cards do in a test: `runs` by (card, part); files go to `out`."""
