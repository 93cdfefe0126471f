"""Bootstrap a fit: draw its frames, specimens or tests with replacement and fit every draw."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import NotNegative, TwoOrMore, checked_arguments
from ..errors import InputError
from ..experiments.strains import by_strain
from ..inference.descent import DescentSettings, descend
from ..inference.moduli import moduli_of
from ..inference.optimum import ANALYSES_USED_UP
from ..inference.reported import LEVEL, ReportedModulus, sigma_words
from ..inference.resampling import ResamplingGroup, ResamplingUnit, draw_counts, factors_of, rows_of
from ..inference.weighted_problem import WeightedProblem
from ..lazy_modules import pandas as pd
from ..materials.forms.base import COMPONENTS, Array
from ..notes import Note, NoteKind, note_lines, note_records
from ..project.project import Project
from .folder import OutputSettings, Presented, finished
from .in_use import alone_in_folder
from .optimum import Card, CardOptimum, find_optimum
from .process_pool import Task, cores
from .progress import Listener, listener
from .setup import fingerprints
from .simulation import StudyRecord, begin_study
from .validation import TESTS, parts_of

FEW_UNITS = NoteKind("few to draw from")
#: Units of a group, and samples, below which percentiles are noted as unreliable.
FEW, FEW_SAMPLES = 5, 40
#: Relative difference below which numbers are equal.
ROUNDING = 1e-9
#: Strains of each modulus in the table.
PLACES = 21
METHOD = (
    "Units are drawn with replacement, each among its own group, and count as often as they were "
    "drawn; every sample is fitted from the optimum of all. The bands are percentiles of the "
    "samples. They hold what differs between the units, and nothing that all of them share: "
    "the error of the mesh, a wrong form of the law or of the model, noise that is given and not "
    "in the residual. Moduli of the samples are those of the mesh of the fit; beside them stands "
    "what the fit reports, its mesh error taken out where the fit took it out."
)
COUNT = 100
#: Analyses of a refit, at most, beside the optimum's, which none runs again; its first damping.
MOST, DAMPING = 4, 1e-9
#: Predicted decrease of the sum of squares, relative, that is not worth an analysis.
NEGLIGIBLE = 1e-5
SAMPLES = "bootstrap-samples.json"


@dataclass(frozen=True)
class Sample:
    """One refit: how often each unit of each group was drawn, and the optimiser's unknowns."""

    number: int
    counts: Sequence[Sequence[int]]
    unknowns: Sequence[float]
    analyses: int
    status: str


@dataclass(frozen=True, eq=False)
class Bootstrap(Presented):
    """Fits to samples of a fit's data; over : sort of units; before : analyses before the first."""

    found: CardOptimum
    over: str
    groups: Sequence[ResamplingGroup]
    samples: Sequence[Sample]
    before: int

    @property
    def project(self) -> Project:
        return self.found.setup.project

    @property
    def analyses(self) -> int:
        return self.before + sum(sample.analyses for sample in self.samples)

    @property
    def unfinished(self) -> int:
        """Return the number of samples that used up their analyses before they converged."""
        return sum(sample.status == ANALYSES_USED_UP for sample in self.samples)

    @property
    def strains(self) -> dict[str, Array]:
        """Return strains (n,) by modulus, up to those that the tests reached."""
        valid = self.found.best.valid
        return {name: np.linspace(0.0, valid[c], PLACES) for name, c in COMPONENTS.items()}

    @cached_property
    def unknowns(self) -> Array:
        """Return the unknowns of the optimiser, (samples, count)."""
        return np.array([sample.unknowns for sample in self.samples])

    @cached_property
    def moduli(self) -> dict[str, Array]:
        """Return the moduli of the samples, MPa (samples, n) by name."""
        own = self.found.problem.unknowns
        each = [moduli_of(own, y, self.strains) for y in self.unknowns]
        return {name: np.array([one[name] for one in each]) for name in COMPONENTS}

    @cached_property
    def bands(self) -> dict[str, Array]:
        """Return percentiles of the moduli, MPa (2, n) by name."""
        ends = [(1 - LEVEL) / 2, (1 + LEVEL) / 2]
        return {name: np.quantile(own, ends, axis=0) for name, own in self.moduli.items()}

    @cached_property
    def optimum(self) -> dict[str, Array]:
        """Return the moduli of the optimum of all, MPa (n,) by name, on the mesh of the fit."""
        return moduli_of(self.found.problem.unknowns, self.found.point.unknowns, self.strains)

    @cached_property
    def spread(self) -> dict[str, Array]:
        """Return the relative standard deviation (n,) of the samples by modulus."""
        return {n: own.std(axis=0, ddof=1) / self.optimum[n] for n, own in self.moduli.items()}

    @cached_property
    def of_fit(self) -> dict[str, ReportedModulus]:
        """Return each modulus as the fit reports it."""
        law = self.found.best.law
        return {n: self.found.certainty.at(law, n, strain) for n, strain in self.strains.items()}

    @property
    def sigma(self) -> dict[str, tuple[float, float]]:
        """Return relative 1 sigma of samples and fit by modulus, RMS along its strain."""
        sure = self.found.certainty
        return {
            name: (float(np.sqrt(np.mean(spread**2))), sure.moduli[name].rms_sigma)
            for name, spread in self.spread.items()
        }

    def coefficients(self) -> pd.DataFrame:
        """Return a row an unknown: value, sigma of samples and of the fit, correlations."""
        own = self.found.problem.unknowns
        known = self.found.posterior
        turn = np.eye(own.count)
        turn[: own.size, : own.size] = own.to_coefficients
        each = self.unknowns @ turn.T
        sigma = each.std(axis=0, ddof=1)
        # What lies on a bound in every sample differs by rounding.
        sigma = np.where(sigma > ROUNDING * np.abs(each).max(axis=0), sigma, 0.0)
        moved = np.where(sigma > 0, sigma, np.inf)
        away = (each - each.mean(axis=0)) / moved
        correlation = away.T @ away / (len(each) - 1)
        names = list(known.labels)
        table = pd.DataFrame(
            {
                "unknown": names,
                "value": turn @ self.found.point.unknowns,
                "sigma": sigma,
                "sigma_of_fit": np.sqrt(np.diag(known.coefficients)),
            }
        )
        return pd.concat([table, pd.DataFrame(correlation, columns=names)], axis=1)

    def table(self) -> pd.DataFrame:
        """Return the moduli along their strains, with both bands."""
        found = []
        for name, strain in self.strains.items():
            fit, (low, high) = self.of_fit[name], self.bands[name]
            columns = {
                "modulus": name,
                "strain": strain,
                "MPa": self.optimum[name],
                "lower_MPa": low,
                "upper_MPa": high,
                "median_MPa": np.median(self.moduli[name], axis=0),
                "sigma_relative": self.spread[name],
                "fit_MPa": fit.value,
                "fit_lower_MPa": fit.lower,
                "fit_upper_MPa": fit.upper,
                "fit_sigma_relative": fit.sigma,
            }
            found.append(pd.DataFrame(columns))
        return pd.concat(found, ignore_index=True)

    @property
    def notes(self) -> list[Note]:
        notes = list(self.found.notes)
        for group in self.groups:
            count = len(group.units)
            if count < FEW:
                words = (
                    f"{count} {self.over} only: so few drawn from themselves scatter less than "
                    "others would, and the percentiles are too narrow"
                )
                notes.append(Note(FEW_UNITS, words, group.name))
        if len(self.samples) < FEW_SAMPLES:
            words = f"{len(self.samples)} samples: the ends of the bands are those of one or two"
            notes.append(Note(FEW_UNITS, words))
        return notes

    @property
    def result(self) -> dict[str, Any]:
        setup = self.found.setup
        return {
            "command": "bootstrap",
            "title": setup.project.title,
            "project": str(setup.project.path),
            "card": self.found.card,
            "tests": [test.test.name for test in setup.tests],
            "over": self.over,
            "groups": {group.name: [u.name for u in group.units] for group in self.groups},
            "seed": setup.project.fit.seed,
            "samples": len(self.samples),
            "analyses": self.analyses,
            "unfinished": self.unfinished,
            "level": LEVEL,
            "up_to_strain": by_strain(self.found.best.valid),
            "sigma_relative": {name: own for name, (own, _) in self.sigma.items()},
            "sigma_relative_of_fit": {name: of for name, (_, of) in self.sigma.items()},
            "method": METHOD,
            "notes": note_records(self.notes),
        }

    def lines(self) -> list[str]:
        drawn = ", ".join(f"{group.name} ({len(group.units)})" for group in self.groups)
        each = [
            f"{name} {sigma_words(own)} (fit {sigma_words(of_fit)})"
            for name, (own, of_fit) in self.sigma.items()
        ]
        lines = [
            f"{len(self.samples)} samples of {self.over}: {drawn}; {self.analyses} analyses",
            f"1 sigma, root mean square along the strain: {', '.join(each)}",
        ]
        if self.unfinished:
            lines.append(f"{self.unfinished} samples used up their analyses before they settled")
        return [*lines, *note_lines(self.notes)]


@checked_arguments
@alone_in_folder
def bootstrap(
    project: Project,
    over: str,
    samples: TwoOrMore = COUNT,
    card: Card = None,
    tests: str | Sequence[str] | None = None,
    *,
    seed: NotNegative | None = None,
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Listener = None,
) -> Bootstrap:
    """Draw parts of the data with replacement and fit every draw, from the optimum of the fit.
    over : "tests" (among those of their kind), or a sort of parts of the tests: "frames",
    "specimens", "directions", "ratios"; what is drawn twice counts twice. samples : number of
    draws, each kept in `out` as it ends. seed : of the draws, the project's unless given. The other
    arguments and the errors are those of `profile`. InputError also : fewer than two units."""
    output = OutputSettings.of(out, resume, overwrite)
    project = project.with_fit(seed=seed)
    found = find_optimum(project, card, tests)
    groups = groups_of(found, over)
    folder = begin_study(output, {"over": over}, records=(SAMPLES,))
    at = [f"{value:.6g}" for value in found.point.unknowns]
    depends = {**fingerprints(found.setup, found.problem), "over": over, "at": at}
    record = StudyRecord(folder, SAMPLES, "samples", Sample, "number", depends, resume)
    missing = [n for n in range(samples) if n not in record.rows]
    tell = listener(progress)
    others = len(record.rows) + len(missing) - samples
    tell(len(record.rows) - others, samples, "")
    prepare = functools.partial(_task, found, groups, project.fit.seed)
    for _ in record.run(project, prepare, missing):
        tell(len(record.rows) - others, samples, "")
    # Every process runs the optimum once more.
    before = found.analyses + min(project.fit.jobs or cores(), len(missing))
    drawn = [record.rows[n] for n in range(samples)]
    return finished(Bootstrap(found, over, groups, drawn, before), out)


def groups_of(found: CardOptimum, over: str) -> list[ResamplingGroup]:
    """Return the units that are drawn, each among its group; raises InputError without any.
    Groups are kinds of test; of parts, comparisons (specimens by direction), else tests."""
    setup = found.setup
    problem = found.problem
    grouped: dict[str, list[ResamplingUnit]] = {}
    if over == TESTS:
        numbers = {c.name: k for k, c in enumerate(problem.comparisons)}
        for test in setup.tests:
            rows = np.zeros(len(problem.blocks.of), dtype=bool)
            for comparison in setup.comparisons_of(test):
                rows[problem.rows(numbers[comparison.name])] = True
            grouped.setdefault(test.test.kind, []).append(ResamplingUnit(test.test.name, rows))
    else:
        for part in parts_of(setup, over, "--over"):
            alone = {name: mask for name, mask in part.alone.items() if mask.any()}
            shared = [name for name, mask in alone.items() if not mask.all()]
            own = shared[0] if shared else setup.tests[part.test].test.name
            unit = ResamplingUnit(part.name, rows_of(problem, alone))
            grouped.setdefault(own, []).append(unit)
    several = [ResamplingGroup(name, units) for name, units in grouped.items() if len(units) > 1]
    if not several:
        what = "kind" if over == TESTS else "test"
        raise InputError(setup.project.path, "--over", f"no {what} has two {over} or more")
    return several


def _task(found: CardOptimum, groups: Sequence[ResamplingGroup], seed: int) -> Task:
    problem = found.setup.problem()
    # With derivatives, from the unloaded state: every sample starts from here.
    point = problem.evaluate(found.point.unknowns, True, warm=False)
    tolerance = found.setup.project.fit.tolerance
    settings = DescentSettings(initial_damping=DAMPING, negligible_decrease=NEGLIGIBLE)

    def sample(number: int, tell: Callable[[Any], None]) -> Sample:
        counts = draw_counts(groups, np.random.default_rng([seed, number]))
        own = WeightedProblem.of(problem, factors_of(problem, groups, counts))
        assert point is not None  # it ran a moment ago
        best, status = descend(
            own, own.weighted(point), tolerance, MOST, norms=True, settings=settings
        )
        return Sample(number, counts, best.unknowns.tolist(), own.analyses, status)

    return sample
