"""The inflated cylinder in three-point bending: predicted with cards, not fitted."""

from .predicted import STUDIED, CylinderPredicted
from .test import CylinderSection, read


class CylinderKind:
    """Kind of the sections [[cylinder]] of a project."""

    name = "cylinder"
    title = "an inflated cylinder in three-point bending"
    folder_key = "measured.folder"
    section = CylinderSection
    fitted = False
    predicted = CylinderPredicted()
    studied = STUDIED
    read = staticmethod(read)


KIND = CylinderKind()
