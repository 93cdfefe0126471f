"""The inflated cylinder in three-point bending: predicted with cards, not fitted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...materials.card import MaterialCard
from ..kinds import CardRun, Output, Place, Predicted, Simulation, Studied
from .section import CylinderSection
from .test import CylinderTest, read

__all__ = ["KIND", "CylinderKind"]


class CylinderKind:
    """[[cylinder]] of a project."""

    name = "cylinder"
    title = "an inflated cylinder in three-point bending"
    folder_key = "measured.folder"
    section = CylinderSection
    fitted = False

    @property
    def predicted(self) -> Predicted:
        """What cards say of it."""
        from .predicted import CylinderPredicted

        return CylinderPredicted()

    @property
    def studied(self) -> Studied:
        """Shape when inflated, stiffness, loads, buckling."""
        from .predicted import STUDIED

        return STUDIED

    def read(self, section: CylinderSection, place: Place, name: str) -> CylinderTest:
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
        """Tables, figures and the bent beams of every card."""
        from .predicted import simulate

        return simulate(test, cards, runs, out)


KIND = CylinderKind()
