"""Inflated cylinders in three-point bending, predicted with material cards and not fitted."""

from ..base import BaseKind
from .predicted import STUDIED, CylinderPredicted
from .test import CylinderSection, read


class CylinderKind(BaseKind):
    """Kind of the sections [[cylinder]] of a project."""

    name = "cylinder"
    title = "an inflated cylinder in three-point bending"
    folder_key = "measured.folder"
    section = CylinderSection
    predicted = CylinderPredicted()
    studied = STUDIED
    read = staticmethod(read)


KIND = CylinderKind()
