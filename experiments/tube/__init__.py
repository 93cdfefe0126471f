"""Tests of an inflated tube in tension and torsion.

The tube is long and closed, its warp runs along the axis, and its strain is the same everywhere
(`TubeModel`). In torsion only the shear modulus G12 resists, so that a tube determines G12 where
strips and bubbles do not.
"""

from ...lazy_modules import LazyFunction
from ..measured import MeasuredKind
from .test import TubeSection, read


class TubeKind(MeasuredKind):
    """An inflated tube in tension and torsion."""

    name = "tube"
    title = "an inflated tube in tension and torsion"
    section = TubeSection
    folder_key = "folder"
    prepared = LazyFunction(f"{__name__}.prepared", "PreparedTube")
    read = staticmethod(read)
    candidates = LazyFunction(f"{__name__}.planning", "candidates")


KIND = TubeKind()
