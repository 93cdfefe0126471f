"""Does a fit foretell what it was not given? Tests, or parts of them, left out in turn."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ..errors import InputError
from ..experiments.kinds import (
    Divisible,
    FittableTest,
    FittedTest,
    MakeSolver,
    Masks,
    PreparedTest,
    Weighting,
    beyond,
    strains_of,
    unstable_words,
)
from ..experiments.registry import report_of
from ..files import __version__
from ..inference.comparison import Blocks
from ..inference.problem import Evaluation, FitProblem
from ..inference.search import evaluate_law, problem_at
from ..materials.card import MaterialCard, thickness_difference
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, rows
from ..project.project import Project
from .best import LEAST_STRAIN
from .compare import candidates, errors, fit_of, plain
from .executor import executor_of
from .fit import FitEvent
from .presenters import write_report
from .result import Fit
from .series import begin_study, mark_of, read_marked, write_marked
from .setup import FitSetup, fingerprints, prepare_fit
from .stored_fit import stored_fit

if TYPE_CHECKING:
    import pandas as pd

#: Values of what is no law, by comparison and name, in its units.
NuisanceValues = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """How a law does at one test.

    test : its name. error : mean relative RMS error, None where an analysis failed. rms : by
    comparison, in `unit`s. notes : what a reader should know of it. words, numbers : what the test
    itself says of how good it is, as it does of a fit.
    """

    test: str
    error: float | None
    rms: Mapping[str, float]
    units: Mapping[str, str]
    notes: tuple[Note, ...] = ()
    words: str = ""
    numbers: Mapping[str, Any] = field(default_factory=dict)


def held_out(prepared: PreparedTest, law: HypoelasticLaw, make_solver: MakeSolver) -> HeldOut:
    """Run a law on a test; what the test leaves open beside the law is fitted to it.

    law : with the strain range for which it is known.
    """
    name = prepared.test.name
    comparisons = prepared.comparisons(make_solver, Weighting(relative=True))
    problem, y = problem_at(law, comparisons)
    units = {c.name: c.objective.unit for c in comparisons}
    point = evaluate_law(problem, y)
    if point is None:
        return not_judged(name, f"no analysis: {problem.failure}", units)
    notes = tuple(note.about(name) for note in _notes(problem, point, law))
    rms = errors(problem, point.residual)
    own = report_of(prepared.test.kind).findings(
        prepared, _fitted(prepared, problem, point, law, make_solver)
    )
    return HeldOut(name, point.value, rms, units, notes, own.quality, own.numbers)


def held_out_part(
    prepared: PreparedTest,
    law: HypoelasticLaw,
    make_solver: MakeSolver,
    part: Masks,
    nuisance: NuisanceValues,
    name: str,
) -> HeldOut:
    """Run a law on a test and judge it at a part of it alone.

    What the test leaves open beside the law is what the fit to the rest of it has found.

    Parameters
    ----------
    part : the points of the part, of every comparison of the test. nuisance : by comparison and
    name. name : of the test with its part.
    """
    comparisons = prepared.comparisons(make_solver, Weighting(relative=True), part)
    problem, y = problem_at(law, comparisons)
    units = {c.name: c.objective.unit for c in comparisons}
    for comparison in comparisons:
        known = nuisance.get(comparison.name, {})
        places = problem.unknowns.nuisance_places(comparison.name)
        y[places] = [known.get(n.name, 0.0) for n in comparison.nuisance]
    point = problem.evaluate(y, False, warm=False)
    if point is None:
        return not_judged(name, f"no analysis: {problem.failure}", units)
    blocks = point.residual[: sum(sum(c.objective.sizes) for c in comparisons)]
    error = float(np.sum(Blocks([n for c in comparisons for n in c.objective.sizes]).norms(blocks)))
    notes = tuple(note.about(name) for note in _notes(problem, point, law))
    return HeldOut(name, error, errors(problem, point.residual), units, notes)


def not_judged(name: str, why: str, units: Mapping[str, str]) -> HeldOut:
    """Of a test, or a part of it, at which no law was judged."""
    return HeldOut(name, None, {}, units, (Note(NoteKind.FAILED, why, name),))


def _fitted(
    prepared: PreparedTest,
    problem: FitProblem,
    point: Evaluation,
    law: HypoelasticLaw,
    make_solver: MakeSolver,
) -> FittedTest:
    """The test as it is after a fit, in its own objective."""
    reached = np.maximum(np.max([strains_of(h) for h in point.histories], axis=0), LEAST_STRAIN)
    own = prepared.comparisons(make_solver, Weighting())
    values = [problem.unknowns.nuisance_values(c.name, point.unknowns) for c in own]
    nuisance = {name: value for of_one in values for name, value in of_one.items()}
    valid = np.minimum(reached, law.strain_range)
    return FittedTest(own, point.histories, nuisance, law, [law], reached, valid, None)


def _notes(problem: FitProblem, point: Evaluation, law: HypoelasticLaw) -> list[Note]:
    notes = []
    for comparison, history in zip(problem.comparisons, point.histories, strict=True):
        part = comparison.name if len(problem.comparisons) > 1 else ""
        words = [
            Note(
                NoteKind.BEYOND_CARD,
                f"{strain} strain {at:.3f} is beyond {end:.3f}, up to which the law is known: "
                "modulus held there",
                part,
            )
            for strain, at, end in beyond(strains_of(history), law.strain_range)
        ]
        unstable = [Note(n.kind, str(n), part) for n in unstable_words(history.unstable)]
        notes += [*words, *unstable]
    return notes


@dataclass(frozen=True, eq=False)
class Judged:
    """One law at one test.

    law : the form that was fitted, or the card. foretold : by the fit to the rest of the data, or
    by the card. fitted : by the fit to all of them, None for a card.
    """

    law: str
    foretold: HeldOut
    fitted: HeldOut | None = None


@dataclass(frozen=True, eq=False)
class Validation:
    """Laws at what they were not fitted to: whole tests, or parts (frames, ...) as `leave` says."""

    title: str
    judged: tuple[Judged, ...]
    leave: str = "tests"

    @property
    def means(self) -> dict[str, float]:
        """By law: mean of the errors foretold; NaN where one is not known."""
        laws = dict.fromkeys(one.law for one in self.judged)
        return {law: float(np.mean([*self._of(law)])) for law in laws}

    def _of(self, law: str) -> Iterable[float]:
        return (_relative(one.foretold) for one in self.judged if one.law == law)

    @property
    def notes(self) -> list[Note]:
        """Of every law, at every test."""
        return [note.about(one.law) for one in self.judged for note in one.foretold.notes]

    def table(self) -> pd.DataFrame:
        """A row a law and comparison: law, test, compared, unit, errors."""
        import pandas as pd

        return pd.DataFrame(
            [
                {
                    "law": one.law,
                    "test": one.foretold.test,
                    "compared": name,
                    "unit": unit,
                    "foretold_rms": _rms(one.foretold, name),
                    "fitted_rms": _rms(one.fitted, name),
                    "foretold_relative": _relative(one.foretold),
                    "fitted_relative": _relative(one.fitted),
                    "foretold_words": one.foretold.words,
                }
                for one in self.judged
                for name, unit in one.foretold.units.items()
            ]
        )

    @property
    def result(self) -> dict[str, Any]:
        """What result.json says."""
        table = self.table()
        means = {law: None if np.isnan(mean) else mean for law, mean in self.means.items()}
        return {
            "command": "validate",
            "title": self.title,
            "version": __version__,
            "left_out": self.leave,
            "error": "mean relative RMS error of a test, or of its part",
            "mean_foretold": means,
            "rows": [
                {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in row.items()}
                for row in table.to_dict("records")
            ],
            "notes": rows(self.notes),
        }

    def lines(self) -> list[str]:
        """The table for a terminal, and what it comes to."""
        table = self.table()
        wide = max([20, *(2 + len(name) for name in table["test"])])
        head = "left out" if self.leave != "tests" else "test left out"
        said = [f"{'law':14}{head:{wide}}{'compared':24}{'foretold':>12}{'fitted':>10}  unit"]
        for row in table.itertuples():
            said.append(
                f"{row.law:14}{row.test:{wide}}{row.compared:24}{row.foretold_rms:12.4g}"
                f"{row.fitted_rms:10.4g}  {row.unit}"
            )
        said += [
            f"{one.law}, {one.foretold.test}: {one.foretold.words}"
            for one in self.judged
            if one.foretold.words
        ]
        means = {law: mean for law, mean in self.means.items() if not np.isnan(mean)}
        said += [f"{law}: foretold {100 * mean:.3g} % on average" for law, mean in means.items()]
        if len(means) > 1:
            said.append(f"foretells best: {min(means, key=means.__getitem__)}")
        return said

    def errors(self) -> tuple[list[str], dict[str, list[float]], dict[str, list[float]]]:
        """Names of the tests or parts; by law the errors there, foretold and fitted."""
        names = list(dict.fromkeys(one.foretold.test for one in self.judged))
        laws = dict.fromkeys(one.law for one in self.judged)
        of = {(one.law, one.foretold.test): one for one in self.judged}

        def of_law(law: str, fitted: bool) -> list[float]:
            found = [of.get((law, name)) for name in names]
            return [
                np.nan if one is None else _relative(one.fitted if fitted else one.foretold)
                for one in found
            ]

        after = {law: own for law in laws if np.isfinite(own := of_law(law, True)).any()}
        return names, {law: of_law(law, False) for law in laws}, after

    def write(self, folder: Path | str) -> None:
        """Write all files and the page into a folder; raises OutputError."""
        write_report(self, folder)


def _relative(one: HeldOut | None) -> float:
    return np.nan if one is None or one.error is None else one.error


def _rms(one: HeldOut | None, comparison: str) -> float:
    return np.nan if one is None else one.rms.get(comparison, np.nan)


# Single parts of tests left out of a fit in turn: frames, specimens, directions.
#
# Every fit without a part begins at random starts of its own. From the optimum of the fit to all
# of the data a modulus that the rest does not determine would stay where the part itself had put
# it, and the part would be foretold by what was taken from it.

NO_FIT = "no fit without it ended well"


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a test, by the number of the test in a setup; masks : what is kept without it."""

    test: int
    name: str
    masks: Masks

    @property
    def alone(self) -> Masks:
        """The points of the part itself."""
        return {name: ~mask for name, mask in self.masks.items()}


def sorts_of(tests: Sequence[PreparedTest]) -> list[str]:
    """The sorts of parts that these tests have."""
    found = [sort for test in tests if isinstance(test, Divisible) for sort in test.parts]
    return list(dict.fromkeys(found))


def parts_of(setup: FitSetup, sort: str, option: str = "--leave") -> list[Part]:
    """Every part of a sort, test by test.

    option : that asked for them, for the complaint.

    Raises
    ------
    InputError : no test has two or more of them.
    """
    parts = [
        Part(number, name, masks)
        for number, test in enumerate(setup.tests)
        if isinstance(test, Divisible)
        for name, masks in test.parts.get(sort, {}).items()
    ]
    if not parts:
        there = ", ".join(sorts_of(setup.tests)) or "none"
        problem = (
            f"no test has two or more {sort} of which a fit could do without one; what can be "
            f"left out of the tests chosen: {there}, or whole tests"
        )
        raise InputError(setup.project.path, option, problem)
    return parts


def name_of(setup: FitSetup, part: Part) -> str:
    """What a part is called in tables and notes."""
    return f"{setup.tests[part.test].test.name}: {part.name}"


def judged_with(found: Fit, part: Part) -> HeldOut:
    """The fit to all of the data, at a part of them."""
    setup, problem, y = found.setup, found.problem, found.best.point.unknowns
    nuisance = {c.name: problem.unknowns.nuisance_values(c.name, y) for c in problem.comparisons}
    name, law, test = name_of(setup, part), found.card.law, setup.tests[part.test]
    return held_out_part(test, law, setup.make_solver, part.alone, nuisance, name)


def foretold(
    setup: FitSetup, parts: Sequence[Part], numbers: Sequence[int], starts: int
) -> Iterator[tuple[int, HeldOut] | None]:
    """Fit without each part and judge there: its number and how it did; None now and then.

    Parameters
    ----------
    numbers : of the parts that are left out. starts : random starts of each fit.
    """
    prepare = functools.partial(_task, setup, parts, starts)
    return executor_of(setup.project).run_tasks(prepare, numbers, "parts")


def _task(
    setup: FitSetup, parts: Sequence[Part], starts: int
) -> Callable[[int, Callable[[Any], None]], tuple[int, HeldOut]]:
    return lambda number, tell: (number, without(setup, parts[number], starts))


def without(setup: FitSetup, part: Part, starts: int) -> HeldOut:
    """The best of some starts of a fit that is not given the part, judged at the part."""
    name, test = name_of(setup, part), setup.tests[part.test]
    units = {c: "" for c in part.masks}
    own, unknowns = fit_of(setup, part.masks, starts)
    if unknowns is None:
        return not_judged(name, NO_FIT, units)
    problem = own.problem(part.masks)
    point = problem.evaluate(unknowns, False, warm=False)
    if point is None:
        return not_judged(name, f"{NO_FIT}: {problem.failure}", units)
    reached = np.maximum(np.max([strains_of(h) for h in point.histories], axis=0), LEAST_STRAIN)
    law = problem.unknowns.law(own.law, unknowns)
    # As of a card: known as far as the rest of the data has strained the fabric.
    law = replace(law, strain_range=np.minimum(reached, law.strain_range))
    nuisance = {
        c.name: problem.unknowns.nuisance_values(c.name, unknowns) for c in problem.comparisons
    }
    return held_out_part(test, law, own.make_solver, part.alone, nuisance, name)


def recorded(
    setup: FitSetup,
    parts: Sequence[Part],
    starts: int,
    folder: Path | None,
    file: str,
    tell: Callable[[str | None], None],
) -> list[HeldOut]:
    """How the fit without each part does there, as it was written where it was fitted before.

    folder, file : where each part is written as it ends, None where nothing is. tell : hears of
    each part that ended, and time pass.
    """
    mark = _mark(setup, parts, starts)
    ended = {} if folder is None else _written(folder / file, mark)
    known = {k: ended[name_of(setup, part)] for k, part in enumerate(parts)
             if name_of(setup, part) in ended}  # fmt: skip
    missing = [k for k in range(len(parts)) if k not in known]
    for event in foretold(setup, parts, missing, starts) if missing else ():
        if event is not None:
            number, judged = event
            known[number] = judged
            if folder is not None:
                _write(folder, file, mark, [known[k] for k in sorted(known)])
        tell(None if event is None else f"without {name_of(setup, parts[event[0]])}")
    return [known[k] for k in range(len(parts))]


def _mark(setup: FitSetup, parts: Sequence[Part], starts: int) -> str:
    """Of everything that the errors depend on."""
    names = [name_of(setup, part) for part in parts]
    content = {**fingerprints(setup, setup.problem()), "parts": names, "starts": starts}
    return mark_of(content)


def _write(folder: Path, file: str, mark: str, judged: Sequence[HeldOut]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    write_marked(folder, file, mark, {"parts": [_plain(one) for one in judged]})


def _written(path: Path, mark: str) -> dict[str, HeldOut]:
    """By name of the part; nothing where it is of something else, or no record at all."""
    judged = read_marked(path, mark, lambda told: [_judged(row) for row in told["parts"]])
    return {one.test: one for one in judged or ()}


def _plain(one: HeldOut) -> dict[str, Any]:
    notes = [{"kind": note.kind, "words": str(note), "of": note.of} for note in one.notes]
    return {"part": one.test, "error": one.error, "rms": dict(one.rms), "units": dict(one.units),
            "notes": notes}  # fmt: skip


def _judged(row: Mapping[str, Any]) -> HeldOut:
    notes = tuple(Note(NoteKind(n["kind"]), n["words"], n["of"]) for n in row["notes"])
    return HeldOut(row["part"], row["error"], row["rms"], row["units"], notes)


STARTS = 3
#: What is left out unless something else is asked for: whole tests.
TESTS = "tests"
#: Told the words of what is fitted as its turn comes, then the records of its starts; None now
#: and then.
Progress = Callable[[str | FitEvent | None], None]


def validate(
    project: Project,
    tests: str | Sequence[str] | None = None,
    forms: Sequence[str] = (),
    *,
    leave: str = TESTS,
    starts: int = STARTS,
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    command_line: Sequence[str] | None = None,
) -> Validation:
    """Fit all tests, then all but each in turn, and judge the fits at the test left out.

    Offsets and the sheet's surface of the test left out are no property of the fabric: they are
    fitted to it, with the law as it is. Of a part of a test (a frame) they are what the rest of
    the test has found.

    Parameters
    ----------
    tests : by name or kind; every test that can be fitted unless given.
    forms : of the moduli, as for `compare_laws`; the project's own unless given.
    leave : "tests", or a sort of parts that the tests have: "frames" of a bubble, "specimens" or
        "directions" of strips.
    out : folder with a folder for each fit, in which everything is written as it ends.

    Raises
    ------
    InputError : in the project or its data, fewer than two tests or parts, nothing to go on with.
    OutputError, NoFeasibleStart, SolverFailure : as `bubblefit.fit`.
    """
    tell = progress or (lambda event: None)
    project = project.with_fit(starts=starts)
    chosen = project.chosen(tests, fitted=True)
    if leave == TESTS and len(chosen) < 2:
        raise InputError(project.path, "", "one test is left out of two or more: there is only one")
    projects = candidates(project, forms) if forms else {project.law.form: project}
    setups, parts = {}, {}
    if leave != TESTS:  # a mistake shows before the first fit
        able = cast(Sequence[FittableTest], chosen)
        setups = {form: prepare_fit(own, able) for form, own in projects.items()}
        parts = {form: parts_of(setup, leave) for form, setup in setups.items()}
    folder = None if out is None else Path(out)
    if folder is not None:
        of = {"version": __version__, "forms": ", ".join(projects), "left out": leave}
        begin_study(folder, of, resume, overwrite, _places(projects, len(chosen)))
    judged = []

    def fitted(own: Project, name: str, names: Sequence[str], place: str) -> Fit:
        tell(name)
        into = None if folder is None else folder / place
        return stored_fit(
            own, names, into, resume=resume, overwrite=overwrite, progress=tell,
            command_line=command_line,
        )  # fmt: skip

    for form, own in projects.items():
        names = [test.name for test in chosen]
        together = fitted(own, f"{form}: all tests", names, f"{plain(form)}-all")
        if leave != TESTS:
            file = f"{plain(form)}-without-{leave}.json"
            if overwrite and folder is not None:
                (folder / file).unlink(missing_ok=True)
            tell(f"{form}: without each of {len(parts[form])} {leave}")
            told = recorded(setups[form], parts[form], starts, folder, file, tell)
            pairs = zip(parts[form], told, strict=True)
            judged += [Judged(form, one, judged_with(together, part)) for part, one in pairs]
            continue
        for k, test in enumerate(together.setup.tests):
            others = [name for name in names if name != test.test.name]
            words, place = f"{form}: without {test.test.name}", f"{plain(form)}-without-{k + 1}"
            alone = fitted(own, words, others, place)
            judged.append(Judged(form, _judge(alone, test), _judge(together, test)))
    return Validation(project.title, tuple(judged), leave)


def judge_cards(
    project: Project,
    cards: Mapping[str, MaterialCard],
    tests: str | Sequence[str] | None = None,
) -> Validation:
    """Cards at the tests of a project, without any fit of the law.

    Raises
    ------
    InputError : in the project or its data, a card of another thickness than the fabric's.
    """
    for name, card in cards.items():
        if (words := thickness_difference(card, project.fabric.thickness)) is not None:
            raise InputError(project.path, "fabric.thickness", f"{name}: {words}")
    chosen = project.chosen(tests, fitted=True)
    setup = prepare_fit(project, cast(Sequence[FittableTest], chosen))
    judged = [
        Judged(name, held_out(test, card.law, setup.make_solver))
        for name, card in cards.items()
        for test in setup.tests
    ]
    return Validation(project.title, tuple(judged))


def _places(forms: Iterable[str], tests: int) -> list[str]:
    """Folders of the fits."""
    names = ["all", *(f"without-{k + 1}" for k in range(tests))]
    return [f"{plain(form)}-{name}" for form in forms for name in names]


def _judge(found: Fit, test: PreparedTest) -> HeldOut:
    return held_out(test, found.card.law, found.setup.make_solver)
