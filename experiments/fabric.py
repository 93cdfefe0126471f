"""The fabric that all tests of a project are made of."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..light_dataclasses import dataclass

if TYPE_CHECKING:
    from ..materials.law import ThicknessChange


@dataclass(frozen=True)
class Fabric:
    """The one fabric that all tests of a project are made of.

    Attributes
    ----------
    name : str
    thickness : float, mm
        Thickness before the test.
    thickness_change : str
        How the law lets the thickness change with strain.
    lab : str
        Who tested the fabric, for the page of a report.
    """

    name: str
    thickness: float
    thickness_change: ThicknessChange = "constant"
    lab: str = ""
