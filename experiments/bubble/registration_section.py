"""[bubble.data.points.registration]: what is given of where the test lies in the camera's view."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ...data.registration.register import PlaneOf, RegistrationOptions
from ...errors import InputError
from ...sections import Number, Section
from ..base import Place

Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Degrees = Annotated[float, Field(ge=-180, le=180)]


class RegistrationSection(Section):
    """The files are in the camera's coordinates; what is not given is found."""

    plane: PlaneOf = "found"
    centre: Triple | None = None
    warp: Degrees | None = None
    warp_points: Annotated[list[Triple], Field(min_length=2, max_length=2)] | None = None
    warp_is: Literal["stiff", "soft"] = "stiff"
    remove_clamp_motion: bool = True


def registration_options(
    section: RegistrationSection | None, place: Place, scale: float
) -> RegistrationOptions | None:
    """What the section gives, in mm; None where the files are in the test's coordinates.

    scale : mm per unit of the files' lengths.

    Raises
    ------
    InputError : an angle and two points.
    """
    if section is None:
        return None
    marks = None
    if section.warp_points is not None:
        first, second = (_point(one, scale) for one in section.warp_points)
        marks = (first, second)
    try:
        return RegistrationOptions(
            plane=section.plane,
            centre=None if section.centre is None else _point(section.centre, scale),
            warp=section.warp,
            warp_points=marks,
            warp_is_stiff=section.warp_is == "stiff",
            remove_clamp_motion=section.remove_clamp_motion,
        )
    except InputError as error:
        raise place.error(f"data.points.registration.{error.field}", error.problem) from None


def _point(given: list[float], scale: float) -> tuple[float, float, float]:
    x, y, z = (scale * value for value in given)
    return x, y, z
