"""Comparison of forms of the moduli, each fitted to the tests and cross-validated."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..arguments import Positive, TwoOrMore, checked_arguments
from ..errors import InputError, NoFeasibleStart, check_one_of
from ..experiments.base import Masks
from ..inference.problem import FitProblem, Optimum
from ..inference.resampling import folds_of
from ..inference.search import feasible_start, fit_from
from ..lazy_modules import pandas as pd
from ..materials.forms.base import Array, form_names, form_settings, of_load_ratio
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, Verdict
from ..project.project import Project
from ..solvers.base import carries_load_ratios
from .fit import fit_in_series
from .folder import OutputSettings, Presented, finished, shown
from .held_out import errors
from .in_use import alone_in_folder
from .law_setup import law_of
from .process_pool import Task
from .progress import Listener, listener
from .result import Fit
from .setup import FitSetup, coarse_problem, fingerprints, make_solver, prepare_fit
from .simulation import StudyRecord, begin_study, check_has_law
from .starts import noise_of

FOLD = NoteKind("fold without an error")
VALIDATION = "validation.json"
#: Relative excess over the least cross-validated error up to which a simpler form is as good.
AS_GOOD = 0.05
#: Settings of forms that follow from others: six knots, breaks from the tests' data.
USUAL_SETTINGS = ("knots", "breaks")
#: Number of random starts of the fit of each form.
STARTS = 5
NOT_JUDGED = "no fit without its points ended well, or no analysis at them: the form is not judged"


def candidates(project: Project, names: Sequence[str] = ()) -> dict[str, Project]:
    """Return one project for each form of the moduli to compare.

    Parameters
    ----------
    project : Project
    names : sequence of str
        Names of forms; "spline:8" is a spline of eight knots for each modulus. By default all that
        the project's solver carries and that need no setting which the project lacks.

    Returns
    -------
    dict of str to Project
        By name of the form, with its number of knots where it has any.

    Raises
    ------
    InputError
        There is no such form, or the bounds do not go with every form.
    """
    bounds = project.law.bounds
    if bounds is not None and (bounds.lower is not None or bounds.upper is not None):
        problem = "comparing forms needs bounds on the moduli themselves: E1, E2, G12"
        raise InputError(project.path, "law.bounds", problem)
    if not names:
        carries_ratios = carries_load_ratios(make_solver(project))
        known_settings = {*USUAL_SETTINGS, *(project.law.model_extra or {})}
        names = [
            name
            for name in form_names()
            if name != "none"
            and (carries_ratios or not of_load_ratio(name))
            and known_settings.issuperset(form_settings(name))
        ]
    projects: dict[str, Project] = {}
    for name in names:
        form, settings = _form_and_settings(project, name)
        if settings and ":" not in name:
            name = f"{form}:{settings['knots']}"
        projects[name] = project.with_law(form, settings)
    return projects


def _form_and_settings(project: Project, name: str) -> tuple[str, dict[str, int]]:
    """Return a form and its number of knots, six where neither the name nor the project has any."""
    form, _, knots = name.partition(":")
    check_one_of(form, form_names(), "--form")
    has_knots = "knots" in form_settings(form)
    if knots:
        if not knots.isdecimal() or not has_knots:
            problem = f"expected a form, or one with its number of knots (spline:8), got {name!r}"
            raise InputError(None, "--form", problem)
        return form, {"knots": int(knots)}
    if has_knots and "knots" not in (project.law.model_extra or {}):
        return form, {"knots": 6}
    return form, {}


def folder_name(form: str) -> str:
    """Return a form's name as that of a folder."""
    return form.replace(":", "-")


@dataclass(frozen=True)
class FoldError:
    """Hold the errors at the points that a fold leaves out.

    Attributes
    ----------
    fold : int
    value : float or None
        Contribution of these points to the objective; None if no fit without them, or no analysis
        at them, ended well.
    rms : mapping of str to float
        Root mean square by comparison, in its unit; empty without a value.
    analyses : int
        Number of analyses of the tests that the fit without these points took.
    """

    fold: int
    value: float | None
    rms: Mapping[str, float]
    analyses: int = 0


def specimens_of(setup: FitSetup) -> dict[str, list[int]]:
    """Return the specimen's number of each point that can be left out, by comparison."""
    return {
        name: list(numbers)
        for prepared in setup.tests
        for name, numbers in prepared.specimens.items()
    }


def folds(setup: FitSetup, count: int) -> list[Masks]:
    """Return the points that each fold keeps, of `count` folds or as many as specimens allow."""
    specimens = specimens_of(setup)
    specimen_counts = [len(set(numbers)) for numbers in specimens.values()]
    # A comparison of one specimen loses single points: it does not limit the folds.
    fold_count = min([count, *(number for number in specimen_counts if number > 1)])
    return folds_of(specimens, fold_count, setup.project.fit.seed)


def law_of_masked_data(setup: FitSetup, masks: Masks) -> HypoelasticLaw:
    """Return the form of the law of a fit to the points that masks keep; InputError if none."""
    return law_of(setup.project, [prepared.reach(masks) for prepared in setup.tests])


class MaskedFit(NamedTuple):
    """A law fitted to some of the points: its setup, the unknowns (None if all starts failed)."""

    setup: FitSetup
    unknowns: Array | None
    analyses: int


def fit_of(setup: FitSetup, masks: Masks, starts: int, optimum: Array | None = None) -> MaskedFit:
    """Fit a law to the points that the masks keep, see `best_of`.

    Parameters
    ----------
    optimum : (unknowns,) array
        Unknowns of the fit to all points, where the first start begins.
    """
    masked = replace(setup, law=law_of_masked_data(setup, masks))
    return MaskedFit(masked, *best_of(masked, masked.problem(masks), starts, optimum))


def fold_error(
    setup: FitSetup,
    masks: Masks,
    fold: int,
    starts: int,
    optimum: Array | None = None,
) -> FoldError:
    """Fit a law to the points that a fold keeps, and judge it at those that it leaves out.

    Parameters
    ----------
    setup : FitSetup
    masks : Masks
        Which values of each test the fold keeps.
    fold : int
        Number of the fold, from 0.
    starts : int
        Number of starts of the fit.
    optimum : (unknowns,) array, optional
        Unknowns of the fit to all points, where the first start begins.

    Returns
    -------
    FoldError
        Without a value if all starts fail or the judged points cannot be evaluated.
    """
    masked, unknowns, analyses = fit_of(setup, masks, starts, optimum)
    if unknowns is None:
        return FoldError(fold, None, {}, analyses)
    left_out = masked.problem({name: ~mask for name, mask in masks.items()})
    # Comparisons without masks are matched by every fold, and judge none.
    judged = left_out.part([k for k, c in enumerate(left_out.comparisons) if c.name in masks])
    point = judged.evaluate(unknowns, False, warm=False)
    if point is None:
        return FoldError(fold, None, {}, analyses)
    value = judged.value_of_data(point.residual)
    return FoldError(fold, value, errors(judged, point.residual), analyses)


def _fold_task(
    setup: FitSetup,
    masks: Sequence[Masks],
    starts: int,
    optimum: Array | None,
) -> Task:
    """Return the task of a process: the error of a fold by its number.

    Parameters
    ----------
    optimum : (unknowns,) array
        Unknowns of the fit to all points, where the first start begins.
    """
    return lambda fold, report: fold_error(setup, masks[fold], fold, starts, optimum)


def best_of(
    setup: FitSetup,
    problem: FitProblem,
    starts: int,
    optimum: Array | None = None,
) -> tuple[Array | None, int]:
    """Fit a problem from several starts.

    Parameters
    ----------
    setup : FitSetup
    problem : FitProblem
    starts : int
        Number of starts.
    optimum : (unknowns,) array, optional
        Unknowns of the fit to all points, where the first start begins: at its moduli at the
        control strains. The others begin at random.

    Returns
    -------
    unknowns : (unknowns,) array or None
        Those of the best fit; None if all starts failed.
    analyses : int
        Number of analyses of the tests that all starts took.
    """
    best: Array | None = None
    least_value = np.inf
    analyses = 0
    for number in range(starts):
        problem.reset()
        end = _fit_of_start(setup, problem, number, optimum if number == 0 else None)
        analyses += problem.analyses
        if end is not None and end.value < least_value:
            best = end.best.unknowns
            least_value = end.value
    return best, analyses


def _fit_of_start(
    setup: FitSetup,
    problem: FitProblem,
    number: int,
    optimum: Array | None,
) -> Optimum | None:
    """Return the fit from an optimum, or from a random start if it has none or it fails."""
    if optimum is not None and optimum.size == problem.unknowns.count:
        end = fit_from(problem, optimum, setup.options, without_lead_in=True)
        if end is not None:
            return end
    try:
        start = feasible_start(problem, setup.project.fit.seed, number)
    except NoFeasibleStart:
        return None
    return fit_from(problem, start, setup.options)


def errors_of_folds(
    setup: FitSetup,
    count: int,
    starts: int,
    folder: Path | None,
    on_event: Callable[[FoldError | None], None],
    optimum: Array | None,
) -> tuple[FoldError, ...]:
    """Fit without the points of each fold, and return the errors of the fit at these points.

    Strain range and breaks of the law, and scales of relative errors, follow from the points
    matched: the points left out enter by how far the models are strained, and by where the first
    start begins.

    Parameters
    ----------
    setup : FitSetup
    count : int
        Number of folds, at most.
    starts : int
        Number of starts of each fold, of which the best fit counts.
    folder : Path or None
        Folder that keeps the errors of folds; those that it has are not computed again.
    on_event : callable
        Receives each error, and None now and then.
    optimum : (unknowns,) array or None
        Unknowns of the fit to all points, see `best_of`.
    """
    masks = folds(setup, count)
    depends = {**fingerprints(setup, setup.problem()), "folds": count, "starts": starts}
    depends["begins"] = "random" if optimum is None else "fit"
    record = StudyRecord(folder, VALIDATION, "folds", FoldError, depends)
    prepare = functools.partial(_fold_task, setup, masks, starts, optimum)
    for event in record.run(setup.project, prepare, range(len(masks))):
        on_event(event)
    return tuple(record.rows[fold] for fold in sorted(record.rows))


@dataclass(frozen=True, eq=False)
class FormFit:
    """Hold the fit of one form of the moduli, and its errors in the folds of cross-validation.

    Attributes
    ----------
    name : str
        Of the form.
    fit : Fit
        To all points.
    folds : tuple of FoldError
    compared : tuple of str
        Names of the comparisons from which folds leave out points.
    """

    name: str
    fit: Fit
    folds: tuple[FoldError, ...]
    compared: tuple[str, ...]

    @property
    def coefficients(self) -> int:
        """Return the number of coefficients that are fitted."""
        return self.fit.problem.unknowns.size

    @property
    def analyses(self) -> int:
        """Return the number of analyses of the tests in all starts and folds."""
        return self.fit.best.analyses + sum(fold.analyses for fold in self.folds)

    @property
    def rms(self) -> dict[str, float]:
        """Return the error of the fit to all points, by comparison, in its unit."""
        rms = errors(self.fit.problem, self.fit.best.point.residual)
        return {name: rms[name] for name in rms if name in self.compared}

    @property
    def fitted(self) -> float:
        """Return what the `compared` ones contribute to the objective of the fit to all points."""
        norms = self.fit.problem.norms(self.fit.best.point.residual)
        compared = [blocks for name, blocks in norms.items() if name in self.compared]
        return float(np.concatenate(compared).sum())

    def left_out(self, comparison: str | None = None) -> list[float]:
        """Return the error of each fold, or its RMS in one comparison; NaN if it failed."""
        if comparison is not None:
            return [fold.rms.get(comparison, math.nan) for fold in self.folds]
        return [math.nan if fold.value is None else fold.value for fold in self.folds]

    @property
    def validated(self) -> float:
        """Return the mean of the folds' errors, NaN where any of them failed."""
        return float(np.mean(self.left_out()))

    @property
    def validated_rms(self) -> dict[str, float]:
        """Return the mean of the folds' RMS by comparison, in its unit; NaN where any failed."""
        return {name: float(np.mean(self.left_out(name))) for name in self.compared}

    @property
    def noise(self) -> dict[str, float]:
        """Return the share of the data's noise in the objective, by comparison."""
        noise = noise_of(self.fit.problem)
        return {name: noise[name] for name in self.compared}

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the form and its errors as plain values."""
        return {
            "form": self.name,
            **self.fit.law.form.to_card(),
            "coefficients": self.coefficients,
            "objective": self.fit.objective,
            "fitted": self.fitted,
            "rms": self.rms,
            "cross_validated": self.validated,
            "cross_validated_by_part": self.validated_rms,
            "folds": self.left_out(),
            "analyses": self.analyses,
            "starts_objective": [record.objective for record in self.fit.best.ranked],
        }


@dataclass(frozen=True, eq=False)
class LawComparison(Presented):
    """Hold the comparison of several forms of the moduli.

    Attributes
    ----------
    forms : tuple of FormFit
    fold_starts : int
        Starts of the fit of each fold.
    """

    forms: tuple[FormFit, ...]
    fold_starts: int

    @property
    def project(self) -> Project:
        """Return the project, with the first form."""
        return self.forms[0].fit.project

    @property
    def notes(self) -> list[Note]:
        """Return the notes of the fits, and those on folds without an error, by form."""
        notes = []
        for form in self.forms:
            failed = [fold.fold + 1 for fold in form.folds if fold.value is None]
            remarks = [Note(FOLD, NOT_JUDGED, f"fold {fold}") for fold in failed]
            notes += [note.about(form.name) for note in (*form.fit.notes, *remarks)]
        return notes

    @property
    def best(self) -> FormFit | None:
        """Return the form with the least cross-validated error; None if none was judged."""
        judged = [form for form in self.forms if math.isfinite(form.validated)]
        return min(judged, key=lambda form: form.validated, default=None)

    @property
    def simplest(self) -> FormFit | None:
        """Return the form of the fewest coefficients that is as good as the best."""
        if self.best is None:
            return None
        limit = (1 + AS_GOOD) * self.best.validated
        as_good = [form for form in self.forms if form.validated <= limit]
        return min(as_good, key=lambda form: form.coefficients)

    @property
    def verdict(self) -> Verdict:
        """Return the form to take, with what speaks against its fit."""
        form = self.simplest
        if form is None:
            step = "see in the notes why the fits of the folds failed"
            return Verdict("not to be used", "no form was judged", next_step=step)
        objections = form.fit.verdict.reasons
        return Verdict(
            form.fit.verdict.state if objections else "usable",
            f"{form.name} is the simplest form that predicts what was left out as well as the best",
            objections,
            next_step=f"write {_keys_of_form(form.name)} into [law] and fit again",
        )

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the study, with the simplest form that is as good as the best."""
        first = self.forms[0]
        comparisons = first.fit.problem.comparisons
        units = {c.name: c.objective.unit for c in comparisons if c.name in first.compared}
        return {
            "command": "compare",
            "title": self.project.title,
            "tests": first.fit.setup.test_names,
            "objective_is": first.fit.setup.objective_is,
            "units": units,
            "fold_starts": self.fold_starts,
            "forms": [form.numbers for form in self.forms],
            "analyses": sum(form.analyses for form in self.forms),
            "noise": sum(first.noise.values()),
            "noise_by_part": first.noise,
            "least_cross_validated": None if self.best is None else self.best.name,
            "simplest_as_good": None if self.simplest is None else self.simplest.name,
            "as_good_within": AS_GOOD,
        }

    def table(self) -> pd.DataFrame:
        """Return the errors of the forms.

        Returns
        -------
        DataFrame
            One row per form: `moduli` (its name), `coefficients`, and of the objective `fitted` and
            `cross_validated`; by comparison, in its unit, "rms NAME, UNIT" of the fit and
            "left out NAME, UNIT" at the points left out.
        """
        table = []
        for form in self.forms:
            units = {c.name: c.objective.unit for c in form.fit.problem.comparisons}
            row = {
                "moduli": form.name,
                "coefficients": form.coefficients,
                "fitted": form.fitted,
                "cross_validated": form.validated,
            }
            for name, rms in form.rms.items():
                row[f"rms {name}, {units[name]}"] = rms
            for name, rms in form.validated_rms.items():
                row[f"left out {name}, {units[name]}"] = rms
            table.append(row)
        return pd.DataFrame(table)

    def result_lines(self) -> list[str]:
        """Return the results of the study as lines of the terminal."""
        result = self.result
        table = self.table().rename(columns={"cross_validated": "cross-validated"})
        table.index = pd.Index([form.name for form in self.forms])
        columns = ["coefficients", "fitted", "cross-validated"]
        lines = [
            f"error: {result['objective_is']}",
            *shown(table[columns], "a fold failed"),
            f"the data's own noise: {result['noise']:.4g}",
            f"{result['analyses']} analyses of the tests",
        ]
        if result["simplest_as_good"] is not None:
            lines.append(
                f"least at specimens left out: {result['least_cross_validated']}; simplest within "
                f"{100 * AS_GOOD:.0f} % of it: {result['simplest_as_good']}"
            )
        return lines


@checked_arguments
@alone_in_folder
def compare(
    project: Project,
    tests: str | Sequence[str] | None = None,
    forms: Sequence[str] = (),
    *,
    folds: TwoOrMore = 5,
    starts: Positive = STARTS,
    fold_starts: Positive = 1,
    trust: Sequence[str] = (),
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Listener = None,
    command_line: Sequence[str] | None = None,
) -> LawComparison:
    """Compare forms of the moduli: fit each to the tests, and cross-validate it over specimens.

    Each fold leaves out some specimens and is judged at these. Tests whose specimens are not known
    stay whole in every fold.

    Parameters
    ----------
    project : Project
    tests : str or sequence of str, optional
        Names of tests, or a kind of test; by default all that can be fitted.
    forms : sequence of str
        Names of forms, "spline:8" for a spline of eight knots; by default all that the project's
        solver carries.
    folds : int
        Largest number of folds.
    starts : int
        Number of random starts of the fit of each form, coarse to fine unless [fit] says otherwise.
    fold_starts : int
        Starts of the fit of each fold: the first at the fit to all points, the others random.
    out : path, optional
        Folder of the study, with a folder for each form, written as the fits end.
    trust, resume, overwrite, progress, command_line
        As in `fit`.

    Returns
    -------
    LawComparison

    Raises
    ------
    InputError, OutputError, SolverFailure
        As in `fit`; InputError also if no test has several specimens.
    """
    check_has_law(project)
    output = OutputSettings.of(out, resume, overwrite, command_line)
    on_event = listener(progress)
    project = project.with_fit(trust=[*project.fit.trust, *trust])
    # All of them first: a mistake in the project shows before the first fit.
    projects = candidates(project.with_fit(starts=starts), forms)
    chosen = project.chosen(tests, fitted=True)
    setups = {form: prepare_fit(form_project, chosen) for form, form_project in projects.items()}
    projects = {form: _coarse_to_fine(setup) for form, setup in setups.items()}
    compared = _compared(project, next(iter(setups.values())))
    settings = {"folds": str(folds), "fold starts": str(fold_starts)}
    folder = begin_study(output, settings, map(folder_name, projects))
    names = [test.name for test in chosen]
    fits = []
    for form, form_project in projects.items():
        title = f"{form} moduli"
        best_fit = fit_in_series(form_project, names, title, folder_name(form), output, on_event)
        form_folder = None if folder is None else folder / folder_name(form)
        optimum = best_fit.best.point.unknowns
        fold_errors = errors_of_folds(
            setups[form], folds, fold_starts, form_folder, on_event, optimum
        )
        fits.append(FormFit(form, best_fit, fold_errors, compared))
    return finished(LawComparison(tuple(fits), fold_starts), out)


def _keys_of_form(name: str) -> str:
    """Return the keys of [law] for a form by its name in a comparison, such as spline:6."""
    form, _, knots = name.partition(":")
    return f'form = "{form}"' + (f" and knots = {knots}" if knots else "")


def _coarse_to_fine(setup: FitSetup) -> Project:
    """Return the project of a fit, with starts coarse to fine if it does not say how and they can.

    A comparison takes the best optimum of each form; how many starts agree on it is secondary.
    """
    settings = setup.project.fit
    is_open = settings.coarse_to_fine is None and settings.starts > 1
    if not is_open or coarse_problem(setup) is None:
        return setup.project
    return setup.project.with_fit(coarse_to_fine=True)


def _compared(project: Project, setup: FitSetup) -> tuple[str, ...]:
    """Return the names of the comparisons that can lose points; InputError without any."""
    compared = tuple(specimens_of(setup))
    if not compared:
        problem = (
            "no test has specimens that a fit could do without: strips need measured points and "
            'match = "points"'
        )
        raise InputError(project.path, "", problem)
    return compared
