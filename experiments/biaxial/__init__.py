"""Biaxial tests: a cruciform loaded along warp and fill in several ratios."""

from __future__ import annotations

from pydantic import BaseModel

from ...materials.law import HypoelasticLaw
from ..kinds import Kind, MakeSolver, Predicted, Studied
from .prepared import PreparedBiaxial, candidates
from .test import BiaxialSection, BiaxialTest, read


class Biaxial:
    """A cruciform loaded along warp and fill in several ratios."""

    name: str = "biaxial"
    title: str = "a cruciform loaded along warp and fill in several ratios"
    section: type[BaseModel] = BiaxialSection
    folder_key: str = "data.folder"
    fitted: bool = True
    predicted: Predicted | None = None
    doubts: tuple[str, ...] = ("strain-unit", "load-unit", "ratio", "modulus", "swapped")
    read = staticmethod(read)
    candidates = staticmethod(candidates)
    studied: Studied | None = None

    def prepare(
        self, test: BiaxialTest, law: HypoelasticLaw, make_solver: MakeSolver
    ) -> PreparedBiaxial:
        """Return the test, which was read with its data."""
        return PreparedBiaxial(test)


KIND: Kind = Biaxial()
