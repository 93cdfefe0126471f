"""The inflated cylinder in three-point bending: predicted with cards, not fitted."""

from .predicted import STUDIED, CylinderPredicted
from .reading import read
from .section import CylinderSection


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
