"""Biaxial tests: a cruciform loaded along warp and fill in several ratios."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pydantic import BaseModel

from ...materials.card import MaterialCard
from ..kinds import (
    Candidate,
    CardRun,
    Kind,
    Output,
    Place,
    Planning,
    Predicted,
    Simulation,
    Studied,
)
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
        """The test of a section, and its files.

        Raises
        ------
        InputError : naming the file and the dotted key, or a data file.
        """
        return read(section, place, name)

    def candidates(self, planning: Planning) -> Sequence[Candidate]:
        """Single ratios, up to the strains that the law is known for."""
        from .candidates import candidates

        return candidates(planning)

    def simulate(
        self,
        test: BiaxialTest,
        cards: Mapping[str, MaterialCard],
        runs: Mapping[tuple[str, str], CardRun],
        out: Output,
        within_range: bool = False,
    ) -> Simulation:
        """Cards on the ratios: paths.csv, paths.png, RMS errors of strain."""
        from .simulated import simulate

        return simulate(test, cards, runs, out, within_range)


KIND: Kind = Biaxial()
