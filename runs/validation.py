"""Cross-validate fits: leave tests, or parts of them, out in turn and judge the fits there.

Every fit without a part begins at random starts of its own. From the optimum of the fit to all of
the data, a modulus that the rest does not determine would keep the value that the part gave it."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, Note, NoteKind, checked, rows
from ..experiments.kinds import (
    Divisible,
    FittedTest,
    MakeSolver,
    Masks,
    PredictedRun,
    PreparedTest,
    Weighting,
    notes_beyond,
    strains_of,
    unstable_words,
)
from ..experiments.registry import kind_named, report_of
from ..files import __version__
from ..inference.comparison import Blocks
from ..inference.problem import Evaluation, FitProblem
from ..inference.search import evaluate_law, problem_at
from ..materials.card import MaterialCard, thickness_difference
from ..materials.law import HypoelasticLaw
from ..project.project import Project, chosen_cards
from .best import LEAST_STRAIN
from .compare import candidates, errors, fit_of, plain
from .executor import executor_of
from .fit import FitEvent, stored_fit
from .folder import Presented, check_asked, check_unused, finished
from .predictions import predict
from .progress import listener
from .result import Fit
from .setup import FitSetup, fingerprints, prepare_fit
from .simulation import FAILED, begin_study, mark_of, read_marked, write_marked

if TYPE_CHECKING:
    import pandas as pd

STARTS = 3
#: The sort of parts that is left out by default: whole tests.
TESTS = "tests"
NO_FIT = "no fit without it ended well"
#: Called with the words of what is fitted, then the records of its starts; None now and then.
Progress = Callable[[str | FitEvent | None], None]
#: Values of nuisance unknowns by comparison and name, in their units.
NuisanceValues = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The errors of a law at one test.
    error : mean relative RMS error, None where an analysis failed. rms : by comparison, in `units`.
    words, numbers : the quality in the test's own terms, as of a fit."""

    test: str
    error: float | None
    rms: Mapping[str, float]
    units: Mapping[str, str]
    notes: tuple[Note, ...] = ()
    words: str = ""
    numbers: Mapping[str, Any] = field(default_factory=dict)


def held_out(prepared: PreparedTest, law: HypoelasticLaw, make_solver: MakeSolver) -> HeldOut:
    """Run a law, with its known strain range, on a test and fit the test's nuisance unknowns."""
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
    prepared: PreparedTest, law: HypoelasticLaw, make_solver: MakeSolver, part: Masks,
    nuisance: NuisanceValues, name: str,
) -> HeldOut:  # fmt: skip
    """Run a law on a test and judge it at a part alone, with nuisance values of the rest."""
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
    """Return the errors of a test, or a part of it, without any."""
    return HeldOut(name, None, {}, units, (Note(FAILED, why, name),))


def _fitted(
    prepared: PreparedTest, problem: FitProblem, point: Evaluation, law: HypoelasticLaw,
    make_solver: MakeSolver,
) -> FittedTest:  # fmt: skip
    """Return the test as after a fit, in its own objective."""
    reached = np.maximum(np.max([strains_of(h) for h in point.histories], axis=0), LEAST_STRAIN)
    own = prepared.comparisons(make_solver, Weighting())
    values = [problem.unknowns.nuisance_values(c.name, point.unknowns) for c in own]
    nuisance = {name: value for of_one in values for name, value in of_one.items()}
    valid = np.minimum(reached, law.strain_range)
    return FittedTest(own, point.histories, nuisance, law, [law], reached, valid, None)


UP_TO = "{} strain {} % is beyond {} %, up to which the law is known: modulus held there"


def _notes(problem: FitProblem, point: Evaluation, law: HypoelasticLaw) -> list[Note]:
    notes = []
    for comparison, history in zip(problem.comparisons, point.histories, strict=True):
        part = comparison.name if len(problem.comparisons) > 1 else ""
        held = notes_beyond(strains_of(history), law.strain_range, words=UP_TO)
        own = [*held, *unstable_words(history.unstable)]
        notes += [Note(n.kind, str(n), part) for n in own]
    return notes


@dataclass(frozen=True, eq=False)
class Judged:
    """A form or card at one test: predicted by the rest of the data or the card, fitted by all."""

    law: str
    predicted: HeldOut
    fitted: HeldOut | None = None


@dataclass(frozen=True, eq=False)
class Validation(Presented):
    """Laws at data that they were not fitted to: whole tests, or the parts named by `leave`."""

    project: Project
    judged: tuple[Judged, ...]
    leave: str = "tests"

    @property
    def means(self) -> dict[str, float]:
        """Mean of the errors predicted, by law; NaN where one is not known."""
        errors: dict[str, list[float]] = {}
        for one in self.judged:
            errors.setdefault(one.law, []).append(_relative(one.predicted))
        return {law: float(np.mean(own)) for law, own in errors.items()}

    @property
    def notes(self) -> list[Note]:
        """Notes of every law, at every test."""
        return [note.about(one.law) for one in self.judged for note in one.predicted.notes]

    def table(self) -> pd.DataFrame:
        """Return a row a law and comparison: law, test, compared, unit, errors."""
        import pandas as pd

        return pd.DataFrame([
            {
                "law": one.law, "test": one.predicted.test, "compared": name, "unit": unit,
                "foretold_rms": one.predicted.rms.get(name, np.nan),
                "fitted_rms": np.nan if one.fitted is None else one.fitted.rms.get(name, np.nan),
                "foretold_relative": _relative(one.predicted),
                "fitted_relative": _relative(one.fitted), "foretold_words": one.predicted.words,
            }
            for one in self.judged
            for name, unit in one.predicted.units.items()
        ])  # fmt: skip

    @property
    def result(self) -> dict[str, Any]:
        """The content of result.json."""
        table = self.table()
        means = {law: None if np.isnan(mean) else mean for law, mean in self.means.items()}
        return {
            "command": "validate", "title": self.project.title, "version": __version__,
            "left_out": self.leave, "error": "mean relative RMS error of a test, or of its part",
            "mean_foretold": means,
            "rows": [
                {k: None if isinstance(v, float) and np.isnan(v) else v for k, v in row.items()}
                for row in table.to_dict("records")
            ],
            "notes": rows(self.notes),
        }  # fmt: skip

    def lines(self) -> list[str]:
        """Return a table for the terminal, and the conclusions."""
        table = self.table()
        wide = max([20, *(2 + len(name) for name in table["test"])])
        head = "left out" if self.leave != "tests" else "test left out"
        said = [f"{'law':14}{head:{wide}}{'compared':24}{'predicted':>12}{'fitted':>10}  unit"]
        for row in table.itertuples():
            said.append(
                f"{row.law:14}{row.test:{wide}}{row.compared:24}{row.foretold_rms:12.4g}"
                f"{row.fitted_rms:10.4g}  {row.unit}"
            )
        said += [
            f"{one.law}, {one.predicted.test}: {one.predicted.words}"
            for one in self.judged
            if one.predicted.words
        ]
        means = {law: mean for law, mean in self.means.items() if not np.isnan(mean)}
        said += [f"{law}: predicted {100 * mean:.3g} % on average" for law, mean in means.items()]
        if len(means) > 1:
            said.append(f"predicts best: {min(means, key=means.__getitem__)}")
        return said

    def errors(self) -> tuple[list[str], dict[str, list[float]], dict[str, list[float]]]:
        """Return names of tests or parts, and by law the errors there: predicted, fitted."""
        names = list(dict.fromkeys(one.predicted.test for one in self.judged))
        laws = dict.fromkeys(one.law for one in self.judged)
        of = {(one.law, one.predicted.test): one for one in self.judged}

        def of_law(law: str, fitted: bool) -> list[float]:
            found = [of.get((law, name)) for name in names]
            return [
                np.nan if one is None else _relative(one.fitted if fitted else one.predicted)
                for one in found
            ]

        after = {law: own for law in laws if np.isfinite(own := of_law(law, True)).any()}
        return names, {law: of_law(law, False) for law in laws}, after


def _relative(one: HeldOut | None) -> float:
    return np.nan if one is None or one.error is None else one.error


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a test, by its number in a setup; masks : the points kept without the part."""

    test: int
    name: str
    masks: Masks

    @property
    def alone(self) -> Masks:
        """Points of the part itself."""
        return {name: ~mask for name, mask in self.masks.items()}


def parts_of(setup: FitSetup, sort: str, option: str = "--leave") -> list[Part]:
    """Return every part of a sort, test by test; raises InputError, naming the option: none."""
    parts = [
        Part(number, name, masks)
        for number, test in enumerate(setup.tests)
        if isinstance(test, Divisible)
        for name, masks in test.parts.get(sort, {}).items()
    ]
    if not parts:
        sorts = [own for test in setup.tests if isinstance(test, Divisible) for own in test.parts]
        there = ", ".join(dict.fromkeys(sorts)) or "none"
        problem = (
            f"no test has two or more {sort} of which a fit could do without one; what can be "
            f"left out of the tests chosen: {there}, or whole tests"
        )
        raise InputError(setup.project.path, option, problem)
    return parts


def name_of(setup: FitSetup, part: Part) -> str:
    """Return the name of a part in tables and notes."""
    return f"{setup.tests[part.test].test.name}: {part.name}"


def errors_of_fit(found: Fit, part: Part) -> HeldOut:
    """Return the errors of the fit to all of the data at a part of them."""
    setup, problem, y = found.setup, found.problem, found.best.point.unknowns
    nuisance = {c.name: problem.unknowns.nuisance_values(c.name, y) for c in problem.comparisons}
    name, law, test = name_of(setup, part), found.card.law, setup.tests[part.test]
    return held_out_part(test, law, setup.make_solver, part.alone, nuisance, name)


def fit_without(setup: FitSetup, part: Part, starts: int) -> HeldOut:
    """Fit without a part, from some starts, and return the errors of the best at the part."""
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


def _task(
    setup: FitSetup, parts: Sequence[Part], starts: int
) -> Callable[[int, Callable[[Any], None]], tuple[int, HeldOut]]:
    return lambda number, tell: (number, fit_without(setup, parts[number], starts))


def errors_left_out(
    setup: FitSetup, parts: Sequence[Part], starts: int, folder: Path | None, file: str,
    tell: Callable[[str | None], None],
) -> list[HeldOut]:  # fmt: skip
    """Return the errors at each part of the fit without it, read where the file has them."""
    names = [name_of(setup, part) for part in parts]
    of = {**fingerprints(setup, setup.problem()), "parts": names, "starts": starts}
    mark = mark_of(of)
    written = None if folder is None else read_marked(
        folder / file, mark, lambda content: [_judged(row) for row in content["parts"]]
    )  # fmt: skip
    ended = {one.test: one for one in written or ()}
    known = {k: ended[name] for k, name in enumerate(names) if name in ended}
    missing = [k for k in range(len(parts)) if k not in known]
    prepare = functools.partial(_task, setup, parts, starts)
    events = executor_of(setup.project).run_tasks(prepare, missing, "parts") if missing else ()
    for event in events:
        if event is not None:
            number, judged = event
            known[number] = judged
            if folder is not None:
                folder.mkdir(parents=True, exist_ok=True)
                rows = [_plain(known[k]) for k in sorted(known)]
                write_marked(folder, file, mark, {"parts": rows})
        tell(None if event is None else f"without {names[event[0]]}")
    return [known[k] for k in range(len(parts))]


def _plain(one: HeldOut) -> dict[str, Any]:
    notes = [{"kind": note.kind, "words": str(note), "of": note.of} for note in one.notes]
    return {"part": one.test, "error": one.error, "rms": dict(one.rms), "units": dict(one.units),
            "notes": notes}  # fmt: skip


def _judged(row: Mapping[str, Any]) -> HeldOut:
    notes = tuple(Note(NoteKind(n["kind"]), n["words"], n["of"]) for n in row["notes"])
    return HeldOut(row["part"], row["error"], row["rms"], row["units"], notes)


@checked
def validate(
    project: Project,
    tests: str | Sequence[str] | None = None,
    forms: Sequence[str] = (),
    *, cards: Sequence[str] | Mapping[str, MaterialCard] = (), leave: str = TESTS,
    starts: int = STARTS, trust: Sequence[str] = (), out: Path | str | None = None,
    resume: bool = False, overwrite: bool = False, progress: Progress | bool | None = None,
    command_line: Sequence[str] | None = None,
) -> Validation:  # fmt: skip
    """Fit all tests, then all but each in turn, and judge the fits at the test left out.
    Offsets and the sheet's surface of a test left out are fitted to it, with the law as it is. For
    a part of a test (a frame) they are those of the fit to the rest of the test. tests : by name or
    kind; every test that can be fitted unless given. forms : of the moduli, as for `compare`;
    the project's own unless given. leave : "tests", or a sort of parts that the tests have:
    "frames" of a bubble, "specimens" or "directions" of strips. cards : judged at every test
    instead, without a fit: by name, or names and files as for the command. out : folder of the
    study, with a folder for each fit, written as the fits end. trust, progress, command_line : as
    for `fit`. Raises InputError: in the project or its data, fewer than two tests or parts, nothing
    to resume; OutputError, NoFeasibleStart, SolverFailure: as `bubblefit.fit`."""
    if cards:
        check_unused(out, False, overwrite)
        given = cards if isinstance(cards, Mapping) else chosen_cards(project, cards)
        return finished(judge_cards(project, given, tests), out)
    check_asked(out, resume, overwrite)
    tell = listener(progress)
    project = project.with_fit(starts=starts, trust=[*project.fit.trust, *trust])
    chosen = project.chosen(tests, fitted=True)
    if leave == TESTS and len(chosen) < 2:
        raise InputError(project.path, "", "one test is left out of two or more: there is only one")
    projects = candidates(project, forms) if forms else {project.law.form: project}
    setups, parts = {}, {}
    if leave != TESTS:  # a mistake shows before the first fit
        setups = {form: prepare_fit(own, chosen) for form, own in projects.items()}
        parts = {form: parts_of(setup, leave) for form, setup in setups.items()}
    folder = None if out is None else Path(out)
    if folder is not None:
        of = {"version": __version__, "forms": ", ".join(projects), "left out": leave}
        names = ["all", *(f"without-{k + 1}" for k in range(len(chosen)))]
        fits = [f"{plain(form)}-{name}" for form in projects for name in names]
        begin_study(folder, of, resume, overwrite, fits)
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
            alone = errors_left_out(setups[form], parts[form], starts, folder, file, tell)
            pairs = zip(parts[form], alone, strict=True)
            judged += [Judged(form, one, errors_of_fit(together, part)) for part, one in pairs]
            continue
        for k, test in enumerate(together.setup.tests):
            others = [name for name in names if name != test.test.name]
            words, place = f"{form}: without {test.test.name}", f"{plain(form)}-without-{k + 1}"
            found = fitted(own, words, others, place)
            judged.append(Judged(form, _judge(found, test), _judge(together, test)))
    return finished(Validation(project, tuple(judged), leave), out)


def judge_cards(
    project: Project, cards: Mapping[str, MaterialCard], tests: str | Sequence[str] | None = None,
) -> Validation:  # fmt: skip
    """Judge cards at tests without any fit of the law, predicted ones by their measured loads.
    InputError : another thickness, no test to judge them at."""
    for name, card in cards.items():
        if (words := thickness_difference(card, project.fabric.thickness)) is not None:
            raise InputError(project.path, "fabric.thickness", f"{name}: {words}")
    every = project.chosen(tests)
    beside = [
        test.name for test in every
        if (kind := kind_named(test.kind).predicted) is not None and kind.measured(test)
    ]  # fmt: skip
    judged = []
    if not beside or any(kind_named(test.kind).fitted for test in every):
        chosen = project.chosen(tests, fitted=True)
        setup = prepare_fit(project, chosen)
        judged = [
            Judged(name, held_out(test, card.law, setup.make_solver))
            for name, card in cards.items()
            for test in setup.tests
        ]
    if beside:
        found = predict(project, beside, cards, samples=0)
        judged += [
            Judged(run.card, _predicted(run, found.error(i), found.ended(i)))
            for i, run in enumerate(found.each)
            if run.predicted
        ]
    return Validation(project, tuple(judged))


def _predicted(run: PredictedRun, error: float | None, ended: str) -> HeldOut:
    """Return the error of a prediction beside what was measured, in % of the largest of that."""
    name, units = run.test.name, {run.test.name: "% of the largest measured"}
    if error is None:
        return not_judged(name, ended, units)
    return HeldOut(name, error, {name: 100 * error}, units, tuple(run.notes))


def _judge(found: Fit, test: PreparedTest) -> HeldOut:
    return held_out(test, found.card.law, found.setup.make_solver)
