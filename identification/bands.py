"""Bands of the moduli: between what they lie with 95 % certainty, within the bounds of the fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..materials.forms.base import modulus_rows
from ..materials.law import HypoelasticLaw
from .posterior import Posterior

Array = NDArray[np.float64]

#: Share of the draws inside a band, and draws.
LEVEL, DRAWS = 0.95, 1000


def bands_of(
    posterior: Posterior, law: HypoelasticLaw, strains: dict[str, Array]
) -> dict[str, Array]:
    """(2, n) MPa by modulus: lower and upper end of its band at strains (n,).

    Of draws from the posterior, which keep the inequalities of the fit, so that what lies on a
    bound is uncertain to one side. The law's own modulus is always inside: where the mesh's error
    is told and not taken out, the band reaches from there to what finer meshes would give.
    """
    unknowns = posterior.unknowns
    drawn = posterior.sample(DRAWS, np.random.default_rng(0))[:, : unknowns.size]
    coefficients = drawn @ unknowns.to_coefficients.T
    bands = {}
    for name, strain in strains.items():
        rows = modulus_rows(unknowns.form, name, strain, unknowns.strain_range)
        moduli = coefficients @ rows[:, list(unknowns.free)].T
        ends = np.quantile(moduli, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0)
        own = law.modulus(name, strain)
        bands[name] = np.array([np.minimum(ends[0], own), np.maximum(ends[1], own)])
    return bands
