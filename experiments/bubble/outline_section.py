"""`radius`, or [bubble.ellipse]: the clamped edge of the disk."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from ...data.outline import Outline
from ...meshes.elliptic_disk import MOST_SLENDER
from ...sections import Positive, Section
from ..base import Place

if TYPE_CHECKING:
    from .section import BubbleSection


class EllipseSection(Section):
    """[bubble.ellipse]: the clamped edge is an ellipse, in place of `radius`."""

    major: Positive
    minor: Positive
    angle: Annotated[float, Field(ge=-90, le=90)] = 0.0


def outline_of(section: BubbleSection, place: Place) -> Outline:
    """The edge in mm.

    Raises
    ------
    InputError : neither a radius nor an ellipse, or both; semi-axes the wrong way round, too far
        apart, or below the fabric's thickness; a quarter of which the yarns are no axes.
    """
    length, ellipse = place.scales.length, section.ellipse
    if section.radius is not None and ellipse is not None:
        raise place.error("radius", "expected a radius or [bubble.ellipse], not both")
    if section.radius is not None:
        outline = Outline.circle(section.radius * length)
    elif ellipse is not None:
        outline = Outline(ellipse.major * length, ellipse.minor * length, ellipse.angle)
    else:
        problem = "this key is missing; give the radius of the disk, or [bubble.ellipse]"
        raise place.error("radius", problem)
    key = "radius" if ellipse is None else "ellipse.minor"
    if outline.minor > outline.major:
        problem = f"expected at most the major {outline.major:g} mm, got {outline.minor:g} mm"
        raise place.error(key, f"{problem}; 'angle' is that of the major semi-axis")
    if outline.major > MOST_SLENDER * outline.minor:
        problem = f"expected at least the {MOST_SLENDER:g}th part of the major {outline.major:g} mm"
        raise place.error(key, f"{problem}, got {outline.minor:g} mm")
    if place.fabric.thickness >= outline.minor:
        problem = (
            f"expected more than the fabric's thickness {place.fabric.thickness:g} mm, got "
            f"{outline.minor:g} mm"
        )
        raise place.error(key, problem)
    if section.symmetry == "quarter" and not outline.doubly_symmetric:
        problem = (
            f"the axes of the ellipse lie at {outline.angle:g} degrees from the yarns: needs 'full'"
        )
        raise place.error("symmetry", problem)
    return outline
