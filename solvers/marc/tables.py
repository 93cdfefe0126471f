"""Tangent moduli as tables of a strain, for NLELAST."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...materials.law import MODULI, UNLIMITED, HypoelasticLaw

Array = NDArray[np.float64]

#: Points from strain zero to the end of the law's range.
POINTS = 101
#: End of the table of a law whose range has none: log strain, beyond any fabric's.
FAR = 1.0
#: Half the width of a step between two constant moduli, over the strain where it is.
STEP = 1e-6


def modulus_table(law: HypoelasticLaw, name: str, points: int = POINTS) -> Array:
    """Strain and modulus (MPa), (n, 2), of 'E1', 'E2' or 'G12' (of both signs of shear).

    One point more at either end has the same modulus as its neighbour: held whether the ends of a
    table are held or extended along their last slope. Between two points of a cubic the modulus
    is off by at most h^2/8 of its second derivative.
    """
    component = MODULI[name][1]
    end = float(law.strain_range[component])
    end = FAR if end >= UNLIMITED else end
    strain = np.linspace(0.0, end, points)
    if law.breaks is not None:
        at = law.breaks[component]
        at = at[at < end]
        beside = np.concatenate([at * (1 - STEP), at * (1 + STEP)])
        strain = np.union1d(strain[~np.isin(strain, at)], beside)
    beyond = 2 * end
    if component == 2:
        strain = np.concatenate([[-beyond], -strain[:0:-1], strain, [beyond]])
    else:
        strain = np.concatenate([[-beyond], strain, [beyond]])
    return np.column_stack([strain, law.modulus(name, strain)])
