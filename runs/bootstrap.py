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
from .process_pool import cores
from .progress import Listener, listener
from .setup import fingerprints
from .simulation import StudyRecord, begin_study
from .validation import TESTS, parts_of

FEW_UNITS = NoteKind("few to draw from")
METHOD = (
    "Units are drawn with replacement, each among its own group, and count as often as they were "
    "drawn; every sample is fitted from the optimum of all. The bands are percentiles of the "
    "samples. They hold what differs between the units, and nothing that all of them share: "
    "the error of the mesh, a wrong form of the law or of the model, noise that is given and not "
    "in the residual. Moduli of the samples are those of the mesh of the fit; beside them stands "
    "what the fit reports, its mesh error taken out where the fit took it out."
)
SAMPLES = "bootstrap-samples.json"
#: Analyses of a refit, at most, beside the optimum's, which none runs again.
MAX_ANALYSES = 4
#: Of a refit: it begins at an optimum, so that steps are hardly damped.
REFIT = DescentSettings(initial_damping=1e-9, negligible_decrease=1e-5)


@dataclass(frozen=True)
class Sample:
    """Hold one refit: how often each unit of each group was drawn, and the optimiser's unknowns."""

    number: int
    counts: Sequence[Sequence[int]]
    unknowns: Sequence[float]
    analyses: int
    status: str


@dataclass(frozen=True, eq=False)
class Bootstrap(Presented):
    """Hold the fits to samples of a fit's data.

    Attributes
    ----------
    optimum : CardOptimum
        Of all data.
    over : str
        Sort of units that are drawn.
    groups : sequence of ResamplingGroup
        Units that are drawn among each other.
    samples : sequence of Sample
    optimum_analyses : int
        Analyses of the optimum, in all processes.
    """

    optimum: CardOptimum
    over: str
    groups: Sequence[ResamplingGroup]
    samples: Sequence[Sample]
    optimum_analyses: int

    @property
    def project(self) -> Project:
        """Return the project of the fit."""
        return self.optimum.setup.project

    @property
    def analyses(self) -> int:
        """Return the number of all analyses."""
        return self.optimum_analyses + sum(sample.analyses for sample in self.samples)

    @property
    def unfinished(self) -> int:
        """Return the number of samples that used up their analyses before they converged."""
        return sum(sample.status == ANALYSES_USED_UP for sample in self.samples)

    @property
    def strains(self) -> dict[str, Array]:
        """Return strains (21,) by modulus, up to those that the tests reached."""
        valid = self.optimum.best.valid
        return {name: np.linspace(0.0, valid[c], 21) for name, c in COMPONENTS.items()}

    @cached_property
    def unknowns(self) -> Array:
        """Return the unknowns of the optimiser, (samples, count)."""
        return np.array([sample.unknowns for sample in self.samples])

    @cached_property
    def moduli(self) -> dict[str, Array]:
        """Return the moduli of the samples, MPa (samples, n) by name."""
        unknowns = self.optimum.problem.unknowns
        samples = [moduli_of(unknowns, y, self.strains) for y in self.unknowns]
        return {name: np.array([moduli[name] for moduli in samples]) for name in COMPONENTS}

    @cached_property
    def bands(self) -> dict[str, Array]:
        """Return percentiles of the moduli, MPa (2, n) by name."""
        ends = [(1 - LEVEL) / 2, (1 + LEVEL) / 2]
        return {name: np.quantile(moduli, ends, axis=0) for name, moduli in self.moduli.items()}

    @cached_property
    def optimum_moduli(self) -> dict[str, Array]:
        """Return the moduli of the optimum of all, MPa (n,) by name, on the mesh of the fit."""
        return moduli_of(self.optimum.problem.unknowns, self.optimum.point.unknowns, self.strains)

    @cached_property
    def spread(self) -> dict[str, Array]:
        """Return the relative standard deviation (n,) of the samples by modulus."""
        return {
            name: moduli.std(axis=0, ddof=1) / self.optimum_moduli[name]
            for name, moduli in self.moduli.items()
        }

    @cached_property
    def of_fit(self) -> dict[str, ReportedModulus]:
        """Return each modulus as the fit reports it."""
        law = self.optimum.best.law
        sure = self.optimum.certainty
        return {name: sure.at(law, name, strain) for name, strain in self.strains.items()}

    @property
    def sigma(self) -> dict[str, tuple[float, float]]:
        """Return relative 1 sigma of samples and fit by modulus, RMS along its strain."""
        moduli = self.optimum.certainty.moduli
        return {
            name: (float(np.sqrt(np.mean(spread**2))), moduli[name].rms_sigma)
            for name, spread in self.spread.items()
        }

    def coefficients(self) -> pd.DataFrame:
        """Return the unknowns over the samples.

        Returns
        -------
        DataFrame
            A row an unknown (coefficients in MPa): `unknown`, its `value` at the optimum, its 1
            `sigma` over the samples, `sigma_of_fit`, and its correlation with every unknown.
        """
        unknowns = self.optimum.problem.unknowns
        posterior = self.optimum.posterior
        to_coefficients = np.eye(unknowns.count)
        to_coefficients[: unknowns.size, : unknowns.size] = unknowns.to_coefficients
        samples = self.unknowns @ to_coefficients.T
        sigma = samples.std(axis=0, ddof=1)
        # What lies on a bound in every sample differs by rounding.
        sigma = np.where(sigma > 1e-9 * np.abs(samples).max(axis=0), sigma, 0.0)
        scaled = (samples - samples.mean(axis=0)) / np.where(sigma > 0, sigma, np.inf)
        correlation = scaled.T @ scaled / (len(samples) - 1)
        names = list(posterior.labels)
        table = pd.DataFrame(
            {
                "unknown": names,
                "value": to_coefficients @ self.optimum.point.unknowns,
                "sigma": sigma,
                "sigma_of_fit": np.sqrt(np.diag(posterior.coefficients)),
            }
        )
        return pd.concat([table, pd.DataFrame(correlation, columns=names)], axis=1)

    def table(self) -> pd.DataFrame:
        """Return the moduli along their strains, with both bands.

        Returns
        -------
        DataFrame
            A row a modulus and strain: `modulus`, `strain`; of the samples `MPa` (of the optimum of
            all), `lower_MPa`, `upper_MPa`, `median_MPa`, `sigma_relative`; of the fit `fit_MPa`,
            `fit_lower_MPa`, `fit_upper_MPa`, `fit_sigma_relative`.
        """
        tables = []
        for name, strain in self.strains.items():
            fit = self.of_fit[name]
            lower, upper = self.bands[name]
            columns = {
                "modulus": name,
                "strain": strain,
                "MPa": self.optimum_moduli[name],
                "lower_MPa": lower,
                "upper_MPa": upper,
                "median_MPa": np.median(self.moduli[name], axis=0),
                "sigma_relative": self.spread[name],
                "fit_MPa": fit.value,
                "fit_lower_MPa": fit.lower,
                "fit_upper_MPa": fit.upper,
                "fit_sigma_relative": fit.sigma,
            }
            tables.append(pd.DataFrame(columns))
        return pd.concat(tables, ignore_index=True)

    @property
    def notes(self) -> list[Note]:
        """Return the notes of the optimum, and those on few units or samples."""
        notes = list(self.optimum.notes)
        for group in self.groups:
            count = len(group.units)
            if count < 5:
                words = (
                    f"{count} {self.over} only: so few drawn from themselves scatter less than "
                    "others would, and the percentiles are too narrow"
                )
                notes.append(Note(FEW_UNITS, words, group.name))
        if len(self.samples) < 40:
            words = f"{len(self.samples)} samples: the ends of the bands are those of one or two"
            notes.append(Note(FEW_UNITS, words))
        return notes

    @property
    def result(self) -> dict[str, Any]:
        """Return the content of result.json."""
        setup = self.optimum.setup
        return {
            "command": "bootstrap",
            "title": setup.project.title,
            "project": str(setup.project.path),
            "card": self.optimum.card,
            "tests": [prepared.test.name for prepared in setup.tests],
            "over": self.over,
            "groups": {group.name: [unit.name for unit in group.units] for group in self.groups},
            "seed": setup.project.fit.seed,
            "samples": len(self.samples),
            "analyses": self.analyses,
            "unfinished": self.unfinished,
            "level": LEVEL,
            "up_to_strain": by_strain(self.optimum.best.valid),
            "sigma_relative": {name: of_samples for name, (of_samples, _) in self.sigma.items()},
            "sigma_relative_of_fit": {name: of_fit for name, (_, of_fit) in self.sigma.items()},
            "method": METHOD,
            "notes": note_records(self.notes),
        }

    def lines(self) -> list[str]:
        """Return what a terminal shows."""
        groups = ", ".join(f"{group.name} ({len(group.units)})" for group in self.groups)
        sigmas = [
            f"{name} {sigma_words(of_samples)} (fit {sigma_words(of_fit)})"
            for name, (of_samples, of_fit) in self.sigma.items()
        ]
        lines = [
            f"{len(self.samples)} samples of {self.over}: {groups}; {self.analyses} analyses",
            f"1 sigma, root mean square along the strain: {', '.join(sigmas)}",
        ]
        if self.unfinished:
            lines.append(f"{self.unfinished} samples used up their analyses before they settled")
        return [*lines, *note_lines(self.notes)]


@checked_arguments
@alone_in_folder
def bootstrap(
    project: Project,
    over: str,
    samples: TwoOrMore = 100,
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

    Parameters
    ----------
    project : Project
    over : str
        "tests" (among those of their kind), or a sort of parts of the tests: "frames", "specimens",
        "directions", "ratios". What is drawn twice counts twice.
    samples : int
        Number of draws, each kept in `out` as it ends.
    card, tests, out, overwrite, progress
        As of `profile`.
    seed : int, optional
        Of the draws; by default the project's.
    resume : bool
        Whether samples that the folder keeps are taken over.

    Returns
    -------
    Bootstrap

    Raises
    ------
    InputError, OutputError, SolverFailure
        As by `profile`; also where there are fewer than two units to draw from.
    """
    output = OutputSettings.of(out, resume, overwrite)
    project = project.with_fit(seed=seed)
    optimum = find_optimum(project, card, tests)
    groups = groups_of(optimum, over)
    folder = begin_study(output, {"over": over}, records=(SAMPLES,))
    unknowns = [f"{value:.6g}" for value in optimum.point.unknowns]
    depends = {**fingerprints(optimum.setup, optimum.problem), "over": over, "at": unknowns}
    record = StudyRecord(folder, SAMPLES, "samples", Sample, "number", depends, resume)
    missing = [number for number in range(samples) if number not in record.rows]
    on_event = listener(progress)
    surplus = len(record.rows) + len(missing) - samples
    on_event(len(record.rows) - surplus, samples, "")
    prepare = functools.partial(SampleTask, optimum, groups, project.fit.seed)
    for _ in record.run(project, prepare, missing):
        on_event(len(record.rows) - surplus, samples, "")
    # Every process runs the optimum once more.
    analyses = optimum.analyses + min(project.fit.jobs or cores(), len(missing))
    fits = [record.rows[number] for number in range(samples)]
    return finished(Bootstrap(optimum, over, groups, fits, analyses), out)


def groups_of(optimum: CardOptimum, over: str) -> list[ResamplingGroup]:
    """Return the units that are drawn, each among its group.

    Groups are kinds of test; of parts, comparisons (specimens by direction), else tests.

    Raises
    ------
    InputError
        No group has two units or more.
    """
    units = _tests_by_kind(optimum) if over == TESTS else _parts_by_group(optimum, over)
    groups = [ResamplingGroup(name, group) for name, group in units.items() if len(group) > 1]
    if not groups:
        group_is = "kind" if over == TESTS else "test"
        problem = f"no {group_is} has two {over} or more"
        raise InputError(optimum.setup.project.path, "--over", problem)
    return groups


def _tests_by_kind(optimum: CardOptimum) -> dict[str, list[ResamplingUnit]]:
    """Return whole tests as units, by kind."""
    problem = optimum.problem
    numbers = {comparison.name: k for k, comparison in enumerate(problem.comparisons)}
    units: dict[str, list[ResamplingUnit]] = {}
    for prepared in optimum.setup.tests:
        rows_of_test = np.zeros(len(problem.blocks.of), dtype=bool)
        for comparison in optimum.setup.comparisons_of(prepared):
            rows_of_test[problem.rows(numbers[comparison.name])] = True
        unit = ResamplingUnit(prepared.test.name, rows_of_test)
        units.setdefault(prepared.test.kind, []).append(unit)
    return units


def _parts_by_group(optimum: CardOptimum, over: str) -> dict[str, list[ResamplingUnit]]:
    """Return parts of tests as units, by the comparison that they share, else by test."""
    units: dict[str, list[ResamplingUnit]] = {}
    for part in parts_of(optimum.setup, over, "--over"):
        masks = {name: mask for name, mask in part.alone.items() if mask.any()}
        shared = [name for name, mask in masks.items() if not mask.all()]
        group = shared[0] if shared else optimum.setup.tests[part.test].test.name
        unit = ResamplingUnit(part.name, rows_of(optimum.problem, masks))
        units.setdefault(group, []).append(unit)
    return units


class SampleTask:
    """Fit samples in one process, which has a problem and a solver of its own."""

    def __init__(self, optimum: CardOptimum, groups: Sequence[ResamplingGroup], seed: int) -> None:
        self._groups = groups
        self._seed = seed
        self._tolerance = optimum.setup.project.fit.tolerance
        self._problem = optimum.setup.problem()
        # With derivatives, from the unloaded state: every sample starts from here.
        point = self._problem.evaluate(optimum.point.unknowns, with_jacobian=True, warm=False)
        assert point is not None  # it ran a moment ago
        self._point = point

    def __call__(self, number: int, report: Callable[[Any], None]) -> Sample:
        """Return the fit to a draw."""
        counts = draw_counts(self._groups, np.random.default_rng([self._seed, number]))
        factors = factors_of(self._problem, self._groups, counts)
        problem = WeightedProblem.of(self._problem, factors)
        best, status = descend(
            problem,
            problem.weighted(self._point),
            self._tolerance,
            MAX_ANALYSES,
            norms=True,
            settings=REFIT,
        )
        return Sample(number, counts, best.unknowns.tolist(), problem.analyses, status)
