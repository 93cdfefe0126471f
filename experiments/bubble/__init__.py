"""The bubble inflation test: a clamped disk, inflated, its surface followed by stereo DIC."""

from ...lazy_modules import LazyFunction
from ...materials.law import HypoelasticLaw
from ..base import BaseKind, MakeSolver, PreparedTest
from .readings import GaugeReadings
from .section import BubbleSection, with_units
from .test import STUDIED, BubbleTest, read

prepare_fields = LazyFunction(f"{__name__}.prepared", "prepare")
prepare_readings = LazyFunction(f"{__name__}.prepared_readings", "PreparedReadings")


def prepare_bubble(test: BubbleTest, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedTest:
    """Return a bubble test with its fields, or with its readings where there is no camera.

    Parameters
    ----------
    test : BubbleTest
    law : HypoelasticLaw
        The law of the fit; its coefficients are not used.
    make_solver : callable
        Makes the solver of the fit, or, with a name, another.
    """
    is_read = isinstance(test.data, GaugeReadings)
    prepared: PreparedTest = (
        prepare_readings(test) if is_read else prepare_fields(test, law, make_solver)
    )
    return prepared


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
        "exchanged",
        "length-unit",
        "zero-points",
        "outliers",
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
        "camera-frame",
        "off-centre",
        "tilted",
        "turned",
        "swapped",
        "height-falls",
        "height-unit",
    )
    read = staticmethod(read)
    prepare = staticmethod(prepare_bubble)
    candidates = LazyFunction(f"{__name__}.planning", "candidates")
    with_units = staticmethod(with_units)


KIND = BubbleKind()
