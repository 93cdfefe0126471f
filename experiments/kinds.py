"""The protocols of tests: how a kind reads, prepares and predicts, and the data they exchange.

A project names tests; each is of a kind. A kind reads its section of the project into a `Test`,
which makes models. Tests of a kind that can be fitted are prepared once (data read, or computed)
and then give comparisons to a fit, in every process that runs starts; the kind's presenter says
what a fit means for a test. Nothing outside a folder of this package asks which kind a test is."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from ..errors import Against, InputError, Note, NoteKind, SolverFailure, apart, as_note
from ..files import is_file, no_file_words, replacing
from ..files import pandas as pd
from ..materials.card import MaterialCard, State, thickness_difference
from ..materials.positivity import is_positive
from ..meshes.beam_model import axial_table
from ..meshes.cylinder_model import ForceTable
from ..readers.frames import FrameSource
from ..readers.machine_tables import Channel
from ..readers.registry import Content, format_named
from ..readers.sections import ModulusUnit, Number, Positive, Section, beside, unit_doubts
from ..solvers.base import History, instability

if TYPE_CHECKING:
    from ..inference.assessment import Certainty
    from ..inference.comparison import Comparison
    from ..materials.law import HypoelasticLaw, ThicknessChange
    from ..solvers.base import BandEnd, Solver

#: Kinds of notes that are made here.
BEYOND_CARD = NoteKind("beyond card range", mark=1)
UNSTABLE = NoteKind(
    "unstable",
    weight=12.5,
    mark=3,
    against=Against(
        "equilibria of the model are unstable", "leave the unstable loads out of the fit"
    ),
)
THICKNESS = NoteKind("other thickness")
BEYOND_LAW = NoteKind("beyond law.strain_range", weight=8)
UNMATCHED = NoteKind("unmatched direction", weight=9)
DOUBTFUL = NoteKind(
    "doubtful data",
    weight=12,
    against=Against("the data are doubtful", "settle the doubts about the data (bubblefit check)"),
)
READING = NoteKind("how a file was read")
STATES = NoteKind("tests in different states", weight=9)

#: A file below the output folder, and its caption or what it is.
Shown = tuple[str, str]
#: Bytes of a test's name in the names of its files.
LONGEST = 80


@dataclass(frozen=True)
class Output:
    """The place where a test writes: below `folder`, names with `prefix`."""

    folder: Path
    prefix: str = ""

    @classmethod
    def of(cls, folder: Path, test: str, several: bool) -> Output:
        """Return the output of a test; its name stands before every file's if there are several.
        What does not belong in the name of a file becomes a dash; digits tell such names apart."""
        plain = "".join(c if c.isalnum() or c in "._" else "-" for c in test)
        plain = plain.encode()[:LONGEST].decode(errors="ignore").strip("-.")
        if plain != test.replace(" ", "-"):
            plain = f"{plain}-{hashlib.sha256(test.encode()).hexdigest()[:6]}".strip("-")
        return cls(folder, f"{plain}-" if several else "")

    def name(self, file: str) -> str:
        """Return the file's name below the folder."""
        return self.prefix + file

    def path(self, file: str) -> Path:
        """Return the file."""
        return self.folder / self.name(file)

    def write(
        self, file: str, table: pd.DataFrame, what: str = "", digits: str | None = "%.9g"
    ) -> Shown:
        """Write a table as CSV; return the file and what it is."""
        with replacing(self.path(file)) as path:
            table.to_csv(path, index=False, float_format=digits)
        return self.name(file), what


Array = NDArray[np.float64]
#: Makes a solver of its own for a model, so that what it prepares for the model is not shared:
#: the project's, or another by its name, with the settings that the project has for it.
MakeSolver = Callable[..., "Solver"]
Refined = Literal["elements", "increments"]


@dataclass(frozen=True)
class Fabric:
    """The one fabric of all tests of a project; thickness in mm before the test.
    lab : who tested it, for the page."""

    name: str
    thickness: float
    thickness_change: ThicknessChange = "constant"
    lab: str = ""


@dataclass(frozen=True)
class Scales:
    """Units of a project file by name, and their sizes: MPa, MPa and mm per unit."""

    modulus: float = 1000.0
    pressure: float = 1e-3
    length: float = 1.0
    modulus_unit: ModulusUnit = "GPa"
    pressure_unit: str = "kPa"
    length_unit: str = "mm"


@dataclass(frozen=True)
class Place:
    """The place of a test: its file and key, its units, the folder of its data.
    at : dotted key of its section, "bubble[0]". data_folder : instead of the folder that the
    section names. need_data : whether measured files must be there (a forward analysis does
    without)."""

    path: Path
    at: str
    fabric: Fabric
    scales: Scales = Scales()
    data_folder: Path | None = None
    need_data: bool = True

    def error(self, field: str, problem: str) -> InputError:
        """Return an error in the section; `field` is the dotted key below it, "" for itself."""
        return InputError(self.path, f"{self.at}.{field}" if field else self.at, problem)

    def check_units(self, section: Section) -> None:
        """Refuse a section with a pressure or a size that is in another unit; InputError."""
        said = section.model_dump(exclude_unset=True, exclude_none=True)
        for key, problem in unit_doubts(type(section), said, self.scales):
            raise self.error(key, problem)

    @contextmanager
    def naming(
        self, below: str = "", field: str | None = None, keys: Mapping[str, str] | None = None
    ) -> Iterator[None]:
        """Name the section's key in errors that name no file: below a key, or `field` itself.
        keys : of the section, by fields that have another name."""
        try:
            yield
        except InputError as error:
            if error.path is not None:
                raise
            own = (keys or {}).get(error.field, error.field) if field is None else field
            raise self.error(f"{below}.{own}".strip("."), error.problem) from None

    def folder(self, named: str) -> Path:
        """Return the folder of the data: the one that its section names, unless it is given."""
        return self.data_folder or beside(self.path.parent, named)

    def has(self, file: Path, field: str) -> bool:
        """Return whether a measured file is there; raises InputError where it is needed."""
        there = is_file(file)
        if not there and self.need_data:
            raise self.error(field, f"{no_file_words(file)}; --data DIR names another folder")
        return there


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


@dataclass(frozen=True, eq=False)
class Studied:
    """The quantities of a study with a card: under refinement, or with another nu12.
    steps : load levels of a model. quantities : of interest in a study of the mesh; responses : of
    a study of nu12, in words `response`. curve : (x, y) along which levels are compared, or None.
    """

    steps: Callable[[Any], Sequence[float]]
    quantities: Callable[[Any, History], Mapping[str, float]]
    responses: Callable[[Any, History], Mapping[str, float]]
    response: str
    curve: Callable[[Any, History], tuple[Array, Array]] | None = None


def divided(steps: Sequence[float], factor: float, what: str) -> list[float]:
    """Return load steps above 0, each divided by a factor; InputError if it is no whole number."""
    if factor != int(factor):
        problem = f"the {what}'s steps are divided, never joined: use --coarser 0"
        raise InputError(None, "increments", problem)
    parts = [np.linspace(a, b, int(factor) + 1)[1:] for a, b in pairwise((0.0, *steps))]
    return [float(value) for part in parts for value in part]


@dataclass(frozen=True, eq=False)
class CardRun:
    """One card on one part of a test: the model that was run, and how it ended."""

    model: Any
    outcome: History | SolverFailure


#: Cards by name, and their runs by card and part of a test.
Cards = Mapping[str, MaterialCard]
Runs = Mapping[tuple[str, str], CardRun]


@dataclass(frozen=True, eq=False)
class Simulation:
    """The results of forward analyses: numbers for result.json, lines for the terminal, figures."""

    numbers: dict[str, Any]
    lines: Sequence[str] = ()
    figures: Sequence[Shown] = ()


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


@dataclass(frozen=True, eq=False)
class FittedTest:
    """One test with the results of a finished fit.
    comparisons, histories : its own, in its own order, as `Weighting()` gives them. nuisance : by
    plain name, in the unit of each. law : the best; laws : of the best starts, best first.
    reached : (3,) largest strain (eps1, eps2, gamma12) in all tests. valid : (3,) the ends up to
    which the moduli are fitted."""

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
    """The meaning of a fit for one test.
    numbers : for result.json. lines : for the terminal. quality : in a few words, for the card.
    summary : a clause for the head of the page."""

    numbers: dict[str, Any]
    warnings: tuple[Note, ...] = ()
    lines: tuple[str, ...] = ()
    quality: str = ""
    summary: str = ""


@dataclass(frozen=True, eq=False)
class RunRecord:
    """The end of a run of one test with one card, as it is stored.
    seconds : wall clock, when it was made. failure : why there is no result, "" where there is one;
    early : the solver's reason for an end before the last frame, "" otherwise. strain : (3,)
    largest (eps1, eps2, gamma12). arrays : that the kind of test keeps of the history. iterations,
    unstable, remarks : as the solver has them. from_cache : it was made earlier and is a cached
    run."""

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
    """One test with one card: the model, how its run ended, and notes on it.
    end : of the band that the solver gives for the model, None where it has one answer. around :
    runs with laws around the card's, None where there are none."""

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
        """Return the name of the wall that was run, "" where the solver has one answer."""
        return "" if self.end is None else self.end.name

    @property
    def predicted(self) -> bool:
        """Return whether the solver predicts it, not only as the other end of its band."""
        return self.end is None or self.end.predicted

    @property
    def title(self) -> str:
        """Return test and card; and the wall where it is the other end of a band."""
        of = f"{self.test.name} with {self.card}"
        return of if self.predicted else f"{of}, {self.wall}"


def band_of(runs: Iterable[PredictedRun]) -> list[BandEnd]:
    """Return the ends of the band that the solver gave, the prediction first; empty without one."""
    ends = [run.end for run in runs if run.end is not None]
    return list({end.name: end for end in ends}.values())


class Predicted(Protocol):
    """The protocol of a kind of test that is predicted with cards, not fitted."""

    def depends_on(self, model: Any) -> Sequence[object]:
        """Return all of a model that its result depends on: numbers, words, arrays, dataclasses."""

    def arrays(self, model: Any, history: History) -> Mapping[str, Array]:
        """Return the arrays of a history that are kept; raises SolverFailure if they do not fit."""

    def measured(self, test: Any) -> bool:
        """Return whether a test has anything measured to compare runs with."""

    def outcome(self, runs: Sequence[PredictedRun]) -> PredictedOutcome:
        """Return the outcome of runs of tests of this kind, in the order given."""


class PredictedOutcome(Protocol):
    """The outcome of runs of one kind of test, numbered in the order given."""

    def ended(self, number: int) -> str:
        """Describe the end of a run: "finished", how far it came, or why it failed."""

    def error(self, number: int) -> float | None:
        """Return RMS of model less measured over the largest measured value, if measured."""

    def numbers(self, number: int) -> Mapping[str, Any]:
        """Return the entries of result.json on a run that did not fail."""

    def columns(self, number: int) -> Mapping[str, object]:
        """Return the same as one row of a table by names of columns, with units."""

    def curve(self, number: int) -> pd.DataFrame:
        """Return the curve frame by frame; no rows where the run failed."""

    def test_numbers(self, test: Any) -> Mapping[str, Any]:
        """Return the entries of result.json on a test."""

    def lines(self) -> Sequence[str]:
        """Return a table for the terminal."""


def record_of(
    kind: Predicted, model: Any, outcome: History | SolverFailure, seconds: float = 0.0
) -> RunRecord:
    """Return the record of a run that ended, well or not; a history without a result failed."""
    if isinstance(outcome, History):
        try:
            return RunRecord(
                seconds if outcome.seconds is None else outcome.seconds,
                early=outcome.early,
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
    """Note that equilibria at these loads (in words) are unstable, where there are any."""
    words = instability(unstable)
    return [Note(UNSTABLE, f"{words}: the model would not stay there")] if words else []


def strains_of(history: History) -> Array:
    """Return (3,) largest warp, fill and (either way) shear strain of an analysis."""
    shear = max(abs(history.strain_min[2]), abs(history.strain_max[2]))
    return np.array([history.strain_max[0], history.strain_max[1], shear])


def by_strain(values: Sequence[float] | Array) -> dict[str, float]:
    """Return three values by the name of their strain component."""
    return dict(zip(STRAINS, np.asarray(values, dtype=float).tolist(), strict=True))


#: Notes on a strain beyond an end: of a card that was run, and of a test that was fitted.
HELD = "{} strain {} % is beyond the card's valid range of {} %: modulus held there"
WIDER = (
    "{} strain reached {} %, beyond law.strain_range of {} %: the modulus was held at its end "
    "value there; a wider range would let it vary"
)


def notes_beyond(
    reached: Array, ends: Array, kind: NoteKind = BEYOND_CARD, words: str = HELD
) -> list[Note]:
    """Note strains (3,) beyond their ends; words : with places for name, strain and end in %."""
    return [
        Note(kind, words.format(name, *apart(100 * strain, 100 * end)))
        for name, strain, end in zip(STRAINS, reached, ends, strict=True)
        if strain > end * BEYOND
    ]


def other_thickness(card: MaterialCard, thickness: float) -> list[Note]:
    """Note that a card that was run is of another thickness than the fabric's (mm), where it is."""
    words = thickness_difference(card, thickness)
    run = f"{words}; it was run with the card's thickness"
    return [] if words is None else [Note(THICKNESS, run)]


#: How strips say that they were not conditioned; rates or holds that differ by more are not one.
NONE, ALIKE = frozenset(("none", "no", "0", "without", "keine", "ohne")), 2.0
#: Fields of a `Pace`, in words, unit and its number, the least that matters, and what it may do.
PACES = (
    ("rate", "rate of strain", "%/min", 6000.0, 0.0,
     "coated fabrics are the stiffer the faster they are pulled, and one law lies between"),
    ("hold", "longest hold", "s", 1.0, 10.0,
     "the fabric creeps in a hold, which a law without time takes for softness or permanent set"),
)  # fmt: skip


def state_said(conditioning: str | None) -> State:
    """Return the state of a fabric by the words for its conditioning; "" where nothing is said."""
    if conditioning is None:
        return ""
    return "first loading" if conditioning.strip().casefold() in NONE else "conditioned"


def state_of(tests: Sequence[Test]) -> State:
    """Return the state of all tests where strips say one and no other test is in another."""
    states: set[Any] = {s for t in tests if (s := getattr(t, "state", ""))}
    said = any(getattr(t, "conditioning", None) for t in tests)
    return states.pop() if said and len(states) == 1 else ""


def notes_of_states(tests: Iterable[Test]) -> list[Note]:
    """Note tests that are fitted together in other states, at other rates or with other holds."""
    every = list(tests)
    states = {t.name: said for t in every if (said := getattr(t, "state", ""))}
    found = []
    if len({*states.values()}) > 1:
        words = ", ".join(f"{name}: {said}" for name, said in states.items())
        found.append(Note(STATES, f"joined tests differ in state ({words}): one law is not both"))
    paces = {t.name: pace for t in every if (pace := getattr(t, "pace", None))}
    for field_, what, unit, number, least, effect in PACES:
        each = {name: number * getattr(pace, field_) for name, pace in paces.items()}
        each = {name: value for name, value in each.items() if np.isfinite(value)}
        if each and max(each.values()) > max(ALIKE * min(each.values()), least):
            words = ", ".join(f"{name}: {value:.3g} {unit}" for name, value in each.items())
            found.append(Note(STATES, f"joined tests differ in {what} ({words}): {effect}"))
    return found


def notes_of(run: History | RunRecord, card: MaterialCard) -> list[Note]:
    """Return all notes on an analysis with a card, or on the record of one."""
    strain = strains_of(run) if isinstance(run, History) else run.strain
    reached = [] if strain is None else notes_beyond(strain, card.law.strain_range)
    return [*map(as_note, run.remarks), *reached, *unstable_words(run.unstable)]


#: Of an unlimited law: no fabric is planned to be strained further (logarithmic).
MOST_STRAIN = 0.3


@dataclass(frozen=True)
class Precision:
    """The precision of the values of one comparison of the project.
    noise : in the unit of its data, as its fit reckons with. alike : number of neighbours with one
    error. values : of one block (a direction of displacement in one frame, a load curve)."""

    noise: float
    alike: float
    values: int

    def at(self, values: int) -> float:
        """Return the noise of independent values if `values` of them are to say as much."""
        return self.noise * float(np.sqrt(self.alike * values / self.values))


@dataclass(frozen=True, eq=False)
class Planning:
    """The project as it is known when a test is planned.
    present : the project's own tests of the kind, with their data. precision : by name of a
    comparison. law : at the present optimum; candidates get their data from it. noise : of the
    kind's measured values (mm, N), where a user gives it."""

    place: Place
    present: Sequence[PreparedTest]
    precision: Mapping[str, Precision]
    law: HypoelasticLaw
    make_solver: MakeSolver
    noise: float | None = None

    @property
    def ends(self) -> Array:
        """Return (3,) largest strains (eps1, eps2, gamma12) worth testing: those of the law."""
        return np.minimum(self.law.strain_range, MOST_STRAIN)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A test that could be made.
    name : in a few words, one of its own. make : return the test with data of the law, its
    objective's least noise that of independent values; raises SolverFailure where the law cannot be
    run, InputError where there is no such model. noise_is : the source of that noise, in words.
    specimens : number that is usually tested, each as good as the other."""

    name: str
    make: Callable[[], PreparedTest]
    noise_is: str
    specimens: int = 1


@runtime_checkable
class Plannable(Protocol):
    """A kind of test that offers candidates."""

    def candidates(self, planning: Planning) -> Sequence[Candidate]:
        """Return tests of the kind, as many as are worth comparing."""


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


#: A modulus that the data themselves tell may be off its bounds by this factor: it is a rough one.
ROUGH = 4.0


@dataclass(frozen=True)
class Doubt:
    """One trap that the data of a test seem to have fallen into.
    name : one or two words joined by a hyphen, by which it is trusted. sure : whether a fit of such
    data would be worthless; a warning otherwise. text : numbers, the probable cause, and a remedy.
    """

    name: str
    sure: bool
    text: str


@dataclass(frozen=True)
class Expected:
    """Knowledge of the fabric before the fit; moduli : least and largest at rest, MPa, by name."""

    moduli: Mapping[str, tuple[float, float]]

    @property
    def warp_is_stiffer(self) -> bool:
        """Return whether the bounds mean the warp to be stiffer than the fill."""
        (low, high), (least, largest) = self.moduli["E1"], self.moduli["E2"]
        return low * high > 1.5 * least * largest

    def limits(self, names: Sequence[str]) -> tuple[float, float]:
        """Return the least and the largest of the moduli named together, MPa."""
        low = min(self.moduli[name][0] for name in names)
        high = max(self.moduli[name][1] for name in names)
        return low, high

    def outside(self, modulus: float, names: Sequence[str], factor: float = ROUGH) -> str:
        """Describe a modulus (MPa) out of the bounds of those named together; "" otherwise.

        factor : by which it may lie beyond them.
        """
        low, high = self.limits(names)
        if low / factor <= modulus <= high * factor:
            return ""
        bounds = f"the bounds of {' and '.join(names)} are {low:.3g} to {high:.3g}"
        return f"{modulus:.3g} MPa, and {bounds}"


@dataclass(frozen=True)
class Judgement:
    """The doubts of one test, sure ones first; those whose names are trusted stop nothing."""

    test: str
    doubts: tuple[Doubt, ...]
    trusted: Collection[str]

    @property
    def errors(self) -> tuple[Doubt, ...]:
        """Return sure doubts that are not trusted."""
        return tuple(d for d in self.doubts if d.sure and d.name not in self.trusted)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Return notes on all other doubts, with their name where they are trusted."""
        return tuple(
            Note(DOUBTFUL, d.text + f" (trusted: {d.name})" * (d.name in self.trusted), self.test)
            for d in self.doubts
            if d not in self.errors
        )

    def demand(self, project: Path) -> None:
        """Raise an InputError with all sure doubts in one line, each with its name."""
        if self.errors:
            said = "; ".join(f"{d.text} [{d.name}]" for d in self.errors)
            problem = f"{said}. Correct the data, or let it pass with --trust NAME"
            raise InputError(project, f"the data of {self.test!r}", problem)


@dataclass(frozen=True, eq=False)
class DataFile:
    """A measured file and the number of its rows that are used.
    source : its format, columns and units, and choices where it leaves any. used : number of rows,
    None where that means nothing. dropped : number of other rows, by why."""

    path: Path
    source: FrameSource
    used: int | None
    dropped: Mapping[str, int] = field(default_factory=dict)


def data_notes(test: object) -> tuple[Note, ...]:
    """Return what a test with its data, read or prepared, says of these data; most say nothing."""
    return tuple(getattr(test, "data_notes", ()))


def files_of(test: object) -> tuple[DataFile, ...]:
    """Return the measured files of a prepared or predicted test, its `data_files()` if it has any.
    These are in their order; none where data are computed."""
    return tuple(getattr(test, "data_files", tuple)())


def joined(parts: Iterable[DataFile]) -> list[DataFile]:
    """Return one entry a file, in the order of their first part: rows are added up."""
    files: dict[Path, DataFile] = {}
    for part in parts:
        one = files.get(part.path, DataFile(part.path, part.source, None))
        dropped = Counter(one.dropped) + Counter(part.dropped)
        used = (one.used or 0) + (part.used or 0)
        files[part.path] = DataFile(part.path, one.source, used, dict(dropped))
    return list(files.values())


#: Number of a card's directions, least certain first, that are run unless laws are drawn: others
#: hardly move the moduli, and each costs as much as the prediction itself.
DIRECTIONS = 4
#: Standard deviations of a step along a direction; the next where a modulus would not be positive.
STEPS = (1.0, -1.0, 0.5, -0.5, 0.1, -0.1)
SEED = 0


@dataclass(frozen=True, eq=False)
class Around:
    """Runs with laws around that of a card.
    by : "directions": steps along independent directions, `steps` standard deviations each, from
    which the spread follows to first order; "samples": laws drawn from the card's certainty."""

    by: Literal["directions", "samples"]
    steps: Sequence[float]
    records: Sequence[RunRecord] = ()

    @property
    def words(self) -> str:
        """Describe the runs."""
        failed = sum(bool(record.failure) for record in self.records)
        lost = f", {failed} failed" if failed else ""
        along = "of its least certain directions" if self.by == "directions" else "laws drawn"
        return f"{len(self.records)} {along}{lost}"

    def sigma(self, own: Array, others: Sequence[Array | None]) -> Array:
        """Return (frames,) one standard deviation of a curve; NaN where it is not known.
        own : (frames,) of the card itself. others : the same of the runs, None of one that failed,
        shorter of one that ended early."""
        reached = [curve for curve in others if curve is not None]
        whole = np.full(len(own), np.nan)
        least = max(1, len(others)) if self.by == "directions" else 2
        if len(reached) < least:
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
    """Return the laws to be run around a card's, and how; nothing where the card has no certainty.
    samples : number of laws to draw; None for the least certain directions, 0 for nothing. Raises
    ValueError where hardly any law that could be drawn has positive moduli."""
    sure = card.certainty
    if sure is None or samples == 0:
        return None, ()
    if samples is not None:
        laws = sure.laws(card.law, samples, np.random.default_rng(SEED))
        return Around("samples", [1.0] * samples), laws
    found = []
    for along in np.eye(len(sure.directions))[:DIRECTIONS]:
        tried = ((step, sure.shifted(card.law, step * along)) for step in STEPS)
        found.append(next((pair for pair in tried if is_positive(pair[1])), None))
    known = [pair for pair in found if pair is not None]
    if len(known) < len(found):
        raise ValueError("a modulus is not positive next to the card's own law")
    return Around("directions", [step for step, _ in known]), [law for _, law in known]


class MemberSection(Section):
    """Force of a cord by its strain, or its stiffness EA (N); N and plain strains."""

    stiffness: Positive | None = None
    strain: Annotated[list[Number], Field(min_length=2)] | None = None
    force: Annotated[list[Number], Field(min_length=2)] | None = None
    tension_only: bool = True
    prestrain: Number = 0.0

    def table(self, place: Place, at: str) -> ForceTable:
        """Return force by strain; InputError names the section's key, or `at`, its own."""
        if self.strain and self.force and self.stiffness is None:
            with place.naming(at):
                return ForceTable(np.array(self.strain), np.array(self.force))
        if self.stiffness is None or self.strain or self.force:
            raise place.error(at, "give stiffness (EA, N), or strain and force, both lists")
        return axial_table(self.stiffness)


class ChannelSection(Section):
    """A column of a measured file."""

    column: str | None = None
    unit: str | None = None
    scale: Number | None = None
    offset: Number = 0.0

    @property
    def channel(self) -> Channel:
        """Return the channel."""
        return Channel(**self.model_dump())


def listed_files(
    place: Place, folder: Path, said: Mapping[Any, Sequence[str]], at: str
) -> list[tuple[Path, str, Any]]:
    """Return each file that a section lists, its key, and the heading that it is listed under.
    said : names by heading, None for a plain list. at : dotted key of the list below the section.
    Raises InputError for a name that is listed twice."""
    found = []
    for heading, names in said.items():
        key = at if heading is None else f"{at}.{heading}"
        for i, name in enumerate(names):
            if Path(name) in map(Path, names[:i]):
                problem = f"{name!r} is listed twice; its values would count double"
                raise place.error(f"{key}[{i}]", problem)
            found.append((folder / name, f"{key}[{i}]", heading))
    return found


def named_format(place: Place, field: str, content: Content, name: str | None) -> str | None:
    """Return the name after a check that there is such a format; None where none is given.
    field : dotted key of the name below the section.
    Raises InputError: naming file and key. PlugInFailure : a reader of a plug-in that does not
    work."""
    if name is not None:
        with place.naming(field=field):
            format_named(content, name)
    return name
