"""Study of weights: how the moduli change if some tests count a quarter to four times as much."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import Positive, checked_arguments
from ..errors import InputError
from ..inference.problem import Evaluation, FitProblem
from ..inference.search import fit_from
from ..lazy_modules import pandas as pd
from ..materials.forms.base import COMPONENTS, Array
from ..materials.forms.symmetry import modulus_labels
from ..notes import Note, Verdict
from ..project.project import Project
from ..version import __version__
from .fit import fit_in_series
from .folder import OutputSettings, Presented, finished, shown
from .held_out import errors
from .in_use import alone_in_folder
from .progress import Listener, listener
from .result import Fit
from .setup import FitSetup, fingerprints, tests_with_weight
from .simulation import FAILED, StudyRecord, begin_study

#: Number of random starts of the fit at the project's weights.
STARTS = 5
#: Factors by which the weight is multiplied, from 1/4 to 4 in steps of the square root of two.
COUNTS = tuple(2.0 ** (k / 2) for k in range(-4, 5))
#: Strains at which moduli are compared, as shares of the largest strain that the tests reached.
STRAIN_SHARES = (0.0, 0.5, 1.0)
ERROR = "mean relative RMS error of a test"


@dataclass(frozen=True)
class WeightedFit:
    """Hold the optimum where the weight of some tests is multiplied.

    Attributes
    ----------
    count : float
        Factor by which the weight is multiplied.
    relative : mapping of str to float
        Mean relative RMS error by test.
    rms : mapping of str to float
        Root mean square of the residual by comparison, in its unit.
    moduli : mapping of str to sequence of 3 floats
        MPa, at `STRAIN_SHARES` of the strain that the fit at the project's weights reached.
    unknowns : sequence of float
        The optimiser's unknowns at the optimum.
    analyses : int
        Number of analyses that the fit took.
    failure : str
        Why there is no fit, "" where there is one.
    """

    count: float
    relative: Mapping[str, float]
    rms: Mapping[str, float]
    moduli: Mapping[str, Sequence[float]]
    unknowns: Sequence[float]
    analyses: int
    failure: str = ""


@dataclass(frozen=True, eq=False)
class WeightStudy(Presented):
    """Hold the fits with several weights of some of the tests.

    Attributes
    ----------
    project : Project
    counted : str
        Kind or name of the tests whose weight is changed.
    names : sequence of str
        Names of these tests.
    reference : Fit
        The fit with the project's weights.
    runs : sequence of WeightedFit
        By rising weight.
    """

    project: Project
    counted: str
    names: Sequence[str]
    reference: Fit
    runs: Sequence[WeightedFit]

    @property
    def ended(self) -> list[WeightedFit]:
        """Return the fits that did not fail."""
        return [run for run in self.runs if not run.failure]

    @property
    def labels(self) -> Mapping[str, str]:
        """Return the labels of the moduli that follow from no others, by their names."""
        return modulus_labels(self.reference.law.form)

    def strain(self, name: str, share: float) -> float:
        """Return the strain at which a modulus is compared; `share` is one of `STRAIN_SHARES`."""
        return float(share * self.reference.best.valid[COMPONENTS[name]])

    def table(self) -> pd.DataFrame:
        """Return errors and moduli of the fits with each weight.

        Returns
        -------
        DataFrame
            One row per weight: its factor `weight_times`; the mean relative RMS error of each test,
            "relative TEST"; the RMS residual of each comparison, "rms COMPARISON, UNIT"; each
            modulus at the strains compared, "E1_MPa at STRAIN"; and `analyses`, their number.
        """
        units = {c.name: c.objective.unit for c in self.reference.problem.comparisons}
        table = []
        for run in self.ended:
            row = {"weight_times": run.count}
            row |= {f"relative {test}": error for test, error in run.relative.items()}
            row |= {f"rms {name}, {units[name]}": rms for name, rms in run.rms.items()}
            for name, moduli in run.moduli.items():
                for share, modulus in zip(STRAIN_SHARES, moduli, strict=True):
                    row[f"{name}_MPa at {self.strain(name, share):.4g}"] = modulus
            table.append({**row, "analyses": run.analyses})
        return pd.DataFrame(table)

    def change(self, name: str) -> tuple[float, float]:
        """Return least and largest relative change of a modulus over strains and weights."""
        reference = next(run for run in self.runs if run.count == 1)
        moduli = np.array([run.moduli[name] for run in self.ended])
        changes = moduli / np.array(reference.moduli[name]) - 1.0
        low, high = np.round([changes.min(), changes.max()], 9) + 0.0  # no rounding of the fits
        return float(low), float(high)

    def sigma(self, name: str) -> list[float] | None:
        """Return the relative 1 sigma of a modulus at `STRAIN_SHARES` in the fit, if known."""
        best = self.reference.best
        if best.certainty is None:
            return None
        strains = np.array([self.strain(name, share) for share in STRAIN_SHARES])
        return best.certainty.at(best.law, name, strains).sigma.tolist()

    @property
    def notes(self) -> list[Note]:
        """Return notes on fits that failed, then those of the fit with the project's weights."""
        failed = [
            Note(FAILED, run.failure, f"weight times {run.count:.3g}")
            for run in self.runs
            if run.failure
        ]
        return [*failed, *self.reference.notes]

    @property
    def verdict(self) -> Verdict:
        """Return by how much the weight moves the moduli."""
        words = []
        for name, label in self.labels.items():
            low, high = self.change(name)
            words.append(f"{label} by {100 * low:+.2g} to {100 * high:+.2g} %")
        return Verdict(
            "usable",
            f"the weight of {self.counted} changes {', '.join(words)}",
            next_step="compare these changes with the 1 sigma in the table: where they are larger "
            "the tests contradict each other",
        )

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the study."""
        return {
            "command": "validate",
            "title": self.project.title,
            "version": __version__,
            "weights_of": self.counted,
            "tests_counted": self.names,
            "error": ERROR,
            "strain": {
                name: [self.strain(name, share) for share in STRAIN_SHARES] for name in COMPONENTS
            },
            "sigma_relative": {name: self.sigma(name) for name in COMPONENTS},
            "change": {name: self.change(name) for name in COMPONENTS},
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
        }

    def result_lines(self) -> list[str]:
        """Return the results of the study as lines of the terminal."""
        table = self.table()
        table.index = pd.Index([f"{run.count:.3g}" for run in self.ended])
        columns = [f"relative {test}" for test in self.ended[0].relative]
        headings = {}
        for name, label in self.labels.items():
            strain = self.strain(name, 0.5)
            headings[f"{name}_MPa at {strain:.4g}"] = f"{label}_MPa at {100 * strain:.3g} %"
        head = f"weight of {self.counted}, times what the project says; {ERROR}"
        lines = [head, *shown(table[[*columns, *headings]].rename(columns=headings))]
        for name, label in self.labels.items():
            low, high = self.change(name)
            line = f"{label} changes by {100 * low:+.2g} to {100 * high:+.2g} %"
            sigma = self.sigma(name)
            if sigma is not None:
                line += f" (1 sigma there: {100 * max(sigma):.2g} % at most)"
            lines.append(line)
        return lines


@checked_arguments
@alone_in_folder
def weights(
    project: Project,
    counted: str,
    tests: str | Sequence[str] | None = None,
    *,
    starts: Positive = STARTS,
    counts: Sequence[float] = COUNTS,
    trust: Sequence[str] = (),
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Listener = None,
    command_line: Sequence[str] | None = None,
) -> WeightStudy:
    """Fit the tests with several weights of one kind of test, to see what the moduli owe to it.

    The fit with the project's weights has random starts; from its optimum the weight is raised and
    then lowered step by step, and each fit begins at the optimum of the step before.

    Parameters
    ----------
    project : Project
    counted : str
        Kind of test whose weight is changed, or the name of a test.
    tests : str or sequence of str, optional
        Names of tests, or a kind of test; by default all that can be fitted.
    starts : int
        Number of random starts of the fit with the project's weights.
    counts : sequence of float
        Factors by which the weight in the project is multiplied.
    trust, out, resume, overwrite, progress, command_line
        As in `fit`.

    Returns
    -------
    WeightStudy

    Raises
    ------
    InputError, OutputError, SolverFailure
        As in `fit`; InputError also if no test, or every test, has that kind or name.
    """
    output = OutputSettings.of(out, resume, overwrite, command_line)
    on_event = listener(progress)
    project = project.with_fit(starts=starts, trust=[*project.fit.trust, *trust])
    chosen = tests_with_weight(project, project.chosen(tests, fitted=True))
    names = [test.name for test in chosen if counted in (test.kind, test.name)]
    if not names or len(names) == len(chosen):
        options = ", ".join(dict.fromkeys(name for t in chosen for name in (t.kind, t.name)))
        problem = (
            f"expected a kind or a name of some of the tests that are fitted, not of all: "
            f"{options}; got {counted!r}"
        )
        raise InputError(project.path, "--weights", problem)
    file = "weights-runs.json"
    folder = begin_study(output, {"counted": ", ".join(names)}, ["fit"], [file])
    all_names = [test.name for test in chosen]
    title = "the fit at the project's weights"
    reference = fit_in_series(project, all_names, title, "fit", output, on_event)
    unknowns = [f"{value:.9g}" for value in reference.best.point.unknowns]
    digests = fingerprints(reference.setup, reference.problem)
    depends = {**digests, "tests": names, "at": unknowns}
    record = StudyRecord(folder, file, "runs", WeightedFit, depends, resume)
    runs = list(_runs(reference, names, sorted(counts), record, on_event))
    runs.sort(key=lambda run: run.count)
    return finished(WeightStudy(project, counted, tuple(names), reference, tuple(runs)), out)


def _runs(
    reference: Fit,
    names: Sequence[str],
    counts: Sequence[float],
    record: StudyRecord[WeightedFit],
    on_event: Callable[..., None],
) -> Iterator[WeightedFit]:
    """Yield the fit with the project's weights, then those with rising and with falling factors."""
    point = reference.best.point
    yield _weighted(reference.setup, reference, 1.0, reference.problem, point, 0)
    rising = [count for count in counts if count > 1]
    falling = [count for count in reversed(counts) if count < 1]
    for series in (rising, falling):
        start = np.array(point.unknowns)
        for count in series:
            run = record.rows.get(count)
            if run is None or run.failure:
                on_event(f"weight times {count:.3g}")
                run = refit(reference, names, count, start)
                record.write(run)
            yield run
            if not run.failure:
                start = np.array(run.unknowns)


def refit(reference: Fit, names: Sequence[str], count: float, start: Array) -> WeightedFit:
    """Fit with the weight of the named tests times `count`, beginning at the unknowns `start`."""
    setup = replace(reference.setup, weight_factors=dict.fromkeys(names, count))
    problem = setup.problem()
    optimum = fit_from(problem, start, setup.options, without_lead_in=True)
    if optimum is None:
        return WeightedFit(count, {}, {}, {}, (), problem.analyses, problem.failure or "no fit")
    return _weighted(setup, reference, count, problem, optimum.best, optimum.analyses)


def _weighted(
    setup: FitSetup,
    reference: Fit,
    count: float,
    problem: FitProblem,
    best: Evaluation,
    analyses: int,
) -> WeightedFit:
    """Return errors and moduli at an optimum `best` that was found with the factor `count`."""
    law = problem.unknowns.law(reference.law, best.unknowns)
    moduli = {
        name: law.modulus(name, np.array(STRAIN_SHARES) * reference.best.valid[component]).tolist()
        for name, component in COMPONENTS.items()
    }
    relative = {}
    norms = problem.norms(best.residual)
    for prepared, weighting in zip(setup.tests, setup.weightings, strict=True):
        blocks = np.concatenate([norms[c.name] for c in setup.comparisons_of(prepared)])
        relative[prepared.test.name] = blocks.sum() / weighting.weight
    rms = errors(problem, best.residual)
    return WeightedFit(count, relative, rms, moduli, best.unknowns.tolist(), analyses)
