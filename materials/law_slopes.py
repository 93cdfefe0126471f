"""How what the compiled law is given changes with a law's numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .forms.base import map_in_range, ratio_map
from .law import HypoelasticLaw

Array = NDArray[np.float64]


def law_slopes(
    law: HypoelasticLaw, parameters: Sequence[str], thickness: float
) -> tuple[Array, Array]:
    """Derivatives of the pieces' coefficients (3, P, 4, np) and of `law.coupling` (3, np).

    parameters : "beta_i" (per MPa), "nu12" and "thickness" (per mm, of a sheet that is
    `thickness` mm thick); by any other they are zero.
    """
    of_beta = map_in_range(law.form, law.strain_range.tolist())
    rows = np.zeros((*of_beta.shape[:3], len(parameters)))
    coupling, gains = np.zeros((3, len(parameters))), ratio_map(law.form)
    for j, name in enumerate(parameters):
        if name.startswith("beta_"):
            place = int(name.removeprefix("beta_"))
            rows[..., j], coupling[1:, j] = of_beta[..., place], gains[:, place]
        elif name == "nu12":
            coupling[0, j] = 1.0
        elif name == "thickness":
            # Loads are moduli times thickness: a thicker sheet is strained as a stiffer one is
            # (its stress is another, but nothing that takes this derivative is told of stress).
            rows[..., j] = of_beta @ law.beta / thickness
            coupling[1:, j] = law.coupling[1:] / thickness
    return rows, coupling
