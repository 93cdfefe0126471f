"""Cross-validate fits: leave tests, or parts of them, out in turn; weigh kinds of test otherwise.

Every fit without a part begins at random starts of its own. From the optimum of the fit to all of
the data, a modulus that the rest does not determine would keep the value that the part gave it."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import Positive, checked_arguments
from ..errors import InputError
from ..experiments.base import Divisible, Masks
from ..experiments.predicted import PredictedRun
from ..experiments.registry import kind_named
from ..inference.problem import Evaluation, FitProblem
from ..inference.search import fit_from
from ..lazy_modules import pandas as pd
from ..materials.card import MaterialCard, thickness_difference
from ..materials.forms.base import COMPONENTS
from ..notes import Note, NoteKind, note_lines, note_records
from ..project.project import Project, chosen_cards
from ..storage.plain_values import plain_values
from ..version import __version__
from .best import reached_by
from .compare import candidates, fit_of, folder_name
from .fit import fit_in_series
from .folder import OutputSettings, Presented, check_unused, finished, shown
from .held_out import HeldOut, errors, held_out, not_judged, nuisance_of
from .in_use import alone_in_folder
from .predictions import predict
from .process_pool import Task
from .progress import Listener, listener
from .result import Fit
from .setup import FitSetup, fingerprints, prepare_fit
from .simulation import FAILED, StudyRecord, begin_study

STARTS = 3
#: The sort of parts that is left out by default: whole tests.
TESTS = "tests"
NO_FIT = "no fit without it ended well"


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
        """Return the mean of the errors predicted, by law; NaN where one is not known."""
        errors: dict[str, list[float]] = {}
        for one in self.judged:
            errors.setdefault(one.law, []).append(_relative(one.predicted))
        return {law: float(np.mean(own)) for law, own in errors.items()}

    @property
    def notes(self) -> list[Note]:
        """Return the notes on predictions, by law, and those on the data of the tests judged."""
        names = {one.predicted.test for one in self.judged}
        notes = [note.about(one.law) for one in self.judged for note in one.predicted.notes]
        for name, test in self.project.tests.items():
            if any(judged == name or judged.startswith(f"{name}: ") for judged in names):
                notes += [note.about(name) for note in test.data_notes]
        return notes

    def table(self) -> pd.DataFrame:
        """Return a row a law and comparison: law, test, compared, unit, errors."""
        return pd.DataFrame(
            [
                {
                    "law": one.law,
                    "test": one.predicted.test,
                    "compared": name,
                    "unit": unit,
                    "foretold_rms": one.predicted.rms.get(name, np.nan),
                    "fitted_rms": np.nan
                    if one.fitted is None
                    else one.fitted.rms.get(name, np.nan),
                    "foretold_relative": _relative(one.predicted),
                    "fitted_relative": _relative(one.fitted),
                    "foretold_words": one.predicted.words,
                }
                for one in self.judged
                for name, unit in one.predicted.units.items()
            ]
        )

    @property
    def result(self) -> dict[str, Any]:
        table = self.table()
        return plain_values(
            {
                "command": "validate",
                "title": self.project.title,
                "version": __version__,
                "left_out": self.leave,
                "error": "mean relative RMS error of a test, or of its part",
                "mean_foretold": self.means,
                "rows": table.to_dict("records"),
                "notes": note_records(self.notes),
            }
        )

    def lines(self) -> list[str]:
        table = self.table()
        table.index = pd.Index(list(table["law"]))
        named = table.rename(columns={"foretold_rms": "predicted", "fitted_rms": "fitted"})
        said = shown(named[["test", "compared", "predicted", "fitted", "unit"]])
        said += [
            f"{one.law}, {one.predicted.test}: {one.predicted.words}"
            for one in self.judged
            if one.predicted.words
        ]
        means = {law: mean for law, mean in self.means.items() if not np.isnan(mean)}
        said += [f"{law}: predicted {100 * mean:.3g} % on average" for law, mean in means.items()]
        if len(means) > 1:
            said.append(f"predicts best: {min(means, key=means.__getitem__)}")
        return [*said, *note_lines(self.notes)]


def _relative(one: HeldOut | None) -> float:
    return np.nan if one is None or one.error is None else one.error


@dataclass(frozen=True, eq=False)
class OmittedPart:
    """A part of a test, named with it; test : its number. masks : the points kept without it."""

    test: int
    name: str
    masks: Masks

    @property
    def alone(self) -> Masks:
        """Return the points of the part itself."""
        return {name: ~mask for name, mask in self.masks.items()}


def parts_of(setup: FitSetup, sort: str, option: str = "--leave") -> list[OmittedPart]:
    """Return every part of a sort, test by test; raises InputError, naming the option: none."""
    parts = [
        OmittedPart(number, f"{test.test.name}: {name}", masks)
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


def fit_without(setup: FitSetup, part: OmittedPart, starts: int) -> HeldOut:
    """Fit without a part, from some starts, and return the errors of the best at the part."""
    name = part.name
    test = setup.tests[part.test]
    units = {c: "" for c in part.masks}
    own, unknowns = fit_of(setup, part.masks, starts)
    if unknowns is None:
        return not_judged(name, NO_FIT, units)
    problem = own.problem(part.masks)
    point = problem.evaluate(unknowns, False, warm=False)
    if point is None:
        return not_judged(name, f"{NO_FIT}: {problem.failure}", units)
    law = problem.unknowns.law(own.law, unknowns)
    # As of a card: known as far as the rest of the data has strained the fabric.
    law = replace(law, strain_range=np.minimum(reached_by(point), law.strain_range))
    nuisance = nuisance_of(problem, unknowns)
    return held_out(test, law, own.make_solver, part.alone, nuisance, name)


@dataclass(frozen=True)
class LeftOut:
    """The errors at a part, without notes, and `errors.rows` of its notes: in plain values."""

    number: int
    errors: Mapping[str, Any]
    notes: Sequence[Mapping[str, str]]


def _task(setup: FitSetup, parts: Sequence[OmittedPart], starts: int) -> Task:
    def left_out(number: int, tell: Callable[[Any], None]) -> LeftOut:
        one = fit_without(setup, parts[number], starts)
        return LeftOut(number, asdict(replace(one, notes=())), note_records(one.notes))

    return left_out


def errors_left_out(
    setup: FitSetup,
    parts: Sequence[OmittedPart],
    starts: int,
    folder: Path | None,
    file: str,
    tell: Callable[[str | None], None],
) -> list[HeldOut]:
    """Return the errors at each part of the fit without it, read where the file has them."""
    names = [part.name for part in parts]
    of = {**fingerprints(setup, setup.problem()), "parts": names, "starts": starts}
    record = StudyRecord(folder, file, "parts", LeftOut, "number", of)
    prepare = functools.partial(_task, setup, parts, starts)
    for row in record.run(setup.project, prepare, range(len(parts))):
        tell(None if row is None else f"without {names[row.number]}")
    judged = []
    for row in (record.rows[k] for k in range(len(parts))):
        notes = tuple(Note(NoteKind(n["kind"]), n["note"], n["of"]) for n in row.notes)
        judged.append(HeldOut(**{**row.errors, "notes": notes}))
    return judged


@checked_arguments
@alone_in_folder
def validate(
    project: Project,
    tests: str | Sequence[str] | None = None,
    forms: Sequence[str] = (),
    *,
    cards: Sequence[str] | Mapping[str, MaterialCard] = (),
    leave: str = TESTS,
    starts: Positive = STARTS,
    trust: Sequence[str] = (),
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Listener = None,
    command_line: Sequence[str] | None = None,
) -> Validation:
    """Fit all tests, then all but each in turn, and judge the fits at the test left out.
    Offsets and the sheet's surface of a test left out are fitted to it, with the law as it is. For
    a part of a test (a frame) they are those of the fit to the rest of the test. forms : of the
    moduli, as for `compare`; the project's own unless given. leave : "tests", or a sort of parts
    that the tests have: "frames" of a bubble, "specimens" or "directions" of strips. cards : judged
    at every test instead, without a fit: by name, or names and files as for the command. out :
    folder of the study, with a folder for each fit. The other arguments and the errors are those of
    `fit`. InputError also : fewer than two tests or parts."""
    if cards:
        check_unused(out, False, overwrite)
        given = cards if isinstance(cards, Mapping) else chosen_cards(project, cards)
        return finished(judge_cards(project, given, tests), out)
    output = OutputSettings.of(out, resume, overwrite, command_line)
    tell = listener(progress)
    project = project.with_fit(starts=starts, trust=[*project.fit.trust, *trust])
    chosen = [test for test in project.chosen(tests, fitted=True) if test.weight > 0]
    if leave == TESTS and len(chosen) < 2:
        raise InputError(project.path, "", "one test is left out of two or more: there is only one")
    projects = candidates(project, forms) if forms else {project.law.form: project}
    setups = {}
    parts = {}
    if leave != TESTS:  # a mistake shows before the first fit
        setups = {form: prepare_fit(own, chosen) for form, own in projects.items()}
        parts = {form: parts_of(setup, leave) for form, setup in setups.items()}
    places = ["all", *(f"without-{k + 1}" for k in range(len(chosen)))]
    folder = begin_study(
        output,
        {"forms": ", ".join(projects), "left out": leave},
        [f"{folder_name(form)}-{place}" for form in projects for place in places],
        [f"{folder_name(form)}-without-{leave}.json" for form in projects],
    )
    fitted = functools.partial(fit_in_series, output=output, progress=tell)
    names = [test.name for test in chosen]
    judged = []
    for form, own in projects.items():
        together = fitted(own, names, f"{form}: all tests", f"{folder_name(form)}-all")
        if leave != TESTS:
            file = f"{folder_name(form)}-without-{leave}.json"
            tell(f"{form}: without each of {len(parts[form])} {leave}")
            alone = errors_left_out(setups[form], parts[form], starts, folder, file, tell)
            whole = together.setup
            law = together.card.law
            nuisance = nuisance_of(together.problem, together.best.point.unknowns)
            for part, one in zip(parts[form], alone, strict=True):
                test = whole.tests[part.test]
                by_all = held_out(test, law, whole.make_solver, part.alone, nuisance, part.name)
                judged.append(Judged(form, one, by_all))
            continue
        for k, test in enumerate(together.setup.tests):
            others = [name for name in names if name != test.test.name]
            words = f"{form}: without {test.test.name}"
            place = f"{folder_name(form)}-without-{k + 1}"
            found = fitted(own, others, words, place)
            both = [held_out(test, f.card.law, f.setup.make_solver) for f in (found, together)]
            judged.append(Judged(form, *both))
    return finished(Validation(project, tuple(judged), leave), out)


def judge_cards(
    project: Project,
    cards: Mapping[str, MaterialCard],
    tests: str | Sequence[str] | None = None,
) -> Validation:
    """Judge cards at tests without any fit of the law, predicted ones by their measured loads.
    InputError : another thickness, no test to judge them at."""
    for name, card in cards.items():
        if (words := thickness_difference(card, project.fabric.thickness)) is not None:
            raise InputError(project.path, "fabric.thickness", f"{name}: {words}")
    every = project.chosen(tests)
    beside = [
        test.name
        for test in every
        if (kind := kind_named(test.kind).predicted) is not None and kind.measured(test)
    ]
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
    name = run.test.name
    units = {run.test.name: "% of the largest measured"}
    if error is None:
        return not_judged(name, ended, units)
    return HeldOut(name, error, {name: 100 * error}, units, tuple(run.notes))


# Other weights between kinds of test: one kind counts a quarter to four times

WEIGHT_STARTS = 5
#: Factors of the weight, in steps of the square root of two.
COUNTS = tuple(2.0 ** (k / 2) for k in range(-4, 5))
#: Shares of the strain reached at which moduli are followed.
PLACES = (0.0, 0.5, 1.0)
FITTED, RUNS = "fit", "weights-runs.json"
ERROR = "mean relative RMS error of a test"


@dataclass(frozen=True)
class WeightedFit:
    """The optimum where the weight of some tests is multiplied by `count`.
    relative : mean relative RMS error by test; rms : by comparison, in its unit. moduli : MPa at
    the `PLACES` of the strain that the fit at the project's weights reached. unknowns : the
    optimiser's. failure : why there is no fit, "" where there is one."""

    count: float
    relative: Mapping[str, float]
    rms: Mapping[str, float]
    moduli: Mapping[str, Sequence[float]]
    unknowns: Sequence[float]
    analyses: int
    failure: str = ""


@dataclass(frozen=True, eq=False)
class WeightStudy(Presented):
    """Fits over the weight of the tests counted (names); found : at the project's weights."""

    project: Project
    counted: str
    names: Sequence[str]
    found: Fit
    runs: Sequence[WeightedFit]

    @property
    def ended(self) -> list[WeightedFit]:
        return [run for run in self.runs if not run.failure]

    def strain(self, name: str, place: float) -> float:
        """Return the strain at which a modulus is followed."""
        return float(place * self.found.best.valid[COMPONENTS[name]])

    def table(self) -> pd.DataFrame:
        """Return a row a weight: its factor, errors by test and comparison, moduli."""
        units = {c.name: c.objective.unit for c in self.found.problem.comparisons}
        table = []
        for run in self.ended:
            row: dict[str, float] = {"weight_times": run.count}
            row |= {f"relative {test}": value for test, value in run.relative.items()}
            row |= {f"rms {name}, {units[name]}": value for name, value in run.rms.items()}
            for name, values in run.moduli.items():
                for place, value in zip(PLACES, values, strict=True):
                    row[f"{name}_MPa at {self.strain(name, place):.4g}"] = value
            table.append({**row, "analyses": run.analyses})
        return pd.DataFrame(table)

    def change(self, name: str) -> tuple[float, float]:
        """Return least and largest relative change of a modulus at any place, over all weights."""
        own = next(run for run in self.runs if run.count == 1)
        before = np.array(own.moduli[name])
        changes = np.array([run.moduli[name] for run in self.ended]) / before - 1.0
        low, high = np.round([changes.min(), changes.max()], 9) + 0.0  # no rounding of the fits
        return float(low), float(high)

    def sigma(self, name: str) -> list[float] | None:
        """Return 1 sigma, relative, at the places, at the project's weights; None if unknown."""
        sure = self.found.best.certainty
        if sure is None:
            return None
        strains = np.array([self.strain(name, place) for place in PLACES])
        return [float(v) for v in sure.at(self.found.best.law, name, strains).sigma]

    @property
    def notes(self) -> list[Note]:
        """Return fits that failed, then the notes of the one at the project's weights."""
        failed = [
            Note(FAILED, run.failure, f"weight times {run.count:.3g}")
            for run in self.runs
            if run.failure
        ]
        return [*failed, *self.found.notes]

    @property
    def result(self) -> dict[str, Any]:
        return {
            "command": "validate",
            "title": self.project.title,
            "version": __version__,
            "weights_of": self.counted,
            "tests_counted": list(self.names),
            "error": ERROR,
            "strain": {n: [self.strain(n, p) for p in PLACES] for n in COMPONENTS},
            "sigma_relative": {name: self.sigma(name) for name in COMPONENTS},
            "change": {name: list(self.change(name)) for name in COMPONENTS},
            "rows": [
                {
                    "weight_times": run.count,
                    "relative": run.relative,
                    "rms": run.rms,
                    "moduli_MPa": run.moduli,
                    "analyses": run.analyses,
                }
                for run in self.ended
            ],
            "notes": note_records(self.notes),
        }

    def lines(self) -> list[str]:
        table = self.table()
        table.index = pd.Index([f"{run.count:.3g}" for run in self.ended])
        names = [f"relative {test}" for test in self.ended[0].relative]
        names += [f"{name}_MPa at {self.strain(name, 0.5):.4g}" for name in COMPONENTS]
        head = f"weight of {self.counted}, times what the project says; {ERROR}"
        lines = [head, *shown(table[names])]
        for name in COMPONENTS:
            low, high = self.change(name)
            sigma = self.sigma(name)
            beside = "" if sigma is None else f" (1 sigma there: {100 * max(sigma):.2g} % at most)"
            lines.append(f"{name} changes by {100 * low:+.2g} to {100 * high:+.2g} %{beside}")
        return [*lines, *note_lines(self.notes)]


@checked_arguments
@alone_in_folder
def weights(
    project: Project,
    counted: str,
    tests: str | Sequence[str] | None = None,
    *,
    starts: Positive = WEIGHT_STARTS,
    counts: Sequence[float] = COUNTS,
    trust: Sequence[str] = (),
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Listener = None,
    command_line: Sequence[str] | None = None,
) -> WeightStudy:
    """Fit the tests together, then with other weights of one kind, each from its neighbour.
    counted : kind of test whose weight is changed, or the name of a test. starts : of the fit at
    the project's weights; the others begin at the optimum beside them. counts : factors of the
    weight in the project. The other arguments and the errors are those of `fit`. InputError also :
    no test of that kind or name, or no other one."""
    output = OutputSettings.of(out, resume, overwrite, command_line)
    tell = listener(progress)
    project = project.with_fit(starts=starts, trust=[*project.fit.trust, *trust])
    chosen = project.chosen(tests, fitted=True)
    names = [test.name for test in chosen if counted in (test.kind, test.name)]
    if not names or len(names) == len(chosen):
        there = ", ".join(dict.fromkeys(name for t in chosen for name in (t.kind, t.name)))
        problem = (
            f"expected a kind or a name of some of the tests that are fitted, not of all: {there}; "
            f"got {counted!r}"
        )
        raise InputError(project.path, "--weights", problem)
    of = {"counted": ", ".join(names)}
    folder = begin_study(output, of, [FITTED], [RUNS])
    found = fit_in_series(
        project,
        [test.name for test in chosen],
        "the fit at the project's weights",
        FITTED,
        output,
        tell,
    )
    at = [f"{value:.9g}" for value in found.best.point.unknowns]
    depends = {**fingerprints(found.setup, found.problem), "tests": names, "at": at}
    record = StudyRecord(folder, RUNS, "runs", WeightedFit, "count", depends, resume)
    runs = sorted(_runs(found, names, sorted(counts), record, tell), key=lambda run: run.count)
    return finished(WeightStudy(project, counted, tuple(names), found, tuple(runs)), out)


def _runs(
    found: Fit,
    names: Sequence[str],
    counts: Sequence[float],
    record: StudyRecord[WeightedFit],
    tell: Callable[..., None],
) -> Iterator[WeightedFit]:
    """Yield the fit at the project's weights, then upwards from there, then downwards."""
    own = found.best.point
    yield _weighted(found.setup, found, 1.0, found.problem, own, 0)
    for way in ([c for c in counts if c > 1], [c for c in reversed(counts) if c < 1]):
        y = np.array(own.unknowns)
        for count in way:
            run = record.rows.get(count)
            if run is None or run.failure:
                tell(f"weight times {count:.3g}")
                run = refit(found, names, count, y)
                record.write(run)
            yield run
            if not run.failure:
                y = np.array(run.unknowns)


def refit(found: Fit, names: Sequence[str], count: float, y: np.ndarray) -> WeightedFit:
    """Fit with the tests' weight times `count`, from the unknowns y of a neighbour."""
    setup = replace(found.setup, counts=dict.fromkeys(names, count))
    problem = setup.problem()
    optimum = fit_from(problem, y, setup.options, without_lead_in=True)
    if optimum is None:
        return WeightedFit(count, {}, {}, {}, (), problem.analyses, problem.failure or "no fit")
    return _weighted(setup, found, count, problem, optimum.best, optimum.analyses)


def _weighted(
    setup: FitSetup, found: Fit, count: float, problem: FitProblem, best: Evaluation, analyses: int
) -> WeightedFit:
    law = problem.unknowns.law(found.law, best.unknowns)
    moduli = {
        name: law.modulus(name, np.array(PLACES) * found.best.valid[component]).tolist()
        for name, component in COMPONENTS.items()
    }
    relative = {}
    norms = problem.norms(best.residual)
    for test, weighting in zip(setup.tests, setup.weightings, strict=True):
        own = np.concatenate([norms[c.name] for c in setup.comparisons_of(test)])
        relative[test.test.name] = float(own.sum() / weighting.weight)
    rms = errors(problem, best.residual)
    return WeightedFit(count, relative, rms, moduli, best.unknowns.tolist(), analyses)
