"""The bubble inflation test: a clamped disk, inflated, its surface followed by stereo DIC."""

from __future__ import annotations

from collections.abc import Sequence

from ...materials.law import HypoelasticLaw
from ..kinds import Candidate, MakeSolver, Place, Planning
from .candidates import candidates
from .prepared import PreparedBubble, prepare
from .section import BubbleSection
from .test import STUDIED, BubbleTest, read

NAMES = (
    "length-unit", "zero-points", "repeated-frame", "z-flipped", "frame-order",
    "deformed-coordinates", "axis-flipped", "pressure-unit", "camera-frame", "off-centre", "tilted",
    "turned", "swapped",
)  # fmt: skip


__all__ = ["KIND", "BubbleKind"]


class BubbleKind:
    """The kind of [[bubble]] in a project."""

    name = "bubble"
    title = "a bubble inflation test"
    folder_key = "data.points.folder"
    section = BubbleSection
    fitted = True
    predicted = None
    studied = STUDIED
    doubts = NAMES

    def read(self, section: BubbleSection, place: Place, name: str) -> BubbleTest:
        """Return the test of a section; raises InputError."""
        return read(section, place, name)

    def prepare(
        self, test: BubbleTest, law: HypoelasticLaw, make_solver: MakeSolver
    ) -> PreparedBubble:
        """Read the measured fields, or compute those of the known solution."""
        return prepare(test, law, make_solver)

    def candidates(self, planning: Planning) -> Sequence[Candidate]:
        """Return the same test again, to more pressure, with an elliptic rim."""
        return candidates(planning)


KIND = BubbleKind()
