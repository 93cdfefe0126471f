"""A law followed along a path of strains, for the tests of the law."""

from itertools import pairwise

import numpy as np
from bubblefit.materials.law import HypoelasticLaw


def follow(law: HypoelasticLaw, path: np.ndarray) -> np.ndarray:
    """Stress (3,) at the end of a path (steps + 1, 3)."""
    stress = np.zeros((1, 3))
    for old, new in pairwise(path):
        stress, _ = law.increment(old, new, stress)
    return stress[0]
