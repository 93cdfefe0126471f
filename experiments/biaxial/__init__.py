"""Biaxial tests: a cruciform loaded along warp and fill in several ratios."""

from ...lazy_modules import LazyFunction
from ..measured import MeasuredKind
from .test import BiaxialSection, read


class BiaxialKind(MeasuredKind):
    """A cruciform loaded along warp and fill in several ratios."""

    name = "biaxial"
    title = "a cruciform loaded along warp and fill in several ratios"
    section = BiaxialSection
    folder_key = "data.folder"
    doubts = ("strain-unit", "load-unit", "ratio", "modulus", "swapped")
    prepared = LazyFunction(f"{__name__}.prepared", "PreparedBiaxial")
    read = staticmethod(read)
    candidates = LazyFunction(f"{__name__}.planning", "candidates")


KIND = BiaxialKind()
