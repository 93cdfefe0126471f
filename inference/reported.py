"""Moduli as they are reported: values and bands along their strains, and notes on their bounds.

All outputs that say how well a modulus is known take it from a `ReportedModulus`: tables, warnings,
verdicts, cards, and the studies that quote a fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..materials.card import LEVEL
from ..materials.forms.base import COMPONENTS, Array, components_of
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, Objection
from ..wording import percent
from .posterior import Posterior
from .problem import Evaluation, FitProblem
from .unknowns import Unknowns

Flags = NDArray[np.bool_]
#: Share of a normal distribution within one standard deviation.
SIGMA_LEVEL = 0.6827
#: Relative standard deviation from which on a modulus counts as not determined.
LARGEST_SIGMA = 1.0
#: A bound of the fit closer to an end of a band than this share of its width makes that end: bands
#: of moduli of which data say nothing end up to 6 % from their bounds.
CLOSE = 0.07
#: Word that tables have for a modulus that is not determined.
UNKNOWN = "unknown"
#: Mark of an end of a band, or of a value, that is a bound of the fit, and its meaning.
BOUND_MARK = "*"
BOUND_WORDS = f"{BOUND_MARK}: on a bound of the fit, which ends the band there instead of the data"


@dataclass(frozen=True, eq=False)
class ReportedModulus:
    """A modulus along its strain with its uncertainty.

    Attributes
    ----------
    strain, value : (n,) arrays
        Logarithmic strain, and the modulus of the reported law in MPa.
    lower, upper : (n,) arrays, MPa
        Ends of the band: the 95 % interval of the modulus in the posterior, within the bounds of
        the fit, extended to `value` where that lies outside.
    sigma : (n,) array
        Half the width of the 68 % interval, made likewise, over the value.
    at_lower_bound, at_upper_bound : (n,) bool arrays
        Whether a bound of the fit ends the band there, not the data.
    """

    strain: Array
    value: Array
    lower: Array
    upper: Array
    sigma: Array
    at_lower_bound: Flags
    at_upper_bound: Flags

    @classmethod
    def of_samples(
        cls,
        strain: Array,
        value: Array,
        samples: Array,
        name: str,
        unknowns: Unknowns,
    ) -> ReportedModulus:
        """Return a modulus with the uncertainty that samples of its distribution show.

        Parameters
        ----------
        strain, value : (n,) arrays
            Log strain, and the modulus of the reported law in MPa.
        samples : (samples, n) array, MPa
            Samples of the modulus at each strain.
        name : str
            "E1", "E2" or "G12".
        unknowns : Unknowns
            Unknowns of the fit, with its bounds.
        """
        lower, upper = _interval(samples, value, LEVEL)
        low, high = _interval(samples, value, SIGMA_LEVEL)
        smallest = samples.min(axis=0)
        largest = samples.max(axis=0)
        room = CLOSE * (upper - lower)
        at_lower, at_upper = np.zeros((2, len(strain)), dtype=bool)
        # No bound is closer than the sample that is nearest to it.
        may_end = np.minimum(smallest, value) >= lower - room
        limit = unknowns.modulus_limits(name, strain[may_end], -1.0)
        at_lower[may_end] = lower[may_end] - limit <= room[may_end]
        may_end = np.maximum(largest, value) <= upper + room
        limit = unknowns.modulus_limits(name, strain[may_end], 1.0)
        at_upper[may_end] = limit - upper[may_end] <= room[may_end]
        return cls(
            strain,
            value,
            lower,
            upper,
            0.5 * (high - low) / value,
            at_lower,
            at_upper,
        )

    @property
    def determined(self) -> Flags:
        """Return (n,) whether the data determine the modulus.

        They do where one standard deviation is less than the modulus itself, and the band does not
        reach from bound to bound.
        """
        return (self.sigma < LARGEST_SIGMA) & ~(self.at_lower_bound & self.at_upper_bound)

    @property
    def on_lower_bound(self) -> Flags:
        """Return (n,) whether the value itself lies on the lower bound of the fit."""
        return self.at_lower_bound & (self.value <= self.lower)

    @property
    def on_upper_bound(self) -> Flags:
        """Return (n,) whether the value itself lies on the upper bound of the fit."""
        return self.at_upper_bound & (self.value >= self.upper)

    @property
    def band(self) -> Array:
        """Return the ends of the band (2, n), MPa."""
        return np.array([self.lower, self.upper])

    @property
    def rms_sigma(self) -> float:
        """Return the root mean square of sigma along the strain."""
        return float(np.sqrt(np.mean(self.sigma**2)))

    @property
    def numbers(self) -> dict[str, float]:
        """Return least, median and largest sigma, and the share of strains not determined."""
        return {
            "least": float(self.sigma.min()),
            "median": float(np.median(self.sigma)),
            "largest": float(self.sigma.max()),
            "not_determined": float(1.0 - self.determined.mean()),
        }

    def at(self, strain: Array, value: Array) -> ReportedModulus:
        """Return the modulus at other strains, with its uncertainty interpolated.

        Parameters
        ----------
        strain : (k,) array
            Log strains.
        value : (k,) array, MPa
            The modulus of the reported law at them.
        """

        def between(numbers: Array | Flags) -> Array:
            return np.interp(strain, self.strain, numbers)

        lower = np.minimum(between(self.lower), value)
        upper = np.maximum(between(self.upper), value)
        sigma = between(self.sigma * self.value) / value
        at_lower_bound = between(self.at_lower_bound) > 0.5
        at_upper_bound = between(self.at_upper_bound) > 0.5
        return ReportedModulus(strain, value, lower, upper, sigma, at_lower_bound, at_upper_bound)


def _interval(samples: Array, value: Array, level: float) -> Array:
    """Return the ends (2, n) of an interval that holds a share of samples, and `value`.

    Parameters
    ----------
    samples : (samples, n) array
    value : (n,) array
    level : float
        Share of the samples in the interval; half of the others lie below and half above.
    """
    low, high = np.quantile(samples, [(1 - level) / 2, (1 + level) / 2], axis=0)
    return np.array([np.minimum(low, value), np.maximum(high, value)])


def reported_moduli(
    posterior: Posterior, law: HypoelasticLaw, strains: Mapping[str, Array]
) -> dict[str, ReportedModulus]:
    """Return each modulus of a law with its uncertainty in a posterior.

    Parameters
    ----------
    posterior : Posterior
        Distribution of the unknowns. Where the law is not in its middle (as with a mesh error that
        is not taken out), bands reach from the law to the moduli of the posterior.
    law : HypoelasticLaw
        The law that is reported.
    strains : dict of (n,) arrays
        Log strains at which each modulus is reported.
    """
    return {
        name: ReportedModulus.of_samples(
            strain,
            law.modulus(name, strain),
            posterior.modulus_samples(name, strain),
            name,
            posterior.unknowns,
        )
        for name, strain in strains.items()
    }


def sigma_words(sigma: float, not_determined: bool = False) -> str:
    """Return a relative standard deviation as percent, or that the modulus is not determined.

    Parameters
    ----------
    sigma : float
    not_determined : bool
        Whether the modulus is not determined whatever `sigma` is.
    """
    if not_determined or not sigma < LARGEST_SIGMA:
        return UNKNOWN
    return percent(sigma)


def sigma_words_of(numbers: Mapping[str, Any]) -> tuple[str, str]:
    """Return the median and the largest sigma of `ReportedModulus.numbers` in words."""
    share = numbers["not_determined"]
    return sigma_words(numbers["median"], share > 0.5), sigma_words(numbers["largest"], share > 0.0)


POINTS = 61  # number of strains at which a modulus is evaluated


def moduli_error(
    law: HypoelasticLaw,
    reference: HypoelasticLaw,
    reached: Array,
    points: int = POINTS,
) -> dict[str, float]:
    """Return the largest relative error of each modulus up to the strains reached.

    Parameters
    ----------
    law : HypoelasticLaw
    reference : HypoelasticLaw
        The law that is taken as true.
    reached : (3,) array
        Log strains (eps1, eps2, gamma12) up to which the moduli are compared.
    points : int
        Number of strains at which each modulus is compared.
    """
    errors = {}
    for name, component in COMPONENTS.items():
        strain = np.linspace(0.0, reached[component], points)
        ratio = law.modulus(name, strain) / reference.modulus(name, strain)
        errors[name] = float(np.max(np.abs(ratio - 1.0)))
    return errors


def moduli_of(unknowns: Unknowns, y: Array, strains: Mapping[str, Array]) -> dict[str, Array]:
    """Return the moduli of the law that given unknowns make.

    Parameters
    ----------
    unknowns : Unknowns
    y : (unknowns,) array
    strains : mapping of (n,) arrays
        Log strains at which each modulus ("E1", "E2", "G12") is evaluated.

    Returns
    -------
    dict of (n,) arrays, MPa
    """
    coefficients = unknowns.to_coefficients @ y[: unknowns.size]
    return {
        name: unknowns.coefficient_rows(name, strain) @ coefficients
        for name, strain in strains.items()
    }


def relative_changes(
    unknowns: Unknowns,
    y: Array,
    step: Array,
    strains: Mapping[str, Array],
) -> dict[str, Array]:
    """Return the relative change of each modulus by a step of the unknowns.

    Parameters
    ----------
    unknowns : Unknowns
    y, step : (unknowns,) arrays
        The unknowns, and their change.
    strains : mapping of (n,) arrays
        Log strains at which each modulus is evaluated.

    Returns
    -------
    dict of (n,) arrays
    """
    initial = moduli_of(unknowns, y, strains)
    changed = moduli_of(unknowns, y + step, strains)
    return {name: changed[name] / initial[name] - 1.0 for name in strains}


def moduli_sigmas(
    unknowns: Unknowns,
    law: HypoelasticLaw,
    reached: Array,
    covariance: Array,
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return strains, and the relative standard deviation of each modulus at them.

    Parameters
    ----------
    unknowns : Unknowns
    law : HypoelasticLaw
        Law whose moduli the standard deviations are relative to.
    reached : (3,) array
        Log strains (eps1, eps2, gamma12) up to which the moduli are evaluated.
    covariance : (unknowns, unknowns) array
        Covariance of the unknowns.

    Returns
    -------
    dict of (n,) arrays
        Log strains of each modulus.
    dict of (n,) arrays
        Standard deviation of each modulus at them, over the modulus.
    """
    size = unknowns.size
    to_coefficients = unknowns.to_coefficients
    of_coefficients = to_coefficients @ covariance[:size, :size] @ to_coefficients.T
    strains = {}
    sigmas = {}
    for name, component in components_of(unknowns.form).items():
        strain = np.linspace(0.0, reached[component], POINTS)
        rows = unknowns.coefficient_rows(name, strain)
        variance = np.einsum("ki,ij,kj->k", rows, of_coefficients, rows)
        sigma = np.sqrt(np.maximum(variance, 0.0))
        strains[name] = strain
        sigmas[name] = sigma / law.modulus(name, strain)
    return strains, sigmas


UNCERTAIN = NoteKind("uncertain", weight=6)
BOUNDS_REACHED = Objection(
    "bounds are reached",
    "widen the bounds that the warnings name, or add a test that determines these moduli",
)
MARGIN = NoteKind("on its margin", weight=17, objection=BOUNDS_REACHED)
BOUND = NoteKind("on a bound", weight=18, objection=BOUNDS_REACHED)

NOTED_SIGMA = 0.25  # relative standard deviation from which on a modulus is noted as uncertain
ON_BOUND = 1e-6  # of the width of the bounds, or of a modulus: what is closer lies on the bound


def uncertain_words(name: str, modulus: ReportedModulus, noise_words: str) -> str:
    """Return a sentence on where a modulus is not determined, or on how uncertain it is.

    Parameters
    ----------
    name : str
        "E1", "E2" or "G12".
    modulus : ReportedModulus
    noise_words : str
        What the uncertainty stems from ("at 0.02 mm noise"), which the sentence has in brackets.

    Returns
    -------
    str
        Empty where the modulus is determined and uncertain by at most `NOTED_SIGMA`.
    """
    strain = modulus.strain
    undetermined = strain[~modulus.determined]
    if len(undetermined):
        span = f"between {100 * undetermined[0]:.3g} and {100 * undetermined[-1]:.3g} % of strain"
        where = "at any strain" if len(undetermined) == len(strain) else span
        return f"{name} is not determined {where} ({noise_words})"
    worst = int(modulus.sigma.argmax())
    if modulus.sigma[worst] <= NOTED_SIGMA:
        return ""
    return (
        f"{name} is uncertain by up to {percent(modulus.sigma[worst])} (1 sigma {noise_words}), "
        f"worst at {100 * strain[worst]:.3g} % of strain"
    )


def bound_reached(value: float, lower: float, upper: float) -> str:
    """Return the bound on which a value lies ("lower", "upper"), "" for none."""
    room = ON_BOUND * (upper - lower)
    if value - lower <= room:
        return "lower"
    return "upper" if upper - value <= room else ""


def notes_of_bounds(problem: FitProblem, best: Evaluation, open_modulus: str) -> list[Note]:
    """Return notes on moduli, coefficients and nuisance parameters on a bound of the fit.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The optimum.
    open_modulus : str
        A modulus that the data leave open, "" for none: where it lies says nothing.
    """
    unknowns = problem.unknowns
    bounds = unknowns.bounds
    notes = []
    for name, rows in unknowns.moduli.items():
        if name == open_modulus:
            continue
        moduli = rows @ best.coefficients
        smallest = bounds.smallest[name]
        if (moduli - smallest <= ON_BOUND * max(smallest, 1.0)).any():
            words = f"{name} touches its positivity margin: the data ask for less stiffness"
            notes.append(Note(MARGIN, words))
        largest = np.inf if bounds.largest is None else bounds.largest[name]
        if (largest - moduli <= ON_BOUND * largest).any() and largest < np.inf:
            words = f"{name} touches its upper bound: the data ask for more stiffness"
            notes.append(Note(BOUND, words))
    if bounds.largest is None:
        notes += notes_on_box(unknowns.labels, best.coefficients, *unknowns.box)
    nuisance = best.unknowns[unknowns.size :]
    return notes + notes_on_box(unknowns.nuisance.names, nuisance, *unknowns.nuisance.bounds)


def notes_on_box(
    names: Sequence[str],
    values: Array,
    lower: Array,
    upper: Array,
) -> list[Note]:
    """Return notes on values (n,) that lie on their lower or upper bound (n,)."""
    notes = []
    for name, value, low, high in zip(names, values, lower, upper, strict=True):
        bound = bound_reached(value, low, high)
        if bound:
            notes.append(Note(BOUND, f"{name} lies on its {bound} bound"))
    return notes
