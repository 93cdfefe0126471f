"""The bubble inflation test: a clamped disk, inflated, its surface followed by stereo DIC."""

from ..base import BaseKind
from .planning import candidates
from .prepared import prepare
from .section import BubbleSection, with_units
from .test import STUDIED, read


class BubbleKind(BaseKind):
    """The kind of [[bubble]] in a project."""

    name = "bubble"
    title = "a bubble inflation test"
    folder_key = "data.points.folder"
    section = BubbleSection
    fitted = True
    studied = STUDIED
    doubts = (
        "frame-numbers",
        "exchanged",
        "length-unit",
        "zero-points",
        "outliers",
        "z-flipped",
        "frame-order",
        "repeated-frame",
        "deformed-coordinates",
        "radius",
        "axis-flipped",
        "strain-rise",
        "pressure-unit",
        "height-flipped",
        "flat-sheet",
        "loaded-reference",
        "camera-frame",
        "off-centre",
        "tilted",
        "turned",
        "swapped",
    )
    read = staticmethod(read)
    prepare = staticmethod(prepare)
    candidates = staticmethod(candidates)
    with_units = staticmethod(with_units)


KIND = BubbleKind()
