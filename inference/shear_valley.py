"""Laws along the valleys of data that leave the shear modulus, or warp and fill, open.

Heights of a few gauges hardly tell G12, on which E1 and E2 depend along a curved valley: no normal
distribution about one law describes it. A law is therefore fitted at each of some values of G12
between its bounds. The logarithm of G12 counts as evenly distributed but for the misfit of these
laws, about each of which the other unknowns are normal within their bounds. Laws between are
interpolated, so that they keep all bounds, too.

Heights at the centre of a circular sheet do not tell warp from fill either. Their laws lie in
several such valleys, each with another E2, and as often with warp and fill exchanged. All have
about the curve of one balanced law, E1 = E2, which is therefore the one stiffness that such data
tell. Its modulus is the geometric mean of E1 and E2 within 2 %, if E1 is up to 2.5 times E2; at 4
times it is 11 % above. (With a given nu12, warp and fill are exchanged with slightly different
moduli.) It falls with G12, by 3 % where this is an eighth of E, 12 % at two thirds.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
import scipy

from ..materials.forms.base import SHEAR, Array
from ..notes import Note, NoteKind, Objection
from .descent import bounded_step
from .linear import MESH_ERROR_LEFT, PRIOR, FineMeshLimit
from .noise import Noise
from .posterior import DRAWS, Posterior
from .problem import Evaluation, FitProblem
from .reported import ReportedModulus
from .unknowns import Unknowns

OPEN_SHEAR = NoteKind(
    "open shear modulus",
    weight=18.2,
    objection=Objection(
        "these data do not determine G12",
        "add a strip at 45 degrees (bias), which shears the sheet, or fields of a camera",
    ),
)
OPEN_WORDS = (
    "these data do not determine G12, and wider bounds would not: the bands of E1 and E2 hold for "
    "any G12 within its bounds; a strip at 45 degrees (bias) would determine it"
)
#: Rows and values of rows @ y = values.
Equations: TypeAlias = tuple[Array, Array]


@dataclass(frozen=True)
class ShearSearch:
    """Settings of the search for laws, each with a shear modulus of its own."""

    shear_moduli: int = 5  # evenly spaced logarithms between the bounds of G12
    fill_moduli: int = 3  # likewise, from the lower bound of E2 to the balanced law, without it
    least_laws: int = 3  # a sheet that is too soft in shear may have no equilibrium
    max_steps: int = 8  # of Gauss and Newton, for each
    damping: float = 1e-2  # of the squares of steps of the unknowns, which are of the order of one
    converged: float = 1e-4  # largest last step of an unknown
    equality: float = 1e8  # weight of a squared difference of moduli over their size


SEARCH = ShearSearch()


@dataclass(frozen=True, eq=False)
class ShearLaw:
    """The law of one shear modulus that fits best.

    Attributes
    ----------
    shear_modulus : float, MPa
    misfit : float
        Sum of squares of the residuals over their noise.
    posterior : Posterior
        The distribution of the unknowns about it.
    """

    shear_modulus: float
    misfit: float
    posterior: Posterior


@dataclass(frozen=True, eq=False)
class Valley:
    """Laws in the order of their shear moduli, and those between.

    Attributes
    ----------
    laws : tuple of ShearLaw
    """

    laws: tuple[ShearLaw, ...]

    @cached_property
    def _weighted_places(self) -> tuple[Array, Array]:
        """Return places between the laws, counted from the first, and their likelihoods."""
        logarithms = np.log([law.shear_modulus for law in self.laws])
        between = np.linspace(logarithms[0], logarithms[-1], DRAWS)
        places = np.interp(between, logarithms, np.arange(len(self.laws)))
        misfits = [law.misfit for law in self.laws]
        excess = np.interp(between, logarithms, misfits) - min(misfits)
        return places, np.exp(-0.5 * excess)

    @property
    def log_likelihood(self) -> float:
        """Return the logarithm of the mean likelihood of its laws."""
        return float(np.log(self._weighted_places[1].mean())) - 0.5 * min(
            law.misfit for law in self.laws
        )

    def draws(self, count: int, random: np.random.Generator, *, between: bool = True) -> Array:
        """Return draws of the unknowns.

        Parameters
        ----------
        count : int
        random : Generator
        between : bool
            Whether laws between those of the valley are drawn, too.

        Returns
        -------
        (count, n) array
        """
        places, likelihoods = self._weighted_places
        place = random.choice(places, count, p=likelihoods / likelihoods.sum())
        if not between:
            place = place.round()
        seed = int(random.integers(2**31))  # the same, so that neighbours deviate alike
        of_laws = np.stack(
            [law.posterior.sample(count, np.random.default_rng(seed)) for law in self.laws]
        )
        first = np.minimum(place.astype(int), len(self.laws) - 2)
        share = (place - first)[:, None]
        rows = np.arange(count)
        return np.asarray((1.0 - share) * of_laws[first, rows] + share * of_laws[first + 1, rows])

    def shifted(self, step: Array) -> Valley:
        """Return the valley of finer meshes, with the uncertainty of the step (n,) to them."""
        laws = []
        for law in self.laws:
            best = law.posterior.best
            fine = law.posterior.shifted(step, best + step, MESH_ERROR_LEFT)
            laws.append(replace(law, posterior=replace(fine, best=best)))
        return Valley(tuple(laws))


@dataclass(frozen=True, eq=False)
class OpenPosterior(Posterior):
    """The distribution of the unknowns where the data leave the shear modulus open.

    The covariance is that about the best fit alone.

    Attributes
    ----------
    valleys : tuple of Valley
    is_exchangeable : bool
        Whether laws with warp and fill exchanged are as probable: every other draw is such.
    """

    valleys: tuple[Valley, ...] = ()
    is_exchangeable: bool = False

    @classmethod
    def of(
        cls, about: Posterior, valleys: Iterable[Valley], is_exchangeable: bool
    ) -> OpenPosterior:
        """Return that whose best fit is that of another posterior."""
        return cls(
            about.unknowns,
            about.best,
            about.centre,
            about.covariance,
            tuple(valleys),
            is_exchangeable,
        )

    def sample(self, count: int, random: np.random.Generator) -> Array:
        return self._sample(count, random, True)

    @property
    def law_draws(self) -> Array:
        return self._reported_draws[:, : self.unknowns.size]

    def modulus_samples(self, name: str, strain: Array) -> Array:
        draws = self._reported_draws
        if name == SHEAR:  # from its least to its largest value, where both fit
            draws = self._sample(DRAWS, np.random.default_rng(0), False)
        return np.asarray(draws @ self.unknowns.modulus_rows(name, strain).T)

    @cached_property
    def _reported_draws(self) -> Array:
        """Return `DRAWS` draws of all unknowns, always the same ones."""
        return self.sample(DRAWS, np.random.default_rng(0))

    def _sample(self, count: int, random: np.random.Generator, between: bool) -> Array:
        """Return draws (count, n) of all unknowns."""
        likelihoods = np.array([valley.log_likelihood for valley in self.valleys])
        chances = np.exp(likelihoods - likelihoods.max())
        valley_of = random.choice(len(self.valleys), count, p=chances / chances.sum())
        of_valleys = [valley.draws(count, random, between=between) for valley in self.valleys]
        draws = np.stack(of_valleys)[valley_of, np.arange(count)]
        if self.is_exchangeable:
            draws[::2] = _exchanged(self.unknowns, draws[::2])
        return draws


def _exchanged(unknowns: Unknowns, draws: Array) -> Array:
    """Return draws (k, n) of the unknowns with warp and fill exchanged."""
    names = np.array(unknowns.form.modulus_of)
    warp, fill = np.flatnonzero(names == "E1"), np.flatnonzero(names == "E2")
    to_coefficients = unknowns.to_coefficients
    coefficients = draws[:, : unknowns.size] @ to_coefficients.T
    coefficients[:, [*warp, *fill]] = coefficients[:, [*fill, *warp]]
    exchanged = draws.copy()
    exchanged[:, : unknowns.size] = np.linalg.solve(to_coefficients, coefficients.T).T
    return exchanged


@dataclass(frozen=True, eq=False)
class ValleySearch:
    """The search for the laws that fit best, one for each shear modulus.

    Attributes
    ----------
    problem : FitProblem
    best : Evaluation
        The best fit, from which the search starts.
    noise : Noise
        Of the residuals.
    strain : (k,) array
        Log strains along which moduli are equal or constant.
    """

    problem: FitProblem
    best: Evaluation
    noise: Noise
    strain: Array

    def valley(self, *equations: Equations) -> Valley | None:
        """Return laws of shear moduli between their bounds; None where too many fail.

        Parameters
        ----------
        *equations : (rows, values)
            Demanded of the unknowns, rows @ y = values: `balance`, or a `constant` modulus.
        """
        y = self.best.unknowns
        smallest, largest = self._limits(SHEAR)
        laws = []
        for shear_modulus in np.geomspace(
            max(smallest, 1e-3 * largest), largest, SEARCH.shear_moduli
        ):
            constant = self.constant(SHEAR, shear_modulus)
            rows, values = map(np.concatenate, zip(constant, *equations, strict=True))
            fit = self._fit(y, rows, values)
            if fit is not None:
                y, misfit, covariance = fit
                posterior = Posterior(self.problem.unknowns, y, y, covariance)
                laws.append(ShearLaw(float(shear_modulus), misfit, posterior))
        return Valley(tuple(laws)) if len(laws) >= SEARCH.least_laws else None

    def valleys(self) -> list[Valley]:
        """Return the valleys of the data; none where analyses fail."""
        if not self.problem.is_exchangeable:
            valleys = [self.valley()]
        else:
            balanced = self.valley(self.balance())
            if balanced is None:
                return []
            rows = self.problem.unknowns.modulus_rows("E2", self.strain[:1])
            modulus = max(float((rows @ law.posterior.best)[0]) for law in balanced.laws)
            fill_moduli = np.geomspace(self._limits("E2")[0], modulus, SEARCH.fill_moduli + 1)
            valleys = [self.valley(self.constant("E2", m)) for m in fill_moduli[:-1]]
            valleys.append(balanced)
        return [valley for valley in valleys if valley is not None]

    def _limits(self, name: str) -> list[float]:
        """Return the least and the largest modulus without strain, MPa, that bounds allow."""
        unknowns = self.problem.unknowns
        return [float(unknowns.modulus_limits(name, np.zeros(1), sign)[0]) for sign in (-1.0, 1.0)]

    def constant(self, name: str, modulus: float) -> Equations:
        """Return the equations by which a modulus has one value (MPa) along its strain."""
        rows = self.problem.unknowns.modulus_rows(name, self.strain) / modulus
        return rows, np.ones(len(rows))

    def balance(self) -> Equations:
        """Return the equations by which E1 = E2."""
        warp, fill = (self.problem.unknowns.modulus_rows(n, self.strain) for n in ("E1", "E2"))
        rows = (warp - fill) / (warp @ self.best.unknowns).mean()
        return rows, np.zeros(len(rows))

    def _fit(self, y: Array, equations: Array, values: Array) -> tuple[Array, float, Array] | None:
        """Return the best unknowns with these equations, misfit and covariance; None if it fails.

        Parameters
        ----------
        y : (unknowns,) array
            Unknowns where the fit begins.
        equations, values : (k, unknowns) and (k,) arrays
            Of equations @ y = values.
        """
        equality = SEARCH.equality * equations.T @ equations
        y = y + np.linalg.lstsq(equations, values - equations @ y, rcond=1e-9)[0]
        for _ in range(SEARCH.max_steps):
            evaluation = self.problem.evaluate(y, True)
            if evaluation is None or evaluation.jacobian is None:
                return None
            shifted = evaluation.residual + self._shift
            residual, slopes = self._independent(shifted, evaluation.jacobian)
            hessian = slopes.T @ slopes + SEARCH.damping * np.eye(len(y)) + equality
            step = bounded_step(self.problem.unknowns, hessian, slopes.T @ residual, y)
            if step is None:
                return None
            y = y + step
            if np.abs(step).max() < SEARCH.converged:
                break
        basis = scipy.linalg.null_space(equations, rcond=1e-9)
        along = slopes @ basis
        precision = along.T @ along + np.eye(basis.shape[1]) / PRIOR**2
        return y, float(residual @ residual), basis @ np.linalg.inv(precision) @ basis.T

    @cached_property
    def _shift(self) -> Array:
        """Return the residual (m,) of the best fit, by another solver, less that of the problem."""
        evaluation = self.problem.evaluate(self.best.unknowns, False)
        if evaluation is None:
            return np.zeros_like(self.best.residual)
        return self.best.residual - evaluation.residual

    def _independent(self, residual: Array, jacobian: Array) -> tuple[Array, Array]:
        """Return residuals and derivatives in units of their noise, without errors they share."""
        sigma = self.noise.residual_sigma[:, None]
        columns = np.column_stack([residual, jacobian]) / sigma
        directions, sizes = self.noise.shared.principal(sigma[:, 0])
        factors = 1.0 / np.sqrt(1.0 + sizes**2) - 1.0
        columns = columns + directions @ (factors[:, None] * (directions.T @ columns))
        return columns[:, 0], columns[:, 1:]


def with_open_shear(
    posterior: Posterior, fine: Posterior | None, search: ValleySearch, limit: FineMeshLimit | None
) -> tuple[Posterior, Posterior | None]:
    """Return posteriors over all G12 and what depends on it; the same ones where analyses fail.

    Parameters
    ----------
    posterior : Posterior
        That from the noise alone.
    fine : Posterior or None
        That about the limit of ever finer meshes.
    search : ValleySearch
    limit : FineMeshLimit or None
    """
    valleys = search.valleys()
    if not valleys:
        return posterior, fine
    is_exchangeable = search.problem.is_exchangeable
    opened = OpenPosterior.of(posterior, valleys, is_exchangeable)
    if fine is None or limit is None:
        return opened, fine
    shifted = [valley.shifted(limit.step) for valley in valleys]
    return opened, OpenPosterior.of(fine, shifted, is_exchangeable)


ONE_STIFFNESS = NoteKind(
    "one stiffness",
    weight=18.5,
    objection=Objection(
        "heights at the centre of a circular sheet tell one stiffness, and not warp from fill",
        "add gauges off the apex along warp and fill, strips, or an elliptic rim (bubblefit plan "
        'ranks them), or fit a law of E1 = E2: [law] symmetry = "balanced"',
        unusable=True,
    ),
)


def balanced_modulus(
    problem: FitProblem, best: Evaluation, noise: Noise, end: float
) -> ReportedModulus | None:
    """Return the modulus of laws with E1 = E2 that fit the data, with its band.

    G12 may be any between its bounds: its logarithm counts as evenly distributed but for the data.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The best fit, from which the search starts.
    noise : Noise
    end : float
        Largest log strain of the modulus.

    Returns
    -------
    ReportedModulus or None
        None where analyses fail.
    """
    strain = np.linspace(0.0, end, 11)
    search = ValleySearch(problem, best, noise, strain)
    valley = search.valley(search.balance())
    if valley is None:
        return None
    draws = valley.draws(DRAWS, np.random.default_rng(0))
    samples = draws @ problem.unknowns.modulus_rows("E1", strain).T
    value = np.median(samples, axis=0)
    return ReportedModulus.of_samples(strain, value, samples, "E1", problem.unknowns)


def note_of_one_stiffness(modulus: ReportedModulus | None) -> Note:
    """Return the note on data that do not tell warp from fill, with the stiffness they tell."""
    words = "heights at the centre of a circular sheet do not tell warp from fill"
    if modulus is not None:
        values = [
            f"{modulus.value[k]:.4g} MPa ({modulus.lower[k]:.4g} to {modulus.upper[k]:.4g}) at "
            f"{100 * modulus.strain[k]:.2g} %"
            for k in (0, -1)
        ]
        words += (
            "; they tell one stiffness, that of a balanced sheet with E1 = E2 and any G12 between "
            f"its bounds: {' and '.join(values)} of strain. It is about the geometric mean of E1 "
            "and E2 unless E1 is several times E2"
        )
    return Note(ONE_STIFFNESS, words)
