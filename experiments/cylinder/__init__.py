"""The inflated cylinder in three-point bending: predicted with cards, not fitted."""

from __future__ import annotations

from ..kinds import Place
from .predicted import STUDIED, CylinderPredicted
from .section import CylinderSection
from .test import CylinderTest, read

__all__ = ["KIND", "CylinderKind"]


class CylinderKind:
    """Kind of the sections [[cylinder]] of a project."""

    name = "cylinder"
    title = "an inflated cylinder in three-point bending"
    folder_key = "measured.folder"
    section = CylinderSection
    fitted = False
    predicted = CylinderPredicted()
    studied = STUDIED

    def read(self, section: CylinderSection, place: Place, name: str) -> CylinderTest:
        """Read the section of a test."""
        return read(section, place, name)


KIND = CylinderKind()
