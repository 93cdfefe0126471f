"""Assess a finished fit: uncertainty of its moduli, a wrong form of its law, warnings of both.

The uncertainty combines the noise of the data, the error of the mesh and second-order terms of the
fit. The form of law or model is tested by the discrepancy of each comparison.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..materials.forms.base import SHEAR, Array
from ..materials.forms.symmetry import modulus_labels
from ..materials.law import HypoelasticLaw, ThicknessChange
from ..meshes.bubble_model import BubbleModel
from ..notes import Note
from .comparison import run_tasks_of
from .discrepancy import (
    SMOOTH_DEGREE,
    Cause,
    Discrepancy,
    ModulusChange,
    has_enough_values,
    notes_of_discrepancies,
    ranked_causes,
    shape_count,
    sheet_discrepancy,
    smooth_shapes,
    specimen_discrepancy,
)
from .linear import (
    MESH_ERROR_LEFT,
    PRIOR,
    FineMeshLimit,
    SecondOrderTerms,
    UncertaintyOrder,
    posteriors_of,
    sizes_of,
)
from .noise import Noise
from .posterior import Posterior
from .problem import Evaluation, FitProblem
from .reported import (
    UNCERTAIN,
    ReportedModulus,
    moduli_sigmas,
    notes_of_bounds,
    relative_changes,
    reported_moduli,
    uncertain_words,
)
from .shear_valley import OPEN_SHEAR, OPEN_WORDS, ValleySearch, with_open_shear

#: Share of the strains at which G12 must be determined for one law to stand for all.
LEAST_DETERMINED = 0.5


@dataclass(frozen=True, eq=False)
class Certainty:
    """The uncertainty of each modulus up to the strains that the tests reached, with its sources.

    Attributes
    ----------
    noise : Noise
        The noise from which the uncertainty was computed.
    moduli : dict of ReportedModulus
        Band and standard deviation of each modulus ("E1", "E2", "G12"), from noise and mesh error.
    linear_sigma : dict of (n,) arrays
        Standard deviation of each modulus, relative to it, by the noise alone, to first order and
        without bounds.
    notes : tuple of Note
        Warnings: moduli that the data leave uncertain, unknowns on a bound, a wrong form of the
        law.
    mesh : dict of (n,) arrays, or None
        Relative change of each modulus from the mesh of the fit to the limit of ever finer meshes;
        None where it was not computed.
    posterior : Posterior
        Distribution of the unknowns about the best fit, from the noise alone.
    corrected : Posterior or None
        That about the limit of ever finer meshes, with the mesh error that may be left in it.
    taken_out : bool
        Whether the reported law is that limit, so that the mesh error is taken out of it.
    discrepancy : dict of Discrepancy
        What the fit leaves that noise does not explain, by the name of the comparison.
    second : SecondOrderTerms or None
        Second-order terms that were used; None where the uncertainty is of first order.
    order : UncertaintyOrder or None
        Which order was used and why; None where second-order terms were not looked at.
    """

    noise: Noise
    moduli: dict[str, ReportedModulus]
    linear_sigma: dict[str, Array]
    notes: tuple[Note, ...]
    mesh: dict[str, Array] | None
    posterior: Posterior
    corrected: Posterior | None
    taken_out: bool = False
    discrepancy: dict[str, Discrepancy] = field(default_factory=dict)
    second: SecondOrderTerms | None = None
    order: UncertaintyOrder | None = None

    @property
    def reported(self) -> Posterior:
        """Return the reported law's posterior: `corrected` where the mesh error is taken out."""
        return (self.corrected if self.taken_out else None) or self.posterior

    @property
    def strain(self) -> dict[str, Array]:
        """Return the strains (n,) of each modulus."""
        return {name: modulus.strain for name, modulus in self.moduli.items()}

    @property
    def sigma(self) -> dict[str, Array]:
        """Return (n,) by modulus, the reported standard deviation over the modulus."""
        return {name: modulus.sigma for name, modulus in self.moduli.items()}

    @property
    def noise_sigma(self) -> dict[str, Array]:
        """Return (n,) by modulus, the part of `sigma` that the noise makes.

        The squares of this part and of that of the mesh error add up to the square of `sigma`; they
        have the ratio that they have to first order.
        """
        if self.mesh is None:
            return self.sigma
        parts = {}
        for name, noise in self.linear_sigma.items():
            total = np.hypot(noise, self.of_mesh[name])
            parts[name] = self.sigma[name] * noise / np.where(total > 0, total, 1.0)
        return parts

    @property
    def of_mesh(self) -> dict[str, Array]:
        """Return (n,) by modulus, the relative mesh error of the reported law.

        It is the whole change to the limit of finer meshes, or, where that is taken out, the share
        `MESH_ERROR_LEFT` of it that may be left.
        """
        assert self.mesh is not None
        if not self.taken_out:
            return {name: np.abs(change) for name, change in self.mesh.items()}
        return {
            name: MESH_ERROR_LEFT * np.abs(change) / (1.0 + change)
            for name, change in self.mesh.items()
        }

    def at(self, law: HypoelasticLaw, name: str, strain: Array) -> ReportedModulus:
        """Return what is reported of a modulus of the law.

        Parameters
        ----------
        law : HypoelasticLaw
        name : str
            Name of the modulus.
        strain : (n,) array
            Log strains at which it is reported.
        """
        return self.moduli[name].at(strain, law.modulus(name, strain))


def certainty(
    problem: FitProblem,
    best: Evaluation,
    law: HypoelasticLaw,
    reached: Array,
    limit: FineMeshLimit | None = None,
    second: SecondOrderTerms | None = None,
    taken_out: bool = False,
    noise: Noise | None = None,
) -> Certainty:
    """Compute the uncertainty of the moduli of a fit, and the warnings that follow from it.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The optimum, with its Jacobian.
    law : HypoelasticLaw
        The law that is reported.
    reached : (3,) array
        Log strains (eps1, eps2, gamma12) up to which the moduli are reported.
    limit : FineMeshLimit, optional
        The fit in the limit of ever finer meshes, if known. The residual that remains there (or
        else that of the best fit) is the one that noise is taken from.
    second : SecondOrderTerms, optional
        Second-order terms of the fit; without them the noise is propagated linearly.
    taken_out : bool
        Whether `law` is that of the limit.
    noise : Noise, optional
        By default `Noise.from_residual` of that residual.
    """
    residual = best.residual if limit is None else limit.residual
    noise = noise or Noise.from_residual(problem, residual)
    posterior, fine = posteriors_of(problem, best, noise, limit, second)
    strains, linear_sigma = moduli_sigmas(problem.unknowns, law, reached, posterior.covariance)
    middle_strains = {name: _middle(strain) for name, strain in strains.items()}

    def modulus_change(step: Array) -> float:
        changes = relative_changes(problem.unknowns, best.unknowns, step, middle_strains)
        return max(float(np.abs(change).max()) for change in changes.values())

    mesh_doubt = 2 * MESH_ERROR_LEFT * (residual - best.residual)
    discrepancy = discrepancies(problem, residual, mesh_doubt, best, modulus_change)
    mesh = None
    if limit is not None:
        mesh = relative_changes(problem.unknowns, best.unknowns, limit.step, strains)
    moduli = reported_moduli(fine or posterior, law, strains)
    open_notes: list[Note] = []
    open_modulus = ""
    if problem.is_curved_in_shear and moduli[SHEAR].determined.mean() < LEAST_DETERMINED:
        open_modulus = SHEAR
        open_notes = [Note(OPEN_SHEAR, OPEN_WORDS)]
        search = ValleySearch(problem, best, noise, strains[SHEAR])
        posterior, fine = with_open_shear(posterior, fine, search, limit)
        moduli = reported_moduli(fine or posterior, law, strains)
    noise_words = _noise_words(problem, noise, limit is not None)
    uncertain = [
        uncertain_words(label, moduli[name], noise_words)
        for name, label in modulus_labels(problem.unknowns.form).items()
    ]
    notes = [
        *(Note(UNCERTAIN, words) for words in uncertain if words),
        *open_notes,
        *notes_of_bounds(problem, best, open_modulus),
        *notes_of_discrepancies(discrepancy, has_law=problem.unknowns.size > 0),
    ]
    return Certainty(
        noise,
        moduli,
        linear_sigma,
        tuple(notes),
        mesh,
        posterior,
        fine,
        taken_out and limit is not None,
        discrepancy,
        second,
    )


def _middle(strain: Array) -> Array:
    """Return the strain (1,) in the middle of strains (n,)."""
    return strain[[len(strain) // 2]]


def _noise_words(problem: FitProblem, noise: Noise, has_limit: bool) -> str:
    """Return what an uncertainty stems from, as a warning says it in brackets."""
    first = problem.comparisons[0]
    words = f"at {noise.level[first.name]:.2g} {first.objective.unit} noise"
    if len(problem.comparisons) > 1:
        words = "with the tests' noise"
    return f"{words} and the mesh" if has_limit else words


def moduli_from(
    problem: FitProblem,
    best: Evaluation,
    reported: Posterior,
    law: HypoelasticLaw,
    strains: Mapping[str, Array],
    numbers: Sequence[int],
    noise: Array,
) -> dict[str, ReportedModulus]:
    """Return each modulus with the uncertainty that it has from some of the comparisons alone.

    That is the uncertainty of the best linear estimate from these comparisons (whatever weights the
    fit gave them) within the bounds of the fit. Before the data, a modulus counts as known to
    1000 % of itself, a nuisance parameter to its prior or to ten times the width of its bounds.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        With its Jacobian.
    reported : Posterior
        That of the reported law; the estimate is taken to lie at its best.
    law : HypoelasticLaw
        The law that is reported.
    strains : dict of (n,) arrays
        Log strains at which each modulus is reported.
    numbers : sequence of int
        Indices in `problem.comparisons` of the comparisons that count.
    noise : (m,) array
        Standard deviation of every residual.
    """
    rows = np.concatenate([np.r_[problem.rows(k)] for k in numbers])
    covariance = covariance_from(problem, best, rows, noise)
    alone = Posterior(reported.unknowns, reported.best, reported.best, covariance)
    return reported_moduli(alone, law, strains)


def covariance_from(
    problem: FitProblem, best: Evaluation, rows: NDArray[np.intp], noise: Array
) -> Array:
    """Return the covariance (unknowns, unknowns) that some of the residuals alone leave.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        With its Jacobian.
    rows : (k,) array of int
        Indices of those residuals.
    noise : (m,) array
        Standard deviation of every residual.
    """
    assert best.jacobian is not None
    slopes = best.jacobian[rows] / noise[rows, None]
    prior_sigma = PRIOR * sizes_of(problem.unknowns, best.unknowns)
    for k, nuisance in enumerate(problem.unknowns.nuisance.all, start=problem.unknowns.size):
        if nuisance.prior is not None:
            prior_sigma[k] = nuisance.prior
    scaled = slopes * prior_sigma
    precision = scaled.T @ scaled + np.eye(len(prior_sigma))
    return np.linalg.inv(precision) * np.outer(prior_sigma, prior_sigma)


def residuals_by_quantity(problem: FitProblem) -> dict[str, NDArray[np.intp]]:
    """Return the indices of the residuals of each quantity of each comparison."""
    rows_of = {}
    for k, comparison in enumerate(problem.comparisons):
        rows = np.r_[problem.rows(k)]
        sizes = comparison.objective.sizes
        quantities = comparison.objective.quantities
        block_of_row = np.repeat(np.arange(len(sizes)), sizes)
        for i, quantity in enumerate(quantities):  # which successive blocks have again and again
            rows_of[f"{comparison.name}: {quantity}"] = rows[block_of_row % len(quantities) == i]
        if not quantities:
            rows_of[comparison.name] = rows
    return rows_of


def discrepancies(
    problem: FitProblem,
    residual: Array,
    mesh_doubt: Array,
    best: Evaluation,
    modulus_change: ModulusChange,
) -> dict[str, Discrepancy]:
    """Return the discrepancy of each comparison on a sheet or of several specimens, by its name.

    Parameters
    ----------
    problem : FitProblem
    residual : (m,) array
        Residual of the whole fit.
    mesh_doubt : (m,) array
        Part of the residual that the mesh may cause.
    best : Evaluation
        The optimum. Causes are looked for, and specimens tested, only if it has its Jacobian.
    modulus_change : callable
        See `discrepancy.ModulusChange`.
    """

    def discrepancy_of(number: int) -> Discrepancy | None:
        fitted = _FittedComparison(problem, number, residual, best, modulus_change)
        if fitted.objective.specimens is not None:
            discrepancy = fitted.specimen_discrepancy()
        else:
            discrepancy = fitted.sheet_discrepancy(mesh_doubt)
        measured = fitted.objective.measured
        if discrepancy is None or not measured.any():
            return discrepancy
        relative_rms = discrepancy.rms / float(np.sqrt(np.mean(measured**2)))
        return replace(discrepancy, relative_rms=relative_rms)

    comparisons = problem.comparisons
    by_number = run_tasks_of(comparisons, discrepancy_of, len(comparisons))
    return {
        comparison.name: discrepancy
        for comparison, discrepancy in zip(comparisons, by_number, strict=True)
        if discrepancy is not None
    }


@dataclass(eq=False)
class _FittedComparison:
    """A comparison of a fit; residual (n,) and slopes (n, unknowns) are in the unit of its data."""

    problem: FitProblem
    number: int
    residual: Array
    best: Evaluation
    modulus_change: ModulusChange

    def __post_init__(self) -> None:
        self.comparison = self.problem.comparisons[self.number]
        self.objective = self.comparison.objective
        self.rows = self.problem.rows(self.number)
        self.scale = self.problem.scale[self.rows]
        self.residual = self.residual[self.rows] * self.scale
        self.slopes = None
        if self.best.jacobian is not None:
            self.slopes = self.best.jacobian[self.rows] * self.scale[:, None]

    def sheet_discrepancy(self, mesh_doubt: Array) -> Discrepancy | None:
        """Return the discrepancy on a sheet; None for values that do not lie on one.

        Parameters
        ----------
        mesh_doubt : (m,) array
            Part of the residuals of all comparisons that the mesh may cause.
        """
        positions = self.objective.positions
        if not positions or positions[0].shape[1] != 2:
            return None
        discrepancy = sheet_discrepancy(
            self.objective.split(self.residual),
            self.objective.split(mesh_doubt[self.rows] * self.scale),
            positions,
            self.problem.unknowns.count,
            self.objective.unit,
        )
        if discrepancy is None:
            return None
        noise_of_mean = self.objective.least_noise / float(np.sqrt(len(self.scale)))
        discrepancy = replace(
            discrepancy, noise_of_mean=noise_of_mean, has_known_sheet=self._has_known_sheet()
        )
        if discrepancy.is_systematic:
            discrepancy = replace(discrepancy, causes=self._sheet_causes())
        return discrepancy

    def _has_known_sheet(self) -> bool:
        """Return whether the shape of the sheet without load is measured, or fitted by modes."""
        model = self.comparison.model
        if not isinstance(model, BubbleModel):
            return False
        return bool(model.modes) or bool(model.mesh.points[:, 2].any())

    def specimen_discrepancy(self) -> Discrepancy | None:
        """Return the discrepancy of specimens; None without derivatives."""
        specimen_of = self.objective.specimens
        if self.slopes is None or specimen_of is None:
            return None
        specimens = [np.flatnonzero(specimen_of == number) for number in np.unique(specimen_of)]
        order = np.concatenate(specimens)
        causes = {description: column[order] for description, column in self._causes().items()}
        positions = self.objective.positions[0][:, 0]
        return specimen_discrepancy(
            [self.residual[points] for points in specimens],
            [positions[points] for points in specimens],
            [self.slopes[points] for points in specimens],
            self.objective.unit,
            causes,
            self.modulus_change,
        )

    def _causes(self) -> dict[str, Array]:
        """Return the causes that the objective knows, (n, k) by description."""
        causes = self.objective.causes(self.best.histories[self.number])
        return {name: column * self.scale[:, None] for name, column in causes.items()}

    def _sheet_causes(self) -> tuple[Cause, ...]:
        """Return the causes of a discrepancy on a sheet, from amplitudes of smooth shapes."""
        if self.slopes is None:
            return ()
        causes = {**self._causes(), **self._other_thickness(), **self._outlying_points()}
        columns = np.column_stack([self.residual, self.slopes, *causes.values()])
        blocks = self.objective.split(columns)
        amplitudes = []
        for block, positions in zip(blocks, self.objective.positions, strict=True):
            if has_enough_values(block):
                shapes = smooth_shapes(positions)[:, : shape_count(SMOOTH_DEGREE)]
                amplitudes.append(shapes.T @ block)
        widths = [1, self.slopes.shape[1], *(column.shape[1] for column in causes.values())]
        parts = np.split(np.concatenate(amplitudes), np.cumsum(widths)[:-1], axis=1)
        residual, slopes, *cause_parts = parts
        causes = dict(zip(causes, cause_parts, strict=True))
        return ranked_causes(residual[:, 0], slopes, causes, self.modulus_change)

    def _outlying_points(self, *, deviations: float = 12.0) -> dict[str, Array]:
        """Return values far from all others of their block as a possible cause.

        The result maps its description to the change (n, 1) of the residual without them; it is
        empty where none is so far off.

        Parameters
        ----------
        deviations : float
            Limit of the distance from the median of the block, in median absolute deviations.
        """
        change = np.zeros_like(self.residual)
        ends = np.cumsum(self.objective.sizes)
        for end, size in zip(ends, self.objective.sizes, strict=True):
            block = self.residual[end - size : end]
            distance = np.abs(block - np.median(block))
            is_outlying = distance > deviations * np.median(distance)
            change[end - size : end] = -block * is_outlying
        count = int(np.count_nonzero(change))
        if not count:
            return {}
        remedy = "bubblefit check; leave such points out: flag_column"
        return {f"{{:.0%}} of {count} values far off all others ({remedy})": change[:, None]}

    def _other_thickness(self) -> dict[str, Array]:
        """Return the other thickness option as a possible cause, by a run with it.

        The result maps its description to the change (n, 1) of the residual; it is empty for an
        external solver, or if the run fails.
        """
        if self.problem.solver.external:
            return {}
        unknowns = self.problem.unknowns
        law = unknowns.law(self.problem.law, self.best.unknowns)
        is_constant = law.thickness_change == "constant"
        option: ThicknessChange = "incompressible" if is_constant else "constant"
        other_law = replace(law, thickness_change=option)
        nuisance = unknowns.nuisance_values(self.comparison.name, self.best.unknowns)
        try:
            history = self.comparison.run(other_law, unknowns.free, nuisance, warm=True)
        except (InputError, SolverFailure):
            return {}
        residual = self.objective.residual(history, nuisance)
        change = residual - self.objective.residual(self.best.histories[self.number], nuisance)
        description = f'thickness_change = "{option}", {{:.0%}} of its effect'
        return {description: (change * self.scale)[:, None]}
