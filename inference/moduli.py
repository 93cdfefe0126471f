"""Compute moduli of a fit along their strains: values, changes, errors and standard deviations."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..materials.forms.base import COMPONENTS, Array, components_of
from ..materials.law import HypoelasticLaw
from .unknowns import Unknowns

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
