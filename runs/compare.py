"""Fit several forms of the moduli and cross-validate them."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import Positive, TwoOrMore, checked_arguments
from ..errors import InputError, NoFeasibleStart, check_one_of
from ..experiments.base import Masks
from ..inference.feasible_start import feasible_start
from ..inference.folds import folds_of
from ..inference.problem import FitProblem
from ..inference.search import fit_from
from ..lazy_modules import pandas as pd
from ..materials.forms.base import form_names, form_settings, of_load_ratio
from ..notes import Note, NoteKind, note_lines, note_records
from ..project.project import Project
from ..solvers.base import carries_load_ratios
from ..storage.plain_values import plain_values
from .best import noise_of
from .fit import fit_in_series
from .folder import OutputSettings, Presented, finished, shown
from .held_out import errors
from .in_use import alone_in_folder
from .law_setup import law_of
from .process_pool import Task
from .progress import Listener, listener
from .result import Fit
from .setup import FitSetup, fingerprints, make_solver, prepare_fit
from .simulation import StudyRecord, begin_study

FOLD = NoteKind("fold without an error")
#: Knots of a spline where neither the project nor the caller gives a number.
KNOTS = 6
VALIDATION = "validation.json"
#: Share of the least cross-validated error within which a simpler form is as good.
AS_GOOD = 0.05
#: Starts of the fit of a form, and of the fit of a fold.
STARTS, FOLD_STARTS = 5, 2
FOLDS = 5
LOST = "no fit without its points ended well, or no analysis at them: the form is not judged"


def candidates(project: Project, names: Sequence[str] = ()) -> dict[str, Project]:
    """Return the project with each of the forms, by name; all that its solver carries unless given.
    names : of forms; "spline:8" is a spline of eight knots for each modulus. Raises InputError: no
    such form, or bounds that do not go with every form."""
    bounds = project.law.bounds
    if bounds is not None and (bounds.lower is not None or bounds.upper is not None):
        problem = "comparing forms needs bounds on the moduli themselves: E1, E2, G12"
        raise InputError(project.path, "law.bounds", problem)
    own = project.law.model_extra or {}
    able = carries_load_ratios(make_solver(project))
    carried = [name for name in form_names() if able or not of_load_ratio(name)]
    chosen: dict[str, Project] = {}
    for asked in names or carried:
        form, _, knots = asked.partition(":")
        settings: dict[str, Any] = {}
        check_one_of(form, form_names(), "--form")
        if knots and (not knots.isdecimal() or "knots" not in form_settings(form)):
            problem = f"expected a form, or one with its number of knots (spline:8), got {asked!r}"
            raise InputError(None, "--form", problem)
        if knots:
            settings = {"knots": int(knots)}
        elif "knots" in form_settings(form) and "knots" not in own:
            asked = f"{form}:{KNOTS}"
            settings = {"knots": KNOTS}
        chosen[asked] = project.with_law(form, settings)
    return chosen


def plain(name: str) -> str:
    """Return a form's name as that of a folder."""
    return name.replace(":", "-")


@dataclass(frozen=True)
class FoldError:
    """Errors at the points that a fold leaves out.
    value : their part of the objective; rms : root mean square by comparison, in its unit. None and
    empty where no fit without them, or no analysis, ended well."""

    fold: int
    value: float | None
    rms: Mapping[str, float]


def specimens_of(setup: FitSetup) -> dict[str, list[int]]:
    """Return the specimen's number of each point that can be left out, by comparison."""
    return {name: list(own) for test in setup.tests for name, own in test.specimens.items()}


def folds(setup: FitSetup, count: int) -> list[Masks]:
    """Return the points that the folds keep: at most `count` folds, one a specimen at most."""
    specimens = specimens_of(setup)
    several = [len(set(own)) for own in specimens.values() if len(set(own)) > 1]
    return folds_of(specimens, min([count, *several]), setup.project.fit.seed)


def fit_of(setup: FitSetup, masks: Masks, starts: int) -> tuple[FitSetup, np.ndarray | None]:
    """Fit a law to the points that the masks keep; unknowns are None where all starts fail."""
    law = law_of(setup.project, [test.reach(masks) for test in setup.tests])
    own = replace(setup, law=law)
    return own, best_of(own, own.problem(masks), starts)


def _task(setup: FitSetup, parts: list[Masks], starts: int) -> Task:
    def error(fold: int, tell: Callable[[Any], None]) -> FoldError:
        masks = parts[fold]
        own, unknowns = fit_of(setup, masks, starts)
        if unknowns is None:
            return FoldError(fold, None, {})
        whole = own.problem({name: ~mask for name, mask in masks.items()})
        judged = whole.part([k for k, c in enumerate(whole.comparisons) if c.name in masks])
        point = judged.evaluate(unknowns, False, warm=False)
        if point is None:
            return FoldError(fold, None, {})
        value = float(judged.blocks.norms(point.residual).sum())
        return FoldError(fold, value, errors(judged, point.residual))

    return error


def best_of(setup: FitSetup, problem: FitProblem, starts: int) -> np.ndarray | None:
    """Return the unknowns of the best of some starts; None where all failed."""
    best = None
    least = np.inf
    for number in range(starts):
        problem.reset()
        try:
            start = feasible_start(problem, setup.project.fit.seed, number)
        except NoFeasibleStart:
            continue
        optimum = fit_from(problem, start, setup.options)
        if optimum is not None and optimum.value < least:
            best = optimum.best.unknowns
            least = optimum.value
    return best


def errors_of_folds(
    setup: FitSetup,
    count: int,
    starts: int,
    folder: Path | None = None,
    tell: Callable[[FoldError | None], None] = lambda event: None,
) -> tuple[FoldError, ...]:
    """Fit without the points of each fold and judge at these points; those of the folder are kept.
    Strain range and breaks of the law, and scales of relative errors, follow from the points
    matched, and the fits begin at random starts of their own: the points left out enter only by how
    far the models are strained. count : of folds, at most. starts : random starts a fold, the best
    of which counts."""
    parts = folds(setup, count)
    depends = {**fingerprints(setup, setup.problem()), "folds": count, "starts": starts}
    record = StudyRecord(folder, VALIDATION, "folds", FoldError, "fold", depends)
    prepare = functools.partial(_task, setup, parts, starts)
    for event in record.run(setup.project, prepare, range(len(parts))):
        tell(event)
    return tuple(record.rows[fold] for fold in sorted(record.rows))


@dataclass(frozen=True, eq=False)
class FormFit:
    """The best fit of a form of the moduli, and its errors in folds of some comparisons."""

    name: str
    fit: Fit
    folds: tuple[FoldError, ...]
    compared: tuple[str, ...]

    @property
    def coefficients(self) -> int:
        return self.fit.problem.unknowns.size

    @property
    def rms(self) -> dict[str, float]:
        """Return the error of the fit to all points, by comparison, in its unit."""
        every = errors(self.fit.problem, self.fit.best.point.residual)
        return {name: rms for name, rms in every.items() if name in self.compared}

    @property
    def fitted(self) -> float:
        """Return the share of those comparisons in the objective of the fit to all points."""
        norms = self.fit.problem.norms(self.fit.best.point.residual)
        return float(np.concatenate([own for n, own in norms.items() if n in self.compared]).sum())

    def left_out(self, comparison: str | None = None) -> list[float]:
        """Return each fold's part of the objective, or RMS of a comparison; NaN if it failed."""
        if comparison is not None:
            return [fold.rms.get(comparison, math.nan) for fold in self.folds]
        return [math.nan if fold.value is None else fold.value for fold in self.folds]

    @property
    def validated(self) -> float:
        """Return the mean of the folds' errors, NaN where any of them failed."""
        return float(np.mean(self.left_out()))

    @property
    def noise(self) -> dict[str, float]:
        """Return the share of the data's noise in the objective, by comparison."""
        every = noise_of(self.fit.problem)
        return {name: every[name] for name in self.compared}


@dataclass(frozen=True, eq=False)
class LawComparison(Presented):
    """Forms of the moduli side by side."""

    forms: tuple[FormFit, ...]
    fold_starts: int

    @property
    def project(self) -> Project:
        return self.forms[0].fit.project

    @property
    def notes(self) -> list[Note]:
        notes = []
        for form in self.forms:
            lost = [fold.fold + 1 for fold in form.folds if fold.value is None]
            own = [Note(FOLD, LOST, f"fold {fold}") for fold in lost]
            notes += [note.about(form.name) for note in (*form.fit.notes, *own)]
        return notes

    @property
    def result(self) -> dict[str, Any]:
        """Return the content of result.json, with the simplest form that is as good as the best."""
        forms = self.forms
        first = self.forms[0]
        whole = [f for f in forms if math.isfinite(f.validated)]
        best = min(whole, key=lambda f: f.validated, default=None)
        simplest = None
        if best is not None:
            limit = (1 + AS_GOOD) * best.validated
            simplest = min((f for f in whole if f.validated <= limit), key=lambda f: f.coefficients)
        return {
            "command": "compare",
            "title": self.project.title,
            "tests": [test.test.name for test in first.fit.setup.tests],
            "objective_is": first.fit.setup.objective_is,
            "units": {
                c.name: c.objective.unit
                for c in first.fit.problem.comparisons
                if c.name in first.compared
            },
            "fold_starts": self.fold_starts,
            "forms": plain_values(
                [
                    {
                        "form": form.name,
                        **form.fit.law.form.to_card(),
                        "coefficients": form.coefficients,
                        "objective": form.fit.objective,
                        "fitted": form.fitted,
                        "rms": form.rms,
                        "cross_validated": form.validated,
                        "cross_validated_by_part": {
                            name: float(np.mean(form.left_out(name))) for name in form.compared
                        },
                        "folds": form.left_out(),
                        "starts_objective": [r.objective for r in form.fit.best.ranked],
                    }
                    for form in forms
                ]
            ),
            "noise": sum(first.noise.values()),
            "noise_by_part": first.noise,
            "least_cross_validated": best.name if best else None,
            "simplest_as_good": simplest.name if simplest else None,
            "as_good_within": AS_GOOD,
            "notes": note_records(self.notes),
        }

    def table(self) -> pd.DataFrame:
        """Return a row a form: errors of the fit and at points left out, also by comparison."""
        rows = []
        for form in self.forms:
            units = {c.name: c.objective.unit for c in form.fit.problem.comparisons}
            fitted = {f"rms {name}, {units[name]}": e for name, e in form.rms.items()}
            left = {
                f"left out {name}, {units[name]}": float(np.mean(form.left_out(name)))
                for name in form.compared
            }
            rows.append(
                {
                    "moduli": form.name,
                    "coefficients": form.coefficients,
                    "fitted": form.fitted,
                    "cross_validated": form.validated,
                    **fitted,
                    **left,
                }
            )
        return pd.DataFrame(rows)

    def lines(self) -> list[str]:
        result = self.result
        table = self.table().rename(columns={"cross_validated": "cross-validated"})
        table.index = pd.Index([form.name for form in self.forms])
        said = shown(table[["coefficients", "fitted", "cross-validated"]], "a fold failed")
        noise = f"the data's own noise: {result['noise']:.4g}"
        lines = [f"error: {result['objective_is']}", *said, noise]
        if result["simplest_as_good"] is not None:
            lines.append(
                f"least at specimens left out: {result['least_cross_validated']}; simplest within "
                f"{100 * AS_GOOD:.0f} % of it: {result['simplest_as_good']}"
            )
        return [*lines, *note_lines(self.notes)]


@checked_arguments
@alone_in_folder
def compare(
    project: Project,
    tests: str | Sequence[str] | None = None,
    forms: Sequence[str] = (),
    *,
    folds: TwoOrMore = FOLDS,
    starts: Positive = STARTS,
    fold_starts: Positive = FOLD_STARTS,
    trust: Sequence[str] = (),
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Listener = None,
    command_line: Sequence[str] | None = None,
) -> LawComparison:
    """Fit every form to the tests, then without some specimens, and judge it at those.
    Tests without known specimens stay whole in every fold. forms : as for `candidates`. folds : at
    most; fold_starts : random starts of the fit of each. starts : of the fit of each form. out :
    folder of the study, with a folder for each form, written as the fits end. The other arguments
    and the errors are those of `fit`. InputError also : no test with specimens."""
    output = OutputSettings.of(out, resume, overwrite, command_line)
    tell = listener(progress)
    project = project.with_fit(trust=[*project.fit.trust, *trust])
    # All of them first: a mistake in the project shows before the first fit.
    projects = candidates(project.with_fit(starts=starts), forms)
    chosen = project.chosen(tests, fitted=True)
    setups = {name: prepare_fit(own, chosen) for name, own in projects.items()}
    compared = tuple(specimens_of(next(iter(setups.values()))))
    if not compared:
        problem = (
            "no test has specimens that a fit could do without: strips need measured points and "
            'match = "points"'
        )
        raise InputError(project.path, "", problem)
    of = {"folds": str(folds), "fold starts": str(fold_starts)}
    folder = begin_study(output, of, map(plain, projects))
    names = [test.name for test in chosen]
    done = []
    for name, own in projects.items():
        found = fit_in_series(own, names, f"{name} moduli", plain(name), output, tell)
        place = None if folder is None else folder / plain(name)
        errors = errors_of_folds(setups[name], folds, fold_starts, place, tell)
        done.append(FormFit(name, found, errors, compared))
    return finished(LawComparison(tuple(done), fold_starts), out)
