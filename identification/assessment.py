"""How good a fit is: moduli against a known solution, and what the data could not determine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..materials.forms.base import COMPONENTS, modulus_rows
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind
from .comparison import NoiseIs
from .correlation import alike_in
from .problem import Evaluation, FitProblem

Array = NDArray[np.float64]

POINTS = 61
#: A modulus less certain than this (1 sigma, relative) anywhere is said to be undetermined.
UNCERTAIN = 0.25
#: Relative uncertainty of a modulus of which nothing is known.
PRIOR = 10.0
#: Of the largest curvature of the misfit: below, the data say nothing of a direction.
FLAT = 1e-13
ON_BOUND = 1e-6
#: A residual of so many times the noise is no noise: that of many points is near once.
BEYOND_NOISE = 1.5


def moduli_error(law: HypoelasticLaw, known: HypoelasticLaw, reached: Array) -> dict[str, float]:
    """Largest relative error of each modulus up to the strains reached (3,)."""
    errors = {}
    for name, component in COMPONENTS.items():
        strain = np.linspace(0.0, reached[component], POINTS)
        errors[name] = float(
            np.max(np.abs(law.modulus(name, strain) / known.modulus(name, strain) - 1.0))
        )
    return errors


@dataclass(frozen=True)
class Misfit:
    """RMS residual of a comparison beside the noise of its data, both in `unit`s."""

    rms: float
    noise: float
    noise_is: NoiseIs
    unit: str

    @property
    def ratio(self) -> float:
        """How many times the noise is left."""
        return self.rms / self.noise if self.noise > 0 else np.inf


def misfits(problem: FitProblem, best: Evaluation) -> dict[str, Misfit]:
    """Of every comparison, by its name."""
    misfit, found = best.residual * problem.scale, {}
    for k, comparison in enumerate(problem.comparisons):
        rms = float(np.sqrt(np.mean(misfit[problem.rows(k)] ** 2)))
        own = comparison.objective
        found[comparison.name] = Misfit(
            rms, own.least_noise, getattr(own, "noise_is", "assumed"), own.unit
        )
    return found


def notes_of_misfits(found: Mapping[str, Misfit]) -> list[Note]:
    """Where more is left than the noise that the project gives."""
    return [
        Note(
            NoteKind.ABOVE_NOISE,
            f"the fit leaves {m.rms:.3g} {m.unit} RMS, {m.ratio:.3g} times the noise given "
            f"({m.noise:.3g} {m.unit}): model or data are off by more than noise, and the "
            "uncertainty reckons with what is left as if it were",
            name,
        )
        for name, m in found.items()
        if m.noise_is == "given" and m.ratio > BEYOND_NOISE
    ]


@dataclass(frozen=True, eq=False)
class Certainty:
    """1-sigma relative uncertainty of each modulus up to the strains reached, and plain words.

    noise : by comparison, in the unit of its data (mm, N); alike : by comparison, how many
    neighbouring values err as one. strain, sigma : (n,) by modulus.
    undetermined : what the data do not determine, and what lies on its bound. mesh : (n,) by
    modulus, by how much it would be another on ever finer meshes, relative; None where that is
    not known.
    """

    noise: dict[str, float]
    strain: dict[str, Array]
    sigma: dict[str, Array]
    undetermined: tuple[Note, ...]
    mesh: dict[str, Array] | None = None
    alike: dict[str, float] = field(default_factory=dict)

    @property
    def total(self) -> dict[str, Array]:
        """(n,) by modulus: noise and mesh together, as if the error of the mesh were a sigma."""
        if self.mesh is None:
            return dict(self.sigma)
        return {name: np.hypot(sigma, self.mesh[name]) for name, sigma in self.sigma.items()}


def certainty(
    problem: FitProblem, best: Evaluation, law: HypoelasticLaw, reached: Array
) -> Certainty:
    """Linear propagation of the noise of every comparison to the moduli.

    The noise is the RMS misfit, but not less than the objective's least noise: a misfit of zero
    (computed data) does not mean that a measurement would determine everything. Neighbours that
    err as one (`correlation.alike`) count as one; a misfit that is less than the noise does not
    tell them, and is taken for white.
    """
    assert best.jacobian is not None
    noise, together, sigma = _noise(problem, best)
    strains, sigmas = _along(problem, law, reached, _covariance(problem, best, sigma))
    first = problem.comparisons[0]
    which = f"at {noise[first.name]:.2g} {first.objective.unit} noise"
    if len(problem.comparisons) > 1:
        which = "with the tests' noise"
    words = [
        Note(
            NoteKind.UNCERTAIN,
            f"{name} is uncertain by up to {100 * relative.max():.0f} % (1 sigma {which}), "
            f"worst at strain {strains[name][relative.argmax()]:.3f}",
        )
        for name, relative in sigmas.items()
        if relative.max() > UNCERTAIN
    ]
    told = (*words, *_limited(problem, best))
    return Certainty(noise, strains, sigmas, told, alike=together)


def pinned_by(
    problem: FitProblem,
    best: Evaluation,
    law: HypoelasticLaw,
    reached: Array,
    numbers: Sequence[int],
) -> dict[str, Array]:
    """1-sigma relative uncertainty of each modulus from some comparisons alone, by their numbers.

    The best estimate that those would allow (weights do not count), beside hardly any knowledge
    before: each modulus at its control strains to 1000 % of its own size, and each nuisance to
    its prior, or to ten times the width of its bounds.
    """
    assert best.jacobian is not None
    _, _, sigma = _noise(problem, best)
    rows = np.concatenate([np.r_[problem.rows(k)] for k in numbers])
    j = best.jacobian[rows] / sigma[rows, None]
    before = PRIOR * _sizes(problem, best)
    for k, nuisance in enumerate(problem.unknowns.nuisance.all, start=problem.unknowns.size):
        if nuisance.prior is not None:
            before[k] = nuisance.prior
    covariance = np.linalg.inv(j.T @ j + np.diag(before**-2.0))
    return _along(problem, law, reached, covariance)[1]


def _sizes(problem: FitProblem, best: Evaluation) -> Array:
    """(unknowns,) what each is large or small beside: itself, or the width of its bounds."""
    lower, upper = problem.unknowns.nuisance.bounds
    law = np.abs(best.unknowns[: problem.unknowns.size])
    return np.concatenate([np.maximum(law, 1e-3), np.maximum(upper - lower, 1e-3)])


def _covariance(problem: FitProblem, best: Evaluation, sigma: Array) -> Array:
    """Of the unknowns, (n, n): the objective weighs the blocks, so that of the weighted estimate.

    A direction of which the data say nothing is as uncertain as a modulus of which nothing is
    known.
    """
    assert best.jacobian is not None
    sizes = _sizes(problem, best)
    j = best.jacobian * sizes
    curvature, directions = np.linalg.eigh(j.T @ j)
    good = curvature > FLAT * curvature[-1]
    sharp, flat = directions[:, good], directions[:, ~good]
    estimator = (sharp / curvature[good]) @ sharp.T @ j.T * sigma
    scaled = estimator @ estimator.T + PRIOR**2 * flat @ flat.T
    return np.asarray(scaled * sizes[:, None] * sizes)


def _noise(
    problem: FitProblem, best: Evaluation
) -> tuple[dict[str, float], dict[str, float], Array]:
    """Noise of each comparison in its unit, how many values err as one, and of each residual (m,)
    the noise that as many independent ones would have."""
    scale = problem.scale
    noise, together, sigma = {}, {}, np.empty_like(scale)
    for k, (name, misfit) in enumerate(misfits(problem, best).items()):
        rows = problem.rows(k)
        noise[name] = max(misfit.noise, misfit.rms)
        objective = problem.comparisons[k].objective
        together[name] = 1.0
        if misfit.rms > misfit.noise:
            together[name] = alike_in(objective, best.residual[rows])
        sigma[rows] = noise[name] * np.sqrt(together[name]) / scale[rows]
    known = [n for n in problem.unknowns.nuisance.all if n.prior is not None]
    if known:
        sigma[len(sigma) - len(known) :] = [n.weight for n in known]
    return noise, together, sigma


def _along(
    problem: FitProblem, law: HypoelasticLaw, reached: Array, covariance: Array
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Strains and 1-sigma relative uncertainty of each modulus, from that of the unknowns."""
    p = problem.unknowns
    moved = p.to_coefficients @ covariance[: p.size, : p.size] @ p.to_coefficients.T
    strains, sigmas = {}, {}
    for name, component in COMPONENTS.items():
        strain = np.linspace(0.0, reached[component], POINTS)
        rows = modulus_rows(p.form, name, strain, p.strain_range)[:, list(p.free)]
        sigma = np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", rows, moved, rows), 0.0))
        strains[name], sigmas[name] = strain, sigma / law.modulus(name, strain)
    return strains, sigmas


def _limited(problem: FitProblem, best: Evaluation) -> list[Note]:
    """Moduli on their margins or bounds, coefficients and nuisance on theirs."""
    p, notes = problem.unknowns, []
    for name, rows in p.moduli.items():
        moduli, least = rows @ best.coefficients, p.bounds.least[name]
        if (moduli - least <= ON_BOUND * max(least, 1.0)).any():
            words = f"{name} touches its positivity margin: the data ask for less stiffness"
            notes.append(Note(NoteKind.MARGIN, words))
        if p.bounds.largest is not None:
            most = p.bounds.largest[name]
            if (most - moduli <= ON_BOUND * most).any():
                words = f"{name} touches its upper bound: the data ask for more stiffness"
                notes.append(Note(NoteKind.BOUND, words))
    if p.bounds.largest is None:
        notes += _on_bounds(p.labels, best.coefficients, *p.box)
    return notes + _on_bounds(p.nuisance.names, best.unknowns[p.size :], *p.nuisance.bounds)


def _on_bounds(names: Sequence[str], values: Array, lower: Array, upper: Array) -> list[Note]:
    width = upper - lower
    low = values - lower <= ON_BOUND * width
    high = upper - values <= ON_BOUND * width
    return [
        Note(NoteKind.BOUND, f"{names[i]} lies on its {'lower' if low[i] else 'upper'} bound")
        for i in np.flatnonzero(low | high).tolist()
    ]
