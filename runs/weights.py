"""Fit with other weights between kinds of test: one kind counts a quarter to four times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, Note, checked, rows
from ..errors import lines as note_lines
from ..files import __version__
from ..files import pandas as pd
from ..inference.problem import Evaluation, FitProblem
from ..inference.search import fit_from
from ..materials.forms.base import COMPONENTS
from ..project.project import Project
from .compare import errors
from .fit import stored_fit
from .folder import Presented, check_asked, finished, shown
from .progress import Listener, listener
from .result import Fit
from .setup import FitSetup, fingerprints
from .simulation import FAILED, StudyRecord, begin_study

STARTS = 5
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
        strains = [self.strain(name, place) for place in PLACES]
        return [float(v) for v in np.interp(strains, sure.strain[name], sure.total[name])]

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
            "command": "validate", "title": self.project.title, "version": __version__,
            "weights_of": self.counted, "tests_counted": list(self.names), "error": ERROR,
            "strain": {n: [self.strain(n, p) for p in PLACES] for n in COMPONENTS},
            "sigma_relative": {name: self.sigma(name) for name in COMPONENTS},
            "change": {name: list(self.change(name)) for name in COMPONENTS},
            "rows": [
                {
                    "weight_times": run.count, "relative": run.relative, "rms": run.rms,
                    "moduli_MPa": run.moduli, "analyses": run.analyses,
                }
                for run in self.ended
            ],
            "notes": rows(self.notes),
        }  # fmt: skip

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


@checked
def weights(
    project: Project, counted: str, tests: str | Sequence[str] | None = None, *,
    starts: int = STARTS, counts: Sequence[float] = COUNTS, trust: Sequence[str] = (),
    out: Path | str | None = None, resume: bool = False, overwrite: bool = False,
    progress: Listener = None, command_line: Sequence[str] | None = None,
) -> WeightStudy:  # fmt: skip
    """Fit the tests together, then with other weights of one kind, each from its neighbour.
    counted : kind of test whose weight is changed, or the name of a test. starts : of the fit at
    the project's weights; the others begin at the optimum beside them. counts : factors of the
    weight in the project. The other arguments and the errors are those of `fit`. InputError also :
    no test of that kind or name, or no other one."""
    check_asked(out, resume, overwrite)
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
    folder = begin_study(out, of, resume, overwrite, [FITTED], [RUNS])
    found = stored_fit(
        project, [test.name for test in chosen], "the fit at the project's weights", FITTED,
        folder=folder, resume=resume, overwrite=overwrite, progress=tell, command_line=command_line,
    )  # fmt: skip
    at = [f"{value:.9g}" for value in found.best.point.unknowns]
    depends = {**fingerprints(found.setup, found.problem), "tests": names, "at": at}
    record = StudyRecord(folder, RUNS, "runs", WeightedFit, "count", depends, resume)
    runs = sorted(_runs(found, names, sorted(counts), record, tell), key=lambda run: run.count)
    return finished(WeightStudy(project, counted, tuple(names), found, tuple(runs)), out)


def _runs(
    found: Fit, names: Sequence[str], counts: Sequence[float], record: StudyRecord[WeightedFit],
    tell: Callable[..., None],
) -> Iterator[WeightedFit]:  # fmt: skip
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
    optimum = fit_from(problem, y, setup.options, near=True)
    if optimum is None:
        return WeightedFit(count, {}, {}, {}, (), problem.analyses, problem.failure or "no fit")
    return _weighted(setup, found, count, problem, optimum.best, optimum.analyses)


def _weighted(
    setup: FitSetup, found: Fit, count: float, problem: FitProblem, best: Evaluation, analyses: int
) -> WeightedFit:  # fmt: skip
    law = problem.unknowns.law(found.law, best.unknowns)
    moduli = {
        name: law.modulus(name, np.array(PLACES) * found.best.valid[component]).tolist()
        for name, component in COMPONENTS.items()
    }
    relative, norms = {}, problem.norms(best.residual)
    for test, weighting in zip(setup.tests, setup.weightings, strict=True):
        own = np.concatenate([norms[c.name] for c in setup.own(test)])
        relative[test.test.name] = float(own.sum() / weighting.weight)
    rms = errors(problem, best.residual)
    return WeightedFit(count, relative, rms, moduli, best.unknowns.tolist(), analyses)
