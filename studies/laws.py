"""Which form of the moduli do the tests support? Fits of several forms, cross-validated."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..errors import InputError
from ..experiments.fittable import FittableTest
from ..fits.fit import Event
from ..fits.project import Project
from ..fits.result import Fit
from ..fits.setup import prepare_fit
from ..notes import Note, NoteKind
from .fold_record import validated_folds
from .folds import FoldError, errors, part_of_objective, specimens_of
from .law_candidates import candidates, plain
from .marked import begin_study
from .stored_fit import stored_fit

#: Of the smallest cross-validated error: a simpler form within it is as good.
AS_GOOD = 0.05
#: Starts of the fit of a form, and of the fit of a fold, unless said otherwise.
STARTS, FOLD_STARTS = 5, 2
FOLDS = 5
LOST = "no fit without its points ended well, or no analysis at them: the form is not judged"

#: Told the name of each form as its turn comes, then the records of its starts and folds; None
#: now and then.
Progress = Callable[[str | Event | FoldError | None], None]


@dataclass(frozen=True, eq=False)
class FormFit:
    """One form of the moduli: its best fit, and its errors in the folds.

    name : as it was asked for. compared : the comparisons whose points can be left out.
    """

    name: str
    fit: Fit
    folds: tuple[FoldError, ...]
    compared: tuple[str, ...]

    @property
    def coefficients(self) -> int:
        """How many are fitted."""
        return self.fit.problem.unknowns.size

    @property
    def rms(self) -> dict[str, float]:
        """Error of the fit to all points, by comparison, in its unit."""
        return errors(self._judged, self._residual)

    @property
    def fitted(self) -> float:
        """What those comparisons leave of the objective in the fit to all points."""
        return part_of_objective(self._judged, self._residual)

    def left_out(self, comparison: str | None = None) -> list[float]:
        """Error of each fold at the points left out, NaN where it failed.

        Their part of the objective, or the root mean square of one comparison in its unit.
        """
        if comparison is not None:
            return [fold.rms.get(comparison, math.nan) for fold in self.folds]
        return [math.nan if fold.value is None else fold.value for fold in self.folds]

    @property
    def validated(self) -> float:
        """Mean of the folds' errors, NaN where any of them failed."""
        return float(np.mean(self.left_out()))

    @property
    def _numbers(self) -> list[int]:
        whole = self.fit.problem.comparisons
        return [k for k, c in enumerate(whole) if c.name in self.compared]

    @property
    def _judged(self) -> Any:
        return self.fit.problem.part(self._numbers)

    @property
    def _residual(self) -> np.ndarray:
        rows = [self.fit.problem.rows(k) for k in self._numbers]
        return np.concatenate([self.fit.best.point.residual[part] for part in rows])


@dataclass(frozen=True, eq=False)
class LawComparison:
    """Forms of the moduli side by side, in the order in which they were asked for."""

    forms: tuple[FormFit, ...]
    fold_starts: int

    @property
    def project(self) -> Project:
        """The project, with the first of the forms."""
        return self.forms[0].fit.project

    @property
    def notes(self) -> list[Note]:
        """What a reader should know of every form's fit, and of its folds."""
        notes = []
        for form in self.forms:
            lost = [fold.fold + 1 for fold in form.folds if fold.value is None]
            own = [Note(NoteKind.FOLD, LOST, f"fold {fold}") for fold in lost]
            notes += [note.about(form.name) for note in (*form.fit.notes, *own)]
        return notes

    @property
    def result(self) -> dict[str, Any]:
        """Everything in plain values: what result.json holds."""
        from .law_words import result_of

        return result_of(self)

    def report(self, folder: Path | str) -> Path:
        """Write comparison.csv, figures, report.html and, last, result.json; the page's path.

        Raises
        ------
        OutputError : the folder cannot be written.
        """
        from .law_page import write_comparison

        return write_comparison(self, Path(folder))


def compare_laws(
    project: Project,
    tests: str | Sequence[str] | None = None,
    forms: Sequence[str] = (),
    *,
    folds: int = FOLDS,
    starts: int = STARTS,
    fold_starts: int = FOLD_STARTS,
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    command_line: Sequence[str] | None = None,
) -> LawComparison:
    """Fit every form to the tests, then without some specimens, and judge it at those.

    Tests whose specimens are not known stay whole in every fold.

    Parameters
    ----------
    tests : by name or kind; every test that can be fitted unless given.
    forms : as for `candidates`.
    folds : at most; fold_starts : random starts of the fit of each.
    starts : random starts of the fit of each form.
    out : folder with a folder for each form, in which everything is written as it ends.
    command_line : as for `fit`.

    Raises
    ------
    InputError : in the project or its data, no test with specimens, nothing to go on with.
    OutputError, NoFeasibleStart, SolverFailure : as `fit`.
    """
    tell = progress or (lambda event: None)
    # All of them first: a mistake in the project shows before the first fit.
    projects = candidates(project.with_fit(starts=starts), forms)
    chosen = project.chosen(tests, fitted=True)
    setups = {name: prepare_fit(own, _fittable(chosen)) for name, own in projects.items()}
    compared = tuple(specimens_of(next(iter(setups.values()))))
    if not compared:
        problem = (
            "no test has specimens that a fit could do without: strips need measured points and "
            'match = "points"'
        )
        raise InputError(project.path, "", problem)
    folder = None if out is None else Path(out)
    if folder is not None:
        parts = {"version": __version__, "folds": str(folds), "fold starts": str(fold_starts)}
        begin_study(folder, parts, resume, overwrite, map(plain, projects))
    done = []
    for name, own in projects.items():
        tell(name)
        place = None if folder is None else folder / plain(name)
        found = stored_fit(
            own,
            [test.name for test in chosen],
            place,
            resume=resume,
            overwrite=overwrite,
            progress=tell,
            command_line=command_line,
        )
        errors = validated_folds(setups[name], found, folds, fold_starts, place, tell)
        done.append(FormFit(name, found, errors, compared))
    return LawComparison(tuple(done), fold_starts)


def _fittable(tests: Sequence[Any]) -> Sequence[FittableTest]:
    return tests
