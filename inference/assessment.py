"""Assess a fit: moduli against a known solution, uncertainty, and what lies on a bound."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..materials.forms.base import COMPONENTS, Array
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, Objection
from ..wording import percent
from .comparison import Nuisance
from .discrepancy import Discrepancy, notes_of_discrepancies
from .linear import (
    LEFT,
    POINTS,
    PRIOR,
    FineMeshLimit,
    SecondOrderTerms,
    UncertaintyOrder,
    moduli_sigmas,
    posteriors_of,
    relative_changes,
    sizes_of,
)
from .noise import Noise
from .posterior import Posterior
from .problem import Evaluation, FitProblem
from .reported import ReportedModulus, reported_moduli
from .wrong_form import discrepancies

UNCERTAIN = NoteKind("uncertain", weight=6)
BOUNDS_REACHED = Objection(
    "bounds are reached",
    "widen the bounds that are reached, or add a test that determines what lies on them",
)
MARGIN = NoteKind("on its margin", weight=17, objection=BOUNDS_REACHED)
BOUND = NoteKind("on a bound", weight=18, objection=BOUNDS_REACHED)

#: 1 sigma, relative, of a modulus anywhere, beyond which a note says that it is uncertain.
NOTED_SIGMA = 0.25
ON_BOUND = 1e-6


def moduli_error(
    law: HypoelasticLaw, known: HypoelasticLaw, reached: Array, points: int = POINTS
) -> dict[str, float]:
    """Return the largest relative error of each modulus up to the strains reached (3,)."""
    errors = {}
    for name, component in COMPONENTS.items():
        strain = np.linspace(0.0, reached[component], points)
        errors[name] = float(
            np.max(np.abs(law.modulus(name, strain) / known.modulus(name, strain) - 1.0))
        )
    return errors


@dataclass(frozen=True, eq=False)
class Certainty:
    """The uncertainty of each modulus up to the strains reached, and notes on it.

    Attributes
    ----------
    noise : Noise
    moduli : dict of ReportedModulus
        What is reported of each, noise and mesh error together.
    linear_sigma : dict of (n,) arrays
        Relative standard deviation by the noise alone, to first order and without bounds.
    undetermined : tuple of Note
    mesh : dict of (n,) arrays, or None
        Relative change of each modulus on ever finer meshes; None where it is not known.
    posterior : Posterior
        From the noise alone.
    fine : Posterior or None
        Of ever finer meshes, with the error that may be left.
    taken_out : bool
        Whether the reported law is that of ever finer meshes.
    discrepancy : dict of Discrepancy
    second, order
        None where the certainty is of first order.
    """

    noise: Noise
    moduli: dict[str, ReportedModulus]
    linear_sigma: dict[str, Array]
    undetermined: tuple[Note, ...]
    mesh: dict[str, Array] | None
    posterior: Posterior
    fine: Posterior | None
    taken_out: bool = False
    discrepancy: dict[str, Discrepancy] = field(default_factory=dict)
    second: SecondOrderTerms | None = None
    order: UncertaintyOrder | None = None

    @property
    def reported(self) -> Posterior:
        """Return the posterior of the reported law: `fine` where the mesh error is taken out."""
        return (self.fine if self.taken_out else None) or self.posterior

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
        """Return (n,) by modulus, the part of `sigma` that is of the noise.

        The squares of this part and of that of the mesh error add up to the square of `sigma`; they
        have the ratio that they have to first order.
        """
        if self.mesh is None:
            return self.sigma
        parts = {}
        for name, noise in self.linear_sigma.items():
            both = np.hypot(noise, self.of_mesh[name])
            parts[name] = self.sigma[name] * noise / np.where(both > 0, both, 1.0)
        return parts

    @property
    def of_mesh(self) -> dict[str, Array]:
        """Return (n,) by modulus, the mesh error that the reported law has, or may have, in it."""
        assert self.mesh is not None
        if not self.taken_out:
            return {name: np.abs(off) for name, off in self.mesh.items()}
        return {name: LEFT * np.abs(off) / (1.0 + off) for name, off in self.mesh.items()}

    def at(self, law: HypoelasticLaw, name: str, strain: Array) -> ReportedModulus:
        """Return what is reported of a modulus of the law at strains (n,)."""
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
    """Propagate the noise of every comparison linearly to the moduli.
    law : the reported one. limit : of ever finer models, where known: its residual counts as noise
    (see `Noise.from_residual`), else that of the best fit. second : terms of second order (see
    `LinearisedFit.of`).
    """
    left = best.residual if limit is None else limit.residual
    noise = noise or Noise.from_residual(problem, left)
    posterior, fine = posteriors_of(problem, best, noise, limit, second)
    strains, sigmas = moduli_sigmas(problem.unknowns, law, reached, posterior.covariance)
    first = problem.comparisons[0]
    which = f"at {noise.level[first.name]:.2g} {first.objective.unit} noise"
    if len(problem.comparisons) > 1:
        which = "with the tests' noise"
    if limit is not None:
        which += " and the mesh"

    def effect(step: Array) -> float:
        """Return the largest relative change of a modulus halfway along its strains."""
        some = {name: at[len(at) // 2 : len(at) // 2 + 1] for name, at in strains.items()}
        changes = relative_changes(problem.unknowns, best.unknowns, step, some)
        return max(float(np.abs(change).max()) for change in changes.values())

    wrong = discrepancies(problem, left, 2 * LEFT * (left - best.residual), best, effect)
    mesh = None
    if limit is not None:
        mesh = relative_changes(problem.unknowns, best.unknowns, limit.step, strains)
    moduli = reported_moduli(fine or posterior, law, strains)
    sure = Certainty(
        noise,
        moduli,
        sigmas,
        (),
        mesh,
        posterior,
        fine,
        taken_out and limit is not None,
        discrepancy=wrong,
        second=second,
    )
    words = [uncertain_words(name, modulus, which) for name, modulus in moduli.items()]
    uncertain = (Note(UNCERTAIN, line) for line in words if line)
    notes = (*uncertain, *_limited(problem, best), *notes_of_discrepancies(wrong))
    return replace(sure, undetermined=notes)


def uncertain_words(name: str, modulus: ReportedModulus, which: str) -> str:
    """Return where a modulus is not determined, or how uncertain it is; "" where hardly."""
    strain = modulus.strain
    lost = strain[~modulus.determined]
    if len(lost):
        span = f"between {100 * lost[0]:.3g} and {100 * lost[-1]:.3g} % of strain"
        where = "at any strain" if len(lost) == len(strain) else span
        return f"{name} is not determined {where} ({which})"
    worst = int(modulus.sigma.argmax())
    if modulus.sigma[worst] <= NOTED_SIGMA:
        return ""
    return (
        f"{name} is uncertain by up to {percent(modulus.sigma[worst])} (1 sigma {which}), "
        f"worst at {100 * strain[worst]:.3g} % of strain"
    )


def moduli_from(
    problem: FitProblem,
    best: Evaluation,
    reported: Posterior,
    law: HypoelasticLaw,
    strains: Mapping[str, Array],
    numbers: Sequence[int],
    noise: Array,
) -> dict[str, ReportedModulus]:
    """Return what some comparisons, by number, alone determine of each modulus.

    It is the best estimate that those allow (weights do not count) within the bounds of the fit,
    with each modulus known before to 1000 % of itself, each nuisance to its prior or ten times the
    width of its bounds.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        With its Jacobian.
    reported : Posterior
        Of the reported law, about which the estimate lies.
    law : HypoelasticLaw
        The reported one.
    strains : dict of (n,) arrays
        By modulus.
    numbers : sequence of int
    noise : (m,) array
        Standard deviation of every residual.
    """
    assert best.jacobian is not None
    rows = np.concatenate([np.r_[problem.rows(k)] for k in numbers])
    j = best.jacobian[rows] / noise[rows, None]
    before = PRIOR * sizes_of(problem.unknowns, best.unknowns)
    for k, nuisance in enumerate(problem.unknowns.nuisance.all, start=problem.unknowns.size):
        if nuisance.prior is not None:
            before[k] = nuisance.prior
    scaled = j * before
    covariance = np.linalg.inv(scaled.T @ scaled + np.eye(len(before))) * np.outer(before, before)
    alone = Posterior(reported.unknowns, reported.best, reported.best, covariance)
    return reported_moduli(alone, law, strains)


def _limited(problem: FitProblem, best: Evaluation) -> list[Note]:
    p = problem.unknowns
    notes = []
    for name, rows in p.moduli.items():
        moduli = rows @ best.coefficients
        least = p.bounds.smallest[name]
        if (moduli - least <= ON_BOUND * max(least, 1.0)).any():
            words = f"{name} touches its positivity margin: the data ask for less stiffness"
            notes.append(Note(MARGIN, words))
        most = np.inf if p.bounds.largest is None else p.bounds.largest[name]
        if (most - moduli <= ON_BOUND * most).any() and most < np.inf:
            words = f"{name} touches its upper bound: the data ask for more stiffness"
            notes.append(Note(BOUND, words))
    if p.bounds.largest is None:
        notes += _on_bounds(p.labels, best.coefficients, *p.box)
    return notes + _on_bounds(p.nuisance.names, best.unknowns[p.size :], *p.nuisance.bounds)


def _on_bounds(names: Sequence[str], values: Array, lower: Array, upper: Array) -> list[Note]:
    low, high = (away <= ON_BOUND * (upper - lower) for away in (values - lower, upper - values))
    return [
        Note(BOUND, f"{names[i]} lies on its {'lower' if low[i] else 'upper'} bound")
        for i in np.flatnonzero(low | high).tolist()
    ]


#: Of the width of the bounds: as uncertain as a number that may be anywhere between them.
ANYWHERE = 12**-0.5
AS_BEFORE = 0.9  # of a prior: the data add next to nothing to it
CORRELATED = 0.5  # correlations that are worth saying


@dataclass(frozen=True, kw_only=True)
class NuisanceVerdict(Nuisance):
    """An unknown beside the moduli with its uncertainty, named with its comparison among several.
    correlation : with each modulus in the middle of its strains."""

    value: float
    sigma: float
    correlation: dict[str, float]

    @property
    def on(self) -> str:
        """Return the bound that it lies on ("lower", "upper"), "" for none."""
        room = ON_BOUND * (self.upper - self.lower)
        if self.value - self.lower <= room:
            return "lower"
        return "upper" if self.upper - self.value <= room else ""

    @property
    def determined(self) -> bool:
        """Return whether the data say anything of it."""
        if self.prior is not None:
            return self.sigma < AS_BEFORE * self.prior
        return self.sigma < ANYWHERE * (self.upper - self.lower)

    @property
    def words(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        value = f"{self.value:.4g}{unit}" + (f", on its {self.on} bound" if self.on else "")
        if self.determined:
            name, rho = max(self.correlation.items(), key=lambda item: abs(item[1]))
            beside = "" if abs(rho) < CORRELATED else f", correlation {rho:.2f} with {name}"
            return f"{value}, 1 sigma {self.sigma:.2g}{unit}{beside}"
        known = f"it may be {self.lower:.4g} to {self.upper:.4g}{unit}"
        if self.prior is not None:
            known = f"known to {self.prior:.2g}{unit} before"
        hint = f"; {self.hint}" if self.hint else ""
        return f"{value}: the data say nothing of it ({known}){hint}"

    @property
    def numbers(self) -> dict[str, Any]:
        return {
            "value": self.value,
            "unit": self.unit,
            "sigma": self.sigma,
            "bounds": [self.lower, self.upper],
            "prior": self.prior,
            "on_bound": self.on or None,
            "determined": self.determined,
            "correlation": self.correlation,
            "verdict": self.words,
        }


def verdicts(posterior: Posterior, ends: Array) -> tuple[NuisanceVerdict, ...]:
    """Return a verdict for each unknown beside the moduli.
    ends : (3,) strains (eps1, eps2, gamma12) to which the moduli are known."""
    unknowns = posterior.unknowns
    covariance = posterior.covariance
    size = unknowns.size
    middle = 0.5 * np.asarray(ends, dtype=float)
    slopes = {
        name: unknowns.rows(name, middle[[c]])[0] @ unknowns.to_coefficients
        for name, c in COMPONENTS.items()
    }
    of_law = covariance[:size, :size]
    spread = {m: float(np.sqrt(slope @ of_law @ slope)) for m, slope in slopes.items()}
    found = []
    pairs = zip(unknowns.nuisance.names, unknowns.nuisance.all, strict=True)
    for k, (name, one) in enumerate(pairs, start=size):
        sigma = float(np.sqrt(covariance[k, k]))
        value = float(posterior.best[k])
        correlation = {
            modulus: float(slope @ covariance[:size, k]) / max(sigma * spread[modulus], 1e-300)
            for modulus, slope in slopes.items()
        }
        own = {**vars(one), "name": name, "correlation": correlation}
        found.append(NuisanceVerdict(**own, value=value, sigma=sigma))
    return tuple(found)


def notes_of_verdicts(found: tuple[NuisanceVerdict, ...]) -> list[Note]:
    """Return notes on unknowns that the data do not determine."""
    return [
        Note(UNCERTAIN, f"{verdict.name} is {verdict.words}")
        for verdict in found
        if not verdict.determined and (verdict.shared or verdict.prior is None)
    ]
