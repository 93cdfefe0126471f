"""Biaxial tests: a cruciform loaded along warp and fill in several ratios."""

from ..measured import MeasuredKind
from .planning import candidates
from .prepared import PreparedBiaxial
from .test import BiaxialSection, read


class BiaxialKind(MeasuredKind):
    """A cruciform loaded along warp and fill in several ratios."""

    name = "biaxial"
    title = "a cruciform loaded along warp and fill in several ratios"
    section = BiaxialSection
    folder_key = "data.folder"
    doubts = ("strain-unit", "load-unit", "ratio", "modulus", "swapped")
    prepared = PreparedBiaxial
    read = staticmethod(read)
    candidates = staticmethod(candidates)


KIND = BiaxialKind()
