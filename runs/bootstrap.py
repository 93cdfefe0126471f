"""Bootstrap of a fit: resampling of its data with replacement, and a refit to every sample.

What is resampled is whole tests, or frames, specimens, directions or load ratios within the tests.
"""

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
from ..experiments.forward import by_strain
from ..inference.descent import DescentSettings, descend
from ..inference.problem import ANALYSES_USED_UP, WeightedProblem
from ..inference.reported import LARGEST_SIGMA, LEVEL, ReportedModulus, moduli_of, sigma_words
from ..inference.resampling import ResamplingGroup, ResamplingUnit, draw_counts, factors_of, rows_of
from ..lazy_modules import pandas as pd
from ..materials.forms.base import COMPONENTS, Array
from ..materials.forms.symmetry import modulus_labels
from ..notes import Note, NoteKind, Verdict, joined_lines
from ..processes import cores
from ..project.project import Project
from .folder import OutputSettings, Presented, finished
from .in_use import alone_in_folder
from .optimum import Card, CardOptimum, find_optimum
from .progress import Listener, listener
from .setup import fingerprints
from .simulation import StudyRecord, begin_study, check_has_law
from .validation import TESTS, omittable_parts

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
#: Largest number of analyses of the tests in one refit. The analysis at the optimum, from which
#: every refit begins, is not counted: it is run once in each process.
MAX_ANALYSES = 4
#: Settings of the descent of a refit. It begins at the optimum of all data, close to that of the
#: sample, so that its steps are hardly damped.
REFIT = DescentSettings(initial_damping=1e-9, negligible_decrease=1e-5)


@dataclass(frozen=True)
class Sample:
    """Hold one bootstrap sample and the fit to it.

    Attributes
    ----------
    number : int
        Number of the sample, from 0; with the seed it determines what is drawn.
    counts : sequence of sequences of int
        How often each unit of each group was drawn.
    unknowns : sequence of float
        The optimiser's unknowns at the end of the refit.
    analyses : int
        Number of analyses of the tests that the refit took.
    status : str
        Why the descent ended.
    """

    number: int
    counts: Sequence[Sequence[int]]
    unknowns: Sequence[float]
    analyses: int
    status: str


@dataclass(frozen=True, eq=False)
class Bootstrap(Presented):
    """Hold the fits to bootstrap samples of a fit's data.

    Attributes
    ----------
    optimum : CardOptimum
        The optimum of the fit to all data.
    over : str
        What is resampled: "tests", "frames", "specimens", "directions" or "ratios".
    groups : sequence of ResamplingGroup
        Groups of units; from each group as many units are drawn as it has.
    samples : sequence of Sample
        The samples with their refits, by number.
    optimum_analyses : int
        Number of analyses that finding the optimum took, and one more in each process.
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
        """Return the number of analyses of the optimum and of all refits."""
        return self.optimum_analyses + sum(sample.analyses for sample in self.samples)

    @property
    def unfinished(self) -> int:
        """Return the number of samples that used up their analyses before they converged."""
        return sum(sample.status == ANALYSES_USED_UP for sample in self.samples)

    @property
    def strains(self) -> dict[str, Array]:
        """Return 21 strains for each modulus, from 0 to the largest that the tests reached."""
        valid = self.optimum.best.valid
        return {name: np.linspace(0.0, valid[c], 21) for name, c in COMPONENTS.items()}

    @cached_property
    def unknowns(self) -> Array:
        """Return the optimiser's unknowns of every sample: (samples, unknowns) array."""
        return np.array([sample.unknowns for sample in self.samples])

    @cached_property
    def moduli(self) -> dict[str, Array]:
        """Return each modulus of the samples, in MPa: (samples, 21) array along its strains."""
        unknowns = self.optimum.problem.unknowns
        samples = [moduli_of(unknowns, y, self.strains) for y in self.unknowns]
        return {name: np.array([moduli[name] for moduli in samples]) for name in COMPONENTS}

    @cached_property
    def bands(self) -> dict[str, Array]:
        """Return the ends of the 95 % band of each modulus over the samples: (2, 21), MPa."""
        ends = [(1 - LEVEL) / 2, (1 + LEVEL) / 2]
        return {name: np.quantile(moduli, ends, axis=0) for name, moduli in self.moduli.items()}

    @cached_property
    def optimum_moduli(self) -> dict[str, Array]:
        """Return each modulus of the fit to all data on the mesh of the fit: (21,), MPa."""
        return moduli_of(self.optimum.problem.unknowns, self.optimum.point.unknowns, self.strains)

    @cached_property
    def spread(self) -> dict[str, Array]:
        """Return the relative standard deviation of each modulus over the samples: (21,)."""
        return {
            name: moduli.std(axis=0, ddof=1) / self.optimum_moduli[name]
            for name, moduli in self.moduli.items()
        }

    @cached_property
    def of_fit(self) -> dict[str, ReportedModulus]:
        """Return each modulus along its strains as the fit reports it."""
        law = self.optimum.best.law
        certainty = self.optimum.certainty
        return {name: certainty.at(law, name, strain) for name, strain in self.strains.items()}

    @property
    def sigma(self) -> dict[str, tuple[float, float]]:
        """Return the relative 1 sigma of samples and fit by label, an RMS along the strain.

        That of samples is NaN where the data do not determine the modulus: refits then stay where
        they begin, which says nothing of other specimens.
        """
        sigmas = {}
        for name, label in modulus_labels(self.optimum.best.law.form).items():
            of_fit = self.optimum.certainty.moduli[name].rms_sigma
            is_determined = of_fit < LARGEST_SIGMA
            of_samples = np.sqrt(np.mean(self.spread[name] ** 2)) if is_determined else np.nan
            sigmas[label] = (float(of_samples), of_fit)
        return sigmas

    def coefficients(self) -> pd.DataFrame:
        """Return the scatter of the unknowns over the samples, and their correlations.

        Returns
        -------
        DataFrame
            One row per unknown of the fit (coefficients of the law in MPa): its name `unknown`; its
            `value` at the optimum of all data; its standard deviation `sigma` over the samples and
            `sigma_of_fit` from the noise; and a column for each unknown with the correlation.
        """
        unknowns = self.optimum.problem.unknowns
        posterior = self.optimum.posterior
        to_coefficients = np.eye(unknowns.count)
        to_coefficients[: unknowns.size, : unknowns.size] = unknowns.to_coefficients
        samples = self.unknowns @ to_coefficients.T
        sigma = samples.std(axis=0, ddof=1)
        # An unknown that lies on its bound in every sample scatters by rounding errors alone.
        sigma = np.where(sigma > 1e-9 * np.abs(samples).max(axis=0), sigma, 0.0)
        scaled = (samples - samples.mean(axis=0)) / np.where(sigma > 0, sigma, np.inf)
        correlation = scaled.T @ scaled / (len(samples) - 1)
        names = list(posterior.labels)
        table = pd.DataFrame(
            {
                "unknown": names,
                "value": to_coefficients @ self.optimum.point.unknowns,
                "sigma": sigma,
                "sigma_of_fit": np.sqrt(np.diag(posterior.coefficient_covariance)),
            }
        )
        return pd.concat([table, pd.DataFrame(correlation, columns=names)], axis=1)

    def table(self) -> pd.DataFrame:
        """Return the moduli along their strains, with the bands of the samples and of the fit.

        Returns
        -------
        DataFrame
            One row per modulus and strain: `modulus`, `strain`; `MPa`, the value of the fit to all
            data on its own mesh; `lower_MPa`, `upper_MPa`, `median_MPa` and `sigma_relative` over
            the samples; and what the fit reports, without its mesh error if it took that out:
            `fit_MPa`, `fit_lower_MPa`, `fit_upper_MPa`, `fit_sigma_relative`.
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
        """Return the notes of the optimum and warnings of too few units or samples."""
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
    def verdict(self) -> Verdict:
        """Return the scatter of the moduli, and whether there were enough units and samples."""
        scatter = [f"{name} {sigma_words(sigma)}" for name, (sigma, _) in self.sigma.items()]
        reasons = tuple(joined_lines(note for note in self.notes if note.kind is FEW_UNITS))
        verdict = Verdict(
            "usable within limits" if reasons else "usable",
            f"other {self.over} of this sort would move the moduli by {', '.join(scatter)} "
            "(1 sigma)",
            reasons,
            next_step=f"test more {self.over}, or draw more samples (--samples)" if reasons else "",
        )
        return verdict.of_study(self.optimum.fit_verdict)

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the study."""
        setup = self.optimum.setup
        return {
            "command": "bootstrap",
            "title": setup.project.title,
            "project": str(setup.project.path),
            "card": self.optimum.card,
            "tests": setup.test_names,
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
        }

    def result_lines(self) -> list[str]:
        """Return the results of the study as lines of the terminal."""
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
        return lines


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
    """Resample the data of a fit with replacement and refit every sample from the optimum.

    Parameters
    ----------
    project : Project
        The project of the fit.
    over : str
        What is resampled: whole "tests" (within each kind of test), or within each test its
        "frames", "specimens", "directions" or "ratios". A unit that is drawn twice counts twice in
        the objective.
    samples : int
        Number of samples, two or more; each is written to `out` as it ends.
    card, tests, out, overwrite, progress
        As in `profile`; `progress` receives the numbers of samples done and wanted.
    seed : int, optional
        Seed of the random draws; by default the project's.
    resume : bool
        Whether samples that the folder `out` has from an earlier run are reused.

    Returns
    -------
    Bootstrap

    Raises
    ------
    InputError, OutputError, SolverFailure
        As in `profile`; InputError also if no group has two units or more to draw from.
    """
    output = OutputSettings.of(out, resume, overwrite)
    check_has_law(project)
    project = project.with_fit(seed=seed)
    optimum = find_optimum(project, card, tests)
    groups = groups_of(optimum, over)
    folder = begin_study(output, {"over": over}, records=(SAMPLES,))
    unknowns = [f"{value:.6g}" for value in optimum.point.unknowns]
    depends = {**fingerprints(optimum.setup, optimum.problem), "over": over, "at": unknowns}
    record = StudyRecord(folder, SAMPLES, "samples", Sample, depends, resume)
    missing = [number for number in range(samples) if number not in record.rows]
    on_event = listener(progress)
    # Samples of an earlier run with more of them, which are kept but do not count.
    surplus = len(record.rows) + len(missing) - samples
    on_event(len(record.rows) - surplus, samples, "")
    prepare = functools.partial(SampleTask, optimum, groups, project.fit.seed)
    for _ in record.run(project, prepare, missing):
        on_event(len(record.rows) - surplus, samples, "")
    # Each process has run the analysis at the optimum once more.
    analyses = optimum.analyses + min(project.fit.jobs or cores(), len(missing))
    fits = [record.rows[number] for number in range(samples)]
    return finished(Bootstrap(optimum, over, groups, fits, analyses), out)


def groups_of(optimum: CardOptimum, over: str) -> list[ResamplingGroup]:
    """Return the groups of units to resample: each unit is exchanged within its group only.

    Whole tests are grouped by kind of test. Parts of a test are grouped by comparison where the
    parts share one (the specimens of one direction of strips), otherwise by test. Groups of a
    single unit are left out: their data count once in every sample.

    Parameters
    ----------
    optimum : CardOptimum
        The optimum of the fit, with its tests and residuals.
    over : str
        What is resampled, as in `bootstrap`.

    Returns
    -------
    list of ResamplingGroup

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
    """Return every test as one unit, by kind of test."""
    problem = optimum.problem
    numbers = {comparison.name: k for k, comparison in enumerate(problem.comparisons)}
    units: dict[str, list[ResamplingUnit]] = {}
    for prepared in optimum.setup.tests:
        is_of_test = np.zeros(len(problem.blocks.block_of), dtype=bool)
        for comparison in optimum.setup.comparisons_of(prepared):
            is_of_test[problem.rows(numbers[comparison.name])] = True
        unit = ResamplingUnit(prepared.test.name, is_of_test)
        units.setdefault(prepared.test.kind, []).append(unit)
    return units


def _parts_by_group(optimum: CardOptimum, over: str) -> dict[str, list[ResamplingUnit]]:
    """Return parts of tests as units, by the comparison whose data they divide, else by test."""
    units: dict[str, list[ResamplingUnit]] = {}
    for part in omittable_parts(optimum.setup, over, "--over"):
        masks = {name: mask for name, mask in part.alone.items() if mask.any()}
        divided = [name for name, mask in masks.items() if not mask.all()]
        group = divided[0] if divided else optimum.setup.tests[part.test].test.name
        unit = ResamplingUnit(part.name, rows_of(optimum.problem, masks))
        units.setdefault(group, []).append(unit)
    return units


class SampleTask:
    """Fit bootstrap samples in one process, which has a problem and a solver of its own.

    Parameters
    ----------
    optimum : CardOptimum
        The optimum of the fit to all data, where every refit begins.
    groups : sequence of ResamplingGroup
        What is resampled.
    seed : int
        Seed of the draws; that of a sample is the pair of it and the number of the sample.
    """

    def __init__(self, optimum: CardOptimum, groups: Sequence[ResamplingGroup], seed: int) -> None:
        self._groups = groups
        self._seed = seed
        self._tolerance = optimum.setup.project.fit.tolerance
        # Every refit begins with the analysis at the optimum.
        self._problem, self._point = optimum.run_again()

    def __call__(self, number: int, report: Callable[[Any], None]) -> Sample:
        """Draw the sample of this number and return the fit to it."""
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
