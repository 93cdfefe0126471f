"""Cross-validation of fits: tests, or parts of tests, are left out in turn and then predicted.

Every fit without a part begins at random starts of its own, not at the optimum of the fit to all
data: from there, a modulus that the remaining data do not determine would keep the value that the
omitted part gave it.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..arguments import Positive, checked_arguments
from ..errors import InputError
from ..experiments.base import Divisible, Masks, ProgramTest, Test, Weighting
from ..experiments.registry import kind_named
from ..lazy_modules import pandas as pd
from ..materials.card import MaterialCard, thickness_difference
from ..notes import Note, NoteKind, Verdict, note_records
from ..project.project import Project, chosen_cards
from ..version import __version__
from .compare import candidates, fit_of, folder_name, law_of_masked_data
from .fit import fit_in_series
from .folder import OutputSettings, Presented, check_unused, finished, shown
from .held_out import HeldOut, held_out, not_judged, nuisance_of
from .in_use import alone_in_folder
from .predictions import Predictions, is_measured, predict
from .process_pool import Task
from .progress import Listener, listener
from .result import Fit
from .setup import FitSetup, fingerprints, prepare_fit, tests_with_weight
from .simulation import StudyRecord, begin_study
from .starts import reached_by
from .verdict import large_errors, state_of_predictions

STARTS = 3
#: What is left out by default: whole tests.
TESTS = "tests"
NO_FIT = "no fit without it ended well"


@dataclass(frozen=True, eq=False)
class Judged:
    """Hold the errors of a law at one test, or at one part of a test.

    Attributes
    ----------
    law : str
        Name of the form of law that is fitted, or of the card that is judged.
    predicted : HeldOut
        Errors of the fit to the remaining data, or of the card.
    fitted : HeldOut or None
        Errors of the fit to all data; None for a card.
    """

    law: str
    predicted: HeldOut
    fitted: HeldOut | None = None

    @property
    def analyses(self) -> int:
        """Return the number of analyses of the fit to the remaining data and of the judging."""
        return self.predicted.analyses + (0 if self.fitted is None else self.fitted.analyses)

    def rows(self) -> list[dict[str, Any]]:
        """Return the errors as plain values, one row per comparison of the test."""
        predicted = self.predicted
        fitted_rms = {} if self.fitted is None else self.fitted.rms
        return [
            {
                "law": self.law,
                "test": predicted.test,
                "compared": name,
                "unit": unit,
                "foretold_rms": predicted.rms.get(name, np.nan),
                "fitted_rms": fitted_rms.get(name, np.nan),
                "foretold_relative": _relative_error(predicted),
                "fitted_relative": _relative_error(self.fitted),
                "foretold_words": predicted.words,
            }
            for name, unit in predicted.units.items()
        ]


def _relative_error(held_out_test: HeldOut | None) -> float:
    """Return the mean relative RMS error at a test; NaN if there is none."""
    if held_out_test is None or held_out_test.error is None:
        return np.nan
    return held_out_test.error


@dataclass(frozen=True, eq=False)
class Validation(Presented):
    """Hold how well laws predict data to which they were not fitted.

    Attributes
    ----------
    project : Project
    judged : tuple of Judged
        Errors law by law, and for each law test by test or part by part.
    leave : str
        What was left out in turn: "tests", or the sort of parts, such as "frames".
    analyses_of_all : int
        Number of analyses that the fits to all data took.
    """

    project: Project
    judged: tuple[Judged, ...]
    leave: str = TESTS
    analyses_of_all: int = 0

    @property
    def analyses(self) -> int:
        """Return the number of analyses of the tests in all fits and predictions."""
        return self.analyses_of_all + sum(judged.analyses for judged in self.judged)

    @property
    def means(self) -> dict[str, float]:
        """Return the mean relative error of the predictions by law; NaN if one is unknown."""
        errors_by_law: dict[str, list[float]] = {}
        for judged in self.judged:
            errors_by_law.setdefault(judged.law, []).append(_relative_error(judged.predicted))
        return {law: float(np.mean(errors)) for law, errors in errors_by_law.items()}

    @property
    def notes(self) -> list[Note]:
        """Return the notes on the predictions, by law, and on the data of the tests predicted."""
        notes = []
        for judged in self.judged:
            notes += [note.about(judged.law) for note in judged.predicted.notes]
        names = {judged.predicted.test for judged in self.judged}
        for test_name, test in self.project.tests.items():
            if any(name == test_name or name.startswith(f"{test_name}: ") for name in names):
                notes += [note.about(test_name) for note in test.data_notes]
        return notes

    def table(self) -> pd.DataFrame:
        """Return the errors of predictions, beside those of the fit to all data.

        Returns
        -------
        DataFrame
            One row per law and comparison: `law`; `test` (or its part); `compared`, the name of
            the comparison, and its `unit`; in that unit the RMS errors of the prediction,
            `foretold_rms`, and of the fit to all data, `fitted_rms`; the mean relative RMS errors
            at the whole test, `foretold_relative` and `fitted_relative`; and `foretold_words`, why
            there is no prediction, or "".
        """
        return pd.DataFrame([row for judged in self.judged for row in judged.rows()])

    @property
    def verdict(self) -> Verdict:
        """Return how well what was left out is predicted, and what is not."""
        means = {law: mean for law, mean in self.means.items() if not np.isnan(mean)}
        failed = [f"{j.predicted.test} ({j.law})" for j in self.judged if j.predicted.error is None]
        if not means:
            step = "see in the table why there are no predictions"
            return Verdict("not to be used", "nothing was predicted by all laws", next_step=step)
        best = min(means, key=means.__getitem__)
        subject = "what was left out is predicted" if self.leave else "the tests are met"
        words = f"{subject} with an error of {100 * means[best]:.3g} %"
        errors = {best: means[best]}
        return Verdict(
            state_of_predictions(errors, failed),
            f"{words} (mean relative RMS error of {best})",
            large_errors(errors),
            unknown=", ".join(failed),
            next_step="see which test is predicted worst: its data, or the law there, are doubtful",
        )

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the study."""
        return {
            "command": "validate",
            "title": self.project.title,
            "version": __version__,
            "left_out": self.leave or None,
            "error": "mean relative RMS error of a test, or of its part",
            "mean_foretold": self.means,
            "analyses": self.analyses,
            "rows": self.table().to_dict("records"),
        }

    def result_lines(self) -> list[str]:
        """Return the results of the study as lines of the terminal."""
        table = self.table()
        table.index = pd.Index(list(table["law"]))
        table = table.rename(columns={"foretold_rms": "predicted", "fitted_rms": "fitted"})
        lines = shown(table[["test", "compared", "predicted", "fitted", "unit"]])
        for judged in self.judged:
            if judged.predicted.words:
                lines.append(f"{judged.law}, {judged.predicted.test}: {judged.predicted.words}")
        means = {law: mean for law, mean in self.means.items() if not np.isnan(mean)}
        lines += [f"{law}: predicted {100 * mean:.3g} % on average" for law, mean in means.items()]
        if len(means) > 1:
            lines.append(f"predicts best: {min(means, key=means.__getitem__)}")
        return [*lines, f"{self.analyses} analyses of the tests"]


@dataclass(frozen=True, eq=False)
class OmittedPart:
    """Hold a part of a test that is left out of a fit.

    Attributes
    ----------
    test : int
        Index of the test in the tests of the fit, from 0.
    name : str
        Names of the test and of the part.
    masks : dict of (m,) bool arrays
        By comparison, which of its m data points remain in the fit.
    """

    test: int
    name: str
    masks: Masks

    @property
    def alone(self) -> Masks:
        """Return, by comparison, which data points belong to the part that is left out."""
        return {name: ~mask for name, mask in self.masks.items()}


def omittable_parts(setup: FitSetup, sort: str, option: str = "--leave") -> list[OmittedPart]:
    """Return every part of one sort, test by test.

    Parameters
    ----------
    setup : FitSetup
        The tests of the fit.
    sort : str
        Sort of parts, such as "frames", "specimens", "directions", "ratios" or "cycles".
    option : str
        Option of the command line that the error names.

    Raises
    ------
    InputError
        No test has two parts or more of that sort.
    """
    divisible = [
        (number, prepared)
        for number, prepared in enumerate(setup.tests)
        if isinstance(prepared, Divisible)
    ]
    parts = [
        OmittedPart(number, f"{setup.tests[number].test.name}: {name}", masks)
        for number, prepared in divisible
        for name, masks in prepared.parts.get(sort, {}).items()
    ]
    if not parts:
        sorts = dict.fromkeys(name for _, prepared in divisible for name in prepared.parts)
        problem = (
            f"no test has two or more {sort} of which a fit could do without one; what can be "
            f"left out of the tests chosen: {', '.join(sorts) or 'none'}, or whole tests"
        )
        raise InputError(setup.project.path, option, problem)
    return parts


def fit_without(setup: FitSetup, part: OmittedPart, starts: int) -> HeldOut:
    """Fit all data but one part, and return the errors of the fit at that part.

    Parameters
    ----------
    setup : FitSetup
        The fit to all data.
    part : OmittedPart
        The part to leave out.
    starts : int
        Number of random starts, of which the best fit counts.
    """
    units = {name: "" for name in part.masks}
    masked, unknowns, analyses = fit_of(setup, part.masks, starts)
    if unknowns is None:
        return not_judged(part.name, NO_FIT, units, analyses)
    problem = masked.problem(part.masks)
    point = problem.evaluate(unknowns, False, warm=False)
    if point is None:
        return not_judged(part.name, f"{NO_FIT}: {problem.failure}", units, analyses)
    law = problem.unknowns.law(masked.law, unknowns)
    # The moduli are known up to the strains of the remaining data only, as those of a card are.
    law = replace(law, strain_range=np.minimum(reached_by(point), law.strain_range))
    nuisance = nuisance_of(problem, unknowns)
    thickness = next(iter(nuisance.values())).get("thickness")
    prepared = setup.tests[part.test]
    at_part = held_out(
        prepared, law, masked.make_solver, part.alone, nuisance, part.name, thickness=thickness
    )
    return replace(at_part, analyses=analyses + problem.analyses + at_part.analyses)


@dataclass(frozen=True)
class LeftOut:
    """Hold the errors at a part that was left out in plain values, as a study's file keeps them.

    Attributes
    ----------
    number : int
        Index of the part, from 0.
    errors : mapping
        The fields of `HeldOut`, without the notes.
    notes : sequence of mappings
        The records of the notes.
    """

    number: int
    errors: Mapping[str, Any]
    notes: Sequence[Mapping[str, str]]

    @classmethod
    def of(cls, number: int, at_part: HeldOut) -> LeftOut:
        """Return the errors at the part of this number as plain values."""
        return cls(number, asdict(replace(at_part, notes=())), note_records(at_part.notes))

    def held_out(self) -> HeldOut:
        """Return the errors, with their notes."""
        notes = tuple(Note(NoteKind(n["kind"]), n["note"], n["of"]) for n in self.notes)
        return HeldOut(**{**self.errors, "notes": notes})


def _part_task(setup: FitSetup, parts: Sequence[OmittedPart], starts: int) -> Task:
    """Return the task of a process: it takes the number of a part and returns the errors there."""
    return lambda number, report: LeftOut.of(number, fit_without(setup, parts[number], starts))


def errors_left_out(
    setup: FitSetup,
    parts: Sequence[OmittedPart],
    starts: int,
    folder: Path | None,
    file: str,
    on_event: Callable[[str | None], None],
) -> list[HeldOut]:
    """Leave out each part in turn, and return the errors of each fit at the part left out.

    Parameters
    ----------
    setup : FitSetup
        The fit to all data.
    parts : sequence of OmittedPart
    starts : int
        Number of random starts of each fit.
    folder : path or None
        Folder of the study; parts that its file has are read, not fitted again.
    file : str
        Name of the file that keeps the errors.
    on_event : callable
        Receives a text when a part is done, and None now and then.
    """
    names = [part.name for part in parts]
    depends = {**fingerprints(setup, setup.problem()), "parts": names, "starts": starts}
    record = StudyRecord(folder, file, "parts", LeftOut, depends)
    prepare = functools.partial(_part_task, setup, parts, starts)
    for row in record.run(setup.project, prepare, range(len(parts))):
        on_event(None if row is None else f"without {names[row.number]}")
    return [record.rows[number].held_out() for number in range(len(parts))]


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
    """Cross-validate: fit all tests, then all but each in turn, and predict the omitted test.

    The nuisance parameters of an omitted test (offsets, surface of the sheet) are fitted to it
    with the law held fixed. Those of an omitted part (a frame) are taken from the fit to the rest
    of its test.

    Parameters
    ----------
    project : Project
    tests : str or sequence of str, optional
        Names of tests, or a kind of test; by default all that can be fitted.
    forms : sequence of str
        Forms of the moduli to fit, named as in `compare`; by default the project's.
    cards : sequence of str, or mapping of str to MaterialCard
        Cards to judge at every test as they are; nothing is fitted then. Cards by name, or names
        of the project's cards and files of others.
    leave : str
        What to leave out in turn: whole "tests", or parts of them: "frames" of a bubble,
        "specimens" or "directions" of strips, "ratios" of a biaxial test.
    starts : int
        Number of random starts of each fit.
    out : path, optional
        Folder of the study, with a folder for each fit.
    trust, resume, overwrite, progress, command_line
        As in `fit`.

    Returns
    -------
    Validation

    Raises
    ------
    InputError, OutputError, SolverFailure
        As in `fit`; InputError also if there are fewer than two tests or parts.
    """
    if cards:
        _check_alone(project, forms, leave)
        check_unused(out, False, overwrite)
        return finished(judge_cards(project, chosen_cards(project, cards), tests), out)
    output = OutputSettings.of(out, resume, overwrite, command_line)
    project = project.with_fit(starts=starts, trust=[*project.fit.trust, *trust])
    chosen = tests_with_weight(project, project.chosen(tests, fitted=True))
    if leave == TESTS and len(chosen) < 2:
        raise InputError(project.path, "", "one test is left out of two or more: there is only one")
    projects = candidates(project, forms) if forms else {project.law.form: project}
    # All before the first fit, so that an error in the input shows at once.
    omissions = {form: _omissions(p, chosen, leave) for form, p in projects.items()}
    folder = _begin(output, list(projects), leave, len(chosen))
    names = [test.name for test in chosen]
    judged = []
    analyses = 0
    for form, form_project in projects.items():
        fits = FormFits(form, form_project, names, output, listener(progress))
        fit_to_all = fits.fit(names, f"{form}: all tests", "all")
        analyses += fit_to_all.best.analyses
        judged += fits.judge(fit_to_all, omissions[form], leave, starts, folder)
    return finished(Validation(project, tuple(judged), leave, analyses), out)


def _check_alone(project: Project, forms: Sequence[str], leave: str) -> None:
    """Refuse forms or parts to leave out beside cards, with which nothing is fitted."""
    if forms or leave != TESTS:
        problem = "goes with neither --form nor --leave: nothing is fitted"
        raise InputError(project.path, "--card", problem)


def _begin(output: OutputSettings, forms: Sequence[str], leave: str, count: int) -> Path | None:
    """Prepare the folder of the study, with one for each fit without one of `count` tests."""
    fits = ["all", *(f"without-{number}" for number in range(1, count + 1))]
    return begin_study(
        output,
        {"forms": ", ".join(forms), "left out": leave},
        [f"{folder_name(form)}-{fit}" for form in forms for fit in fits],
        [_file_of_parts(form, leave) for form in forms],
    )


class Omissions(NamedTuple):
    """The parts to leave out in turn from the fit of one form of law, and the setup of that fit."""

    setup: FitSetup
    parts: Sequence[OmittedPart]


def _omissions(project: Project, tests: Sequence[Test], sort: str) -> Omissions | None:
    """Return all parts of one sort in the tests, None for whole tests.

    Raise InputError if there is no such part, or if no law can be fitted without one of them.
    """
    if sort == TESTS:
        return None
    setup = prepare_fit(project, tests)
    parts = omittable_parts(setup, sort)
    for part in parts:
        law_of_masked_data(setup, part.masks)
    return Omissions(setup, parts)


def _file_of_parts(form: str, sort: str) -> str:
    """Return the name of the file that keeps the errors of a form at parts of one sort."""
    return f"{folder_name(form)}-without-{sort}.json"


@dataclass(frozen=True, eq=False)
class FormFits:
    """Make the fits of one form of law: to all tests, and to all but one test or part.

    Attributes
    ----------
    form : str
        Name of the form.
    project : Project
        The project with that form of law.
    names : sequence of str
        Names of the tests.
    output : OutputSettings
        Folder of the study, and whether it is resumed.
    on_event : callable
        Receives the progress.
    """

    form: str
    project: Project
    names: Sequence[str]
    output: OutputSettings
    on_event: Callable[..., None]

    def judge(
        self,
        fit_to_all: Fit,
        omissions: Omissions | None,
        sort: str,
        starts: int,
        folder: Path | None,
    ) -> list[Judged]:
        """Fit without each test or part in turn; return the errors at what is left out."""
        if omissions is None:
            return self.judge_tests(fit_to_all)
        self.on_event(f"{self.form}: without each of {len(omissions.parts)} {sort}")
        file = _file_of_parts(self.form, sort)
        predicted = errors_left_out(*omissions, starts, folder, file, self.on_event)
        return self.judge_parts(fit_to_all, omissions.parts, predicted)

    def judge_tests(self, fit_to_all: Fit) -> list[Judged]:
        """Leave out each test in turn, and return the errors of the fits at the omitted test."""
        judged = []
        for number, prepared in enumerate(fit_to_all.setup.tests, start=1):
            omitted = prepared.test.name
            remaining = [name for name in self.names if name != omitted]
            fit = self.fit(remaining, f"{self.form}: without {omitted}", f"without-{number}")
            parameters = nuisance_of(fit.problem, fit.best.point.unknowns)
            predicted = held_out(
                prepared,
                fit.reached_law,
                fit.setup.make_solver,
                parameters=parameters,
                thickness=fit.thickness,
            )
            fitted = held_out(
                prepared,
                fit_to_all.reached_law,
                fit_to_all.setup.make_solver,
                thickness=fit_to_all.thickness,
            )
            predicted = replace(predicted, analyses=fit.best.analyses + predicted.analyses)
            judged.append(Judged(self.form, predicted, fitted))
        return judged

    def judge_parts(
        self, fit_to_all: Fit, parts: Sequence[OmittedPart], predicted: Sequence[HeldOut]
    ) -> list[Judged]:
        """Return the errors at each part of the fit without it, and of the fit to all data."""
        setup = fit_to_all.setup
        law = fit_to_all.reached_law
        nuisance = nuisance_of(fit_to_all.problem, fit_to_all.best.point.unknowns)
        judged = []
        for part, at_part in zip(parts, predicted, strict=True):
            prepared = setup.tests[part.test]
            fitted = held_out(
                prepared,
                law,
                setup.make_solver,
                part.alone,
                nuisance,
                part.name,
                thickness=fit_to_all.thickness,
            )
            judged.append(Judged(self.form, at_part, fitted))
        return judged

    def fit(self, tests: Sequence[str], title: str, folder: str) -> Fit:
        """Fit the named tests, and write the fit below the folder of the study, if any."""
        folder = f"{folder_name(self.form)}-{folder}"
        return fit_in_series(self.project, tests, title, folder, self.output, self.on_event)


def judge_cards(
    project: Project,
    cards: Mapping[str, MaterialCard],
    tests: str | Sequence[str] | None = None,
) -> Validation:
    """Judge material cards at tests as they are, without any fit of their laws.

    Tests that are only predicted, such as cylinders, are judged by their measured loads.

    Parameters
    ----------
    project : Project
    cards : mapping of str to MaterialCard
        By name.
    tests : str or sequence of str, optional
        Names of tests, or a kind of test.

    Raises
    ------
    InputError
        A card has another thickness, or no value of a deck's parameter, or there is no test.
    """
    for name, card in cards.items():
        difference = thickness_difference(card, project.fabric.thickness)
        if difference is not None:
            raise InputError(project.path, "fabric.thickness", f"{name}: {difference}")
    chosen = project.chosen(tests)
    predicted = [test.name for test in chosen if is_measured(test)]
    judged = []
    if not predicted or any(kind_named(test.kind).fitted for test in chosen):
        setup = prepare_fit(project, project.chosen(tests, fitted=True))
        _check_parameters(setup, cards)
        judged = [
            Judged(
                name,
                held_out(prepared, card.law, setup.make_solver, parameters={name: card.parameters}),
            )
            for name, card in cards.items()
            for prepared in setup.tests
        ]
    if predicted:
        judged += _judge_predictions(predict(project, predicted, cards, samples=0))
    return Validation(project, tuple(judged), leave="")


def _check_parameters(setup: FitSetup, cards: Mapping[str, MaterialCard]) -> None:
    """Raise InputError if a card lacks a value of a parameter that a deck of the tests has."""
    parameters = {
        nuisance.name
        for prepared in setup.tests
        if isinstance(prepared.test, ProgramTest)
        for comparison in prepared.comparisons(setup.make_solver, Weighting())
        for nuisance in comparison.nuisance
        if nuisance.drawn
    }
    for name, card in cards.items():
        missing = sorted(parameters - card.parameters.keys())
        if missing:
            problem = (
                f"{name} has no value of {', '.join(missing)}: give the parameters.toml of a fit, "
                "or put it beside the card"
            )
            raise InputError(setup.project.path, "--card", problem)


def _judge_predictions(predictions: Predictions) -> list[Judged]:
    """Return the errors of predictions at measured loads, in % of the largest measured value."""
    judged = []
    for number, run in enumerate(predictions.predicted_runs):
        if not run.predicted:
            continue
        name = run.test.name
        units = {name: "% of the largest measured"}
        error = predictions.error(number)
        at_test = not_judged(name, predictions.ended(number), units)
        if error is not None:
            at_test = HeldOut(name, error, {name: 100 * error}, units, tuple(run.notes))
        judged.append(Judged(run.card, at_test))
    return judged
