"""The fabric of a project."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..materials.law import ThicknessChange


@dataclass(frozen=True)
class Fabric:
    """The one fabric of all tests of a project; thickness in mm before the test.
    lab : who tested it, for the page."""

    name: str
    thickness: float
    thickness_change: ThicknessChange = "constant"
    lab: str = ""
