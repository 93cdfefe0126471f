"""Where a curve of load over deflection is read: places at which loads are listed, and slopes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..errors import InputError

#: Unless given, in diameters of the cylinder: where loads are listed, and the deflection over which
#: a slope is taken.
PLACES, SLOPE_OVER = (0.25, 0.5, 1.0), 0.1


@dataclass(frozen=True)
class CurveReading:
    """Where a curve is read.

    Parameters
    ----------
    places : mm of deflection, by what they are called ("40 mm", "0.25 diameters").
    slope_over : mm of deflection: the initial stiffness is the slope up to here, and the knee is
        where the slope over as much has fallen.

    Raises
    ------
    InputError : what is not above zero.
    """

    places: Mapping[str, float]
    slope_over: float

    def __post_init__(self) -> None:
        for name, value in (*self.places.items(), ("slope_over", self.slope_over)):
            if not value > 0:
                raise InputError(None, name, f"expected more than 0 mm, got {value:g}")


def curve_reading(
    diameter: float, places: Sequence[float] | None = None, slope_over: float | None = None
) -> CurveReading:
    """Places and slopes that are given (mm), and those by the diameter (mm) where they are not."""
    if places is None:
        named = {f"{share:g} diameters": share * diameter for share in PLACES}
    else:
        named = {f"{place:g} mm": place for place in places}
    return CurveReading(named, SLOPE_OVER * diameter if slope_over is None else slope_over)
