"""Biaxial tests: a cruciform loaded along warp and fill in several ratios."""

from pydantic import BaseModel

from ..kinds import Kind
from ..measured import MeasuredKind
from .prepared import PreparedBiaxial, candidates
from .test import BiaxialSection, read


class Biaxial(MeasuredKind):
    """A cruciform loaded along warp and fill in several ratios."""

    name: str = "biaxial"
    title: str = "a cruciform loaded along warp and fill in several ratios"
    section: type[BaseModel] = BiaxialSection
    folder_key: str = "data.folder"
    doubts: tuple[str, ...] = ("strain-unit", "load-unit", "ratio", "modulus", "swapped")
    prepared = PreparedBiaxial
    read = staticmethod(read)
    candidates = staticmethod(candidates)


KIND: Kind = Biaxial()
