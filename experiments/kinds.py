"""What a kind of test is to the rest of the house.

A project names tests; each is of a kind. A kind reads its section of the project into a `Test`,
which makes models. Tests of a kind that can be fitted are prepared once (data read, or computed)
and then give comparisons to a fit, in every process that runs starts; what a fit means for a test
is told by the test itself. Nothing outside a folder of this package asks which kind a test is.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..materials.card import MaterialCard, positive, thickness_difference
from ..notes import Note, NoteKind, as_note
from ..readers.frames import FrameSource
from ..readers.sections import ModulusUnit
from ..solvers.base import History, instability

if TYPE_CHECKING:
    import pandas as pd
    from pydantic import BaseModel

    from ..inference.assessment import Certainty
    from ..inference.comparison import Comparison
    from ..materials.law import HypoelasticLaw, ThicknessChange
    from ..solvers.base import BandEnd, Solver

#: A file below the output folder, and its caption or what it is.
Shown = tuple[str, str]
#: Bytes of a test's name in the names of its files.
LONGEST = 80


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


Array = NDArray[np.float64]
#: Makes a solver of its own for a model, so that what it prepares for the model is not shared:
#: the project's, or another by its name, with the settings that the project has for it.
MakeSolver = Callable[..., "Solver"]
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
        """Return the test of a section, in mm, N, MPa.

        Raises
        ------
        InputError : naming the file and the dotted key, or a data file.
        """

    def prepare(self, test: Any, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedTest:
        """Read the data of a test that is fitted, or compute them from its known solution.

        law : all but the coefficients. Kinds that are only predicted do not have it.

        Raises
        ------
        InputError : in the data. SolverFailure : the known solution cannot be run.
        """


#: Which of the measured points a fit matches, by name of the comparison.
Masks = Mapping[str, NDArray[np.bool_]]


@dataclass(frozen=True)
class Weighting:
    """How much a test counts.

    relative : the blocks of a test add up to `weight` times its mean relative RMS error, so that a
    test of many blocks does not outvote one of few; otherwise they are as its own objective has
    them.
    """

    relative: bool = False
    weight: float = 1.0


#: A test whose measurement a fit can match.
FittableTest = Test


class PreparedTest(Protocol):
    """A test with its data, in memory: what worker processes are given.

    One whose data are measured files also offers them for the record of a run
    (`data_files.OfFiles`), as a test that is predicted does.

    A kind that looks at its data before a fit also has `doubts(expected)`, the reasons to doubt
    them (`Doubt`); the kind itself then lists the names of its doubts, `Kind.doubts`.
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


def record_of(
    kind: Predicted, model: Any, outcome: History | SolverFailure, seconds: float = 0.0
) -> RunRecord:
    """The record of a run that ended, well or not.

    Whatever is no result is a failure: only the solver's own word for an end before the last frame
    makes one.
    """
    if isinstance(outcome, History):
        try:
            return RunRecord(
                seconds if outcome.seconds is None else outcome.seconds,
                early=kind.early(model, outcome),
                strain=np.maximum(np.abs(outcome.strain_min) * [0, 0, 1], outcome.strain_max),
                arrays=kind.arrays(model, outcome),
                iterations=outcome.iterations,
                unstable=outcome.unstable,
                remarks=tuple(map(as_note, outcome.remarks)),
                from_cache=outcome.from_cache,
            )
        except SolverFailure as failure:
            outcome = failure
    return RunRecord(seconds, outcome.line)


#: Strain components by name, in the order (eps1, eps2, gamma12).
STRAINS = ("warp", "fill", "shear")
#: A strain this far beyond an end, relative, is no rounding.
BEYOND = 1 + 1e-6


def unstable_words(unstable: Sequence[str] | None) -> list[Note]:
    """That equilibria at these loads (in words) are unstable, where there are any."""
    words = instability(unstable)
    return [Note(NoteKind.UNSTABLE, f"{words}: the model would not stay there")] if words else []


def strains_of(history: History) -> Array:
    """(3,) largest warp, fill and (either way) shear strain of an analysis."""
    shear = max(abs(history.strain_min[2]), abs(history.strain_max[2]))
    return np.array([history.strain_max[0], history.strain_max[1], shear])


def by_strain(values: Sequence[float] | Array) -> dict[str, float]:
    """Three values by the name of their strain component."""
    return dict(zip(STRAINS, np.asarray(values, dtype=float).tolist(), strict=True))


def beyond(reached: Array, ends: Array) -> list[tuple[str, float, float]]:
    """Name, strain and end of each strain of `reached` (3,) that is beyond its end of `ends`."""
    return [
        (name, float(s), float(end))
        for name, s, end in zip(STRAINS, reached, ends, strict=True)
        if s > end * BEYOND
    ]


def beyond_card(reached: Array, card: MaterialCard) -> list[Note]:
    """Where strains (3,) leave the range that a card is valid for."""
    return [
        Note(
            NoteKind.BEYOND_CARD,
            f"{name} strain {s:.3f} is beyond the card's valid range {end:.3f}: modulus held there",
        )
        for name, s, end in beyond(reached, card.law.strain_range)
    ]


def other_thickness(card: MaterialCard, thickness: float) -> list[Note]:
    """That a card that was run is of another thickness than the fabric's (mm), where it is."""
    words = thickness_difference(card, thickness)
    if words is None:
        return []
    return [Note(NoteKind.THICKNESS, f"{words}; it was run with the card's thickness")]


def beyond_range(reached: Array, ends: Array) -> list[Note]:
    """Where strains (3,) of a fitted test leave the range that its law was given."""
    return [
        Note(
            NoteKind.BEYOND_LAW,
            f"{name} strain reached {s:.3f}, beyond law.strain_range {end:.4g}: the modulus was "
            "held at its end value there; a wider range would let it vary",
        )
        for name, s, end in beyond(reached, ends)
    ]


def notes_of(history: History, card: MaterialCard) -> list[Note]:
    """Everything to know of an analysis with a card."""
    return _notes(history.remarks, strains_of(history), history.unstable, card)


def notes_of_record(record: RunRecord, card: MaterialCard) -> list[Note]:
    """The same of a run that is stored; nothing of one that failed, but its failure."""
    reached = np.zeros(3) if record.strain is None else record.strain
    return _notes(record.remarks, reached, record.unstable, card)


def _notes(
    remarks: Sequence[str], reached: Array, unstable: Sequence[str] | None, card: MaterialCard
) -> list[Note]:
    return [*map(as_note, remarks), *beyond_card(reached, card), *unstable_words(unstable)]


#: Of an unlimited law: no fabric is planned to be strained further (logarithmic).
MOST_STRAIN = 0.3


@dataclass(frozen=True)
class Precision:
    """How precise the values of one comparison of the project are.

    noise : in the unit of its data, as its fit reckons with. alike : how many neighbours err as
    one. values : of one block (a direction of displacement in one frame, a load curve).
    """

    noise: float
    alike: float
    values: int

    def at(self, values: int) -> float:
        """Noise of independent values if `values` of them are to say as much."""
        return self.noise * float(np.sqrt(self.alike * values / self.values))


@dataclass(frozen=True, eq=False)
class Planning:
    """What is known when a test is planned.

    Parameters
    ----------
    present : the project's own tests of the kind, with their data. precision : by name of a
        comparison. law : at the present optimum; candidates show what it makes of them.
    noise : of the kind's measured values (mm, N), where a user gives it.
    """

    place: Place
    present: Sequence[PreparedTest]
    precision: Mapping[str, Precision]
    law: HypoelasticLaw
    make_solver: MakeSolver
    noise: float | None = None

    @property
    def ends(self) -> Array:
        """(3,) strains (eps1, eps2, gamma12) to which a test is worth going: those of the law."""
        return np.minimum(self.law.strain_range, MOST_STRAIN)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A test that could be made.

    name : in a few words, one of its own. make : the test with data as the law makes them, its
    objective's least noise that of independent values; raises SolverFailure where the law cannot
    be run, InputError where there is no such model. noise_is : whose noise that is, in words.
    specimens : how many are usually tested, each as good as the other.
    """

    name: str
    make: Callable[[], PreparedTest]
    noise_is: str
    specimens: int = 1


@runtime_checkable
class Plannable(Protocol):
    """A kind of test that offers candidates."""

    def candidates(self, planning: Planning) -> Sequence[Candidate]:
        """Tests of the kind, as many as are worth comparing."""


@runtime_checkable
class Divisible(Protocol):
    """A prepared test of which single parts can be left out of a fit.

    Its `comparisons` take the masks of `parts`, and none is among them of which nothing is left.
    Their objectives say by `of_points(values)` which residuals are of which points: (m,) of values
    for the points of a mask; a bootstrap lets parts count several times, or not at all.
    """

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """By sort ("frames", "specimens") and by name ("97 kPa"): the points kept without it.

        Only sorts of which the test has two or more. Masks are of every comparison of the test,
        over its points in the order of its data; where they are turned round, its `comparisons`
        are the part alone.
        """


@runtime_checkable
class Refinable(Protocol):
    """A prepared test whose fit can be asked what a finer, or a coarser, model would have shown."""

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """Its comparisons with edges of elements and increments divided by a factor.

        Every residual is of the same measured value as that of `comparisons`. Where the data were
        computed with the fit's own model there is nothing finer: the same comparisons. A factor
        below one makes larger elements, and leaves the increments as they are.

        Raises
        ------
        InputError : there is no such mesh.
        """


#: A modulus that the data themselves tell may be off its bounds by this factor: it is a rough one.
ROUGH = 4.0


@dataclass(frozen=True)
class Doubt:
    """One trap that the data of a test seem to have fallen into.

    Parameters
    ----------
    name : of the trap, in one or two words joined by a hyphen: what is trusted by name.
    sure : whether a fit of such data would be worthless; a warning otherwise.
    text : what was seen, in numbers, what it probably is, and what to do.
    """

    name: str
    sure: bool
    text: str


@dataclass(frozen=True)
class Expected:
    """What is known of the fabric before the fit.

    moduli : least and largest at rest, MPa, by name.
    """

    moduli: Mapping[str, tuple[float, float]]

    @property
    def warp_is_stiffer(self) -> bool:
        """Whether the bounds mean the warp to be stiffer than the fill."""
        (low, high), (least, largest) = self.moduli["E1"], self.moduli["E2"]
        return low * high > 1.5 * least * largest

    def outside(self, modulus: float, names: Sequence[str]) -> str:
        """Words on a modulus (MPa) far out of the bounds of those named together, "" otherwise."""
        low = min(self.moduli[name][0] for name in names)
        high = max(self.moduli[name][1] for name in names)
        if low / ROUGH <= modulus <= high * ROUGH:
            return ""
        whose = " and ".join(names)
        return f"{modulus:.3g} MPa, and the bounds of {whose} are {low:.3g} to {high:.3g}"


@dataclass(frozen=True)
class Judgement:
    """The doubts of one test, sure ones first; those that are trusted stop nothing."""

    test: str
    doubts: tuple[Doubt, ...]
    trusted: frozenset[str]

    @property
    def errors(self) -> tuple[Doubt, ...]:
        """Sure ones that nobody trusts."""
        return tuple(d for d in self.doubts if d.sure and d.name not in self.trusted)

    @property
    def notes(self) -> tuple[Note, ...]:
        """What a reader of the result should know, trusted doubts with the word for it."""
        return tuple(
            Note(NoteKind.DOUBTFUL, d.text + self._trusted(d), self.test)
            for d in self.doubts
            if d not in self.errors
        )

    def _trusted(self, doubt: Doubt) -> str:
        return f" (trusted: {doubt.name})" if doubt.name in self.trusted else ""

    def demand(self, project: Path) -> None:
        """Stop at the sure doubts.

        Raises
        ------
        InputError : all of them in one line, each with the name by which it can be trusted.
        """
        if self.errors:
            said = "; ".join(f"{d.text} [{d.name}]" for d in self.errors)
            problem = f"{said}. Correct the data, or let it pass with --trust NAME"
            raise InputError(project, f"the data of {self.test!r}", problem)


def judged(test: str, doubts: Sequence[Doubt], trust: Collection[str]) -> Judgement:
    """The doubts of a test, sure ones first."""
    ordered = tuple(sorted(doubts, key=lambda d: not d.sure))
    return Judgement(test, ordered, frozenset(trust))


@dataclass(frozen=True, eq=False)
class DataFile:
    """A measured file and what became of its rows.

    Parameters
    ----------
    source : its format, columns and units, and what was chosen where it leaves a choice.
    used : how many of its rows count, None where that means nothing. dropped : how many do not, by
        why.
    """

    path: Path
    source: FrameSource
    used: int | None
    dropped: Mapping[str, int] = field(default_factory=dict)


@runtime_checkable
class OfFiles(Protocol):
    """What a prepared test, or one that is predicted, offers beside its protocol for the record."""

    def data_files(self) -> Sequence[DataFile]:
        """Its measured files in the order in which they count; none where data are computed."""


def files_of(test: object) -> tuple[DataFile, ...]:
    """The measured files of a test; none of one whose kind does not offer them."""
    return tuple(test.data_files()) if isinstance(test, OfFiles) else ()


def joined(parts: Iterable[DataFile]) -> list[DataFile]:
    """One a file, in the order of their first part: rows of several parts are added up."""
    by_path: dict[Path, list[DataFile]] = {}
    for part in parts:
        by_path.setdefault(part.path, []).append(part)
    return [
        DataFile(path, same[0].source, _used(same), _added(p.dropped for p in same))
        for path, same in by_path.items()
    ]


def _used(parts: Sequence[DataFile]) -> int | None:
    counts = [part.used for part in parts if part.used is not None]
    return sum(counts) if counts else None


def _added(each: Iterable[Mapping[str, int]]) -> dict[str, int]:
    total: dict[str, int] = {}
    for counts in each:
        for why, count in counts.items():
            total[why] = total.get(why, 0) + count
    return {why: count for why, count in total.items() if count}


#: Of the directions that a card keeps, the least certain first, so many are run unless laws are
#: drawn: the others hardly move the moduli, and each costs as much as the prediction itself.
DIRECTIONS = 4
#: Standard deviations of a step along a direction; the next where a modulus would not be positive.
STEPS = (1.0, -1.0, 0.5, -0.5, 0.1, -0.1)
SEED = 0


@dataclass(frozen=True, eq=False)
class Around:
    """Runs with laws around that of a card.

    by : "directions": steps along independent directions, `steps` standard deviations each, from
    which the spread follows to first order; "samples": laws drawn from the card's certainty.
    """

    by: Literal["directions", "samples"]
    steps: Sequence[float]
    records: Sequence[RunRecord] = ()

    @property
    def failed(self) -> int:
        """How many of the runs failed."""
        return sum(bool(record.failure) for record in self.records)

    @property
    def words(self) -> str:
        """What was run."""
        lost = f", {self.failed} failed" if self.failed else ""
        along = "of its least certain directions" if self.by == "directions" else "laws drawn"
        return f"{len(self.records)} {along}{lost}"

    def sigma(self, own: Array, others: Sequence[Array | None]) -> Array:
        """(frames,) one standard deviation of a curve; NaN where it is not known.

        own : (frames,) of the card itself. others : the same of the runs, None of one that failed,
        shorter of one that ended early.
        """
        reached = [curve for curve in others if curve is not None]
        whole = np.full(len(own), np.nan)
        some = len(reached) == len(others) if self.by == "directions" else len(reached) > 1
        if not some or not reached:
            return whole
        end = min(len(own), *(len(curve) for curve in reached))
        curves = np.array([curve[:end] for curve in reached])
        if self.by == "samples":
            whole[:end] = curves.std(axis=0, ddof=1)
        else:
            steps = np.array(self.steps)[:, None]
            whole[:end] = np.sqrt((((curves - own[:end]) / steps) ** 2).sum(axis=0))
        return whole


def laws_around(
    card: MaterialCard, samples: int | None
) -> tuple[Around | None, Sequence[HypoelasticLaw]]:
    """The laws to be run around a card's, and how; nothing where the card is not said to be sure.

    samples : how many laws are drawn; None for the least certain directions, 0 for nothing.

    Raises
    ------
    ValueError : hardly any law that could be drawn has positive moduli.
    """
    sure = card.certainty
    if sure is None or samples == 0:
        return None, ()
    if samples is not None:
        laws = sure.laws(card.law, samples, np.random.default_rng(SEED))
        return Around("samples", [1.0] * samples), laws
    steps, laws = [], []
    for k in range(min(DIRECTIONS, len(sure.directions))):
        along = np.zeros(len(sure.directions))
        for step in STEPS:
            along[k] = step
            law = sure.shifted(card.law, along)
            if positive(law):
                break
        else:
            raise ValueError("a modulus is not positive next to the card's own law")
        steps.append(step)
        laws.append(law)
    return Around("directions", steps), laws
