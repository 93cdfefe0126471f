"""The bubble inflation test: a clamped disk, inflated, its surface followed by stereo DIC."""

from ...lazy_modules import LazyFunction
from ..base import BaseKind
from .section import BubbleSection, with_units
from .test import STUDIED, read


class BubbleKind(BaseKind):
    """The kind of [[bubble]] in a project."""

    name = "bubble"
    title = "a bubble inflation test"
    folder_key = "data.points.folder data.heights.folder data.profiles.folder data.apex.folder"
    section = BubbleSection
    fitted = True
    studied = STUDIED
    doubts = (
        "frame-numbers",
        "pressure-log",
        "exchanged",
        "length-unit",
        "zero-points",
        "outliers",
        "repeated-points",
        "z-flipped",
        "frame-order",
        "repeated-frame",
        "rest-frame",
        "deformed-coordinates",
        "radius",
        "axis-flipped",
        "strain-rise",
        "pressure-unit",
        "height-flipped",
        "flat-sheet",
        "loaded-reference",
        "moving-edge",
        "camera-frame",
        "off-centre",
        "tilted",
        "turned",
        "swapped",
        "height-falls",
        "height-unit",
    )
    read = staticmethod(read)
    prepare = LazyFunction(f"{__name__}.prepared_readings", "prepare")
    candidates = LazyFunction(f"{__name__}.planning", "candidates")
    with_units = staticmethod(with_units)


KIND = BubbleKind()
