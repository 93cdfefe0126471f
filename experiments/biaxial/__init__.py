"""Biaxial tests: a cruciform loaded along warp and fill in several ratios."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import BaseModel

from ...materials.law import HypoelasticLaw
from ..kinds import Candidate, Kind, MakeSolver, Place, Planning, Predicted, Studied
from .prepared import PreparedBiaxial, candidates
from .section import BiaxialSection
from .test import BiaxialTest, read


class Biaxial:
    """A cruciform loaded along warp and fill in several ratios."""

    name: str = "biaxial"
    title: str = "a cruciform loaded along warp and fill in several ratios"
    section: type[BaseModel] = BiaxialSection
    folder_key: str = "data.folder"
    fitted: bool = True
    predicted: Predicted | None = None
    doubts: tuple[str, ...] = ("strain-unit", "load-unit", "ratio", "modulus", "swapped")
    studied: Studied | None = None

    def read(self, section: BiaxialSection, place: Place, name: str) -> BiaxialTest:
        """Read the section of a test, and its files."""
        return read(section, place, name)

    def prepare(
        self, test: BiaxialTest, law: HypoelasticLaw, make_solver: MakeSolver
    ) -> PreparedBiaxial:
        """Return the test, which was read with its data."""
        return PreparedBiaxial(test)

    def candidates(self, planning: Planning) -> Sequence[Candidate]:
        """Return single ratios, up to the strains that the law is known for."""
        return candidates(planning)


KIND: Kind = Biaxial()
