"""The bubble inflation test: a clamped disk, inflated, its surface followed by stereo DIC."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ...materials.card import MaterialCard
from ..kinds import Candidate, CardRun, Output, Place, Planning, Simulation, Studied
from .section import BubbleSection
from .test import BubbleTest, read

NAMES = (
    "length-unit", "zero-points", "repeated-frame", "z-flipped", "frame-order",
    "deformed-coordinates", "axis-flipped", "pressure-unit", "camera-frame", "off-centre", "tilted",
    "turned", "swapped",
)  # fmt: skip


__all__ = ["KIND", "BubbleKind"]


class BubbleKind:
    """[[bubble]] of a project."""

    name = "bubble"
    title = "a bubble inflation test"
    folder_key = "data.points.folder"
    section = BubbleSection
    fitted = True
    predicted = None
    doubts = NAMES

    @property
    def studied(self) -> Studied:
        """Apex heights and largest displacements."""
        from .forward import STUDIED

        return STUDIED

    def read(self, section: BubbleSection, place: Place, name: str) -> BubbleTest:
        """The test of a section; raises InputError."""
        return read(section, place, name)

    def simulate(
        self,
        test: Any,
        cards: Mapping[str, MaterialCard],
        runs: Mapping[tuple[str, str], CardRun],
        out: Output,
        within_range: bool = False,
    ) -> Simulation:
        """Tables, surfaces and cuts of every card."""
        from .forward import simulate

        return simulate(test, cards, runs, out, within_range)

    def candidates(self, planning: Planning) -> Sequence[Candidate]:
        """The same again, to more pressure, with an elliptic rim."""
        from .candidates import candidates

        return candidates(planning)


KIND = BubbleKind()
