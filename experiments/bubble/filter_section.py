"""[bubble.data.points.filter]: what the camera's correlation makes of a displacement."""

from __future__ import annotations

from typing import Literal

from ...errors import InputError
from ...meshes.facet_reading import Facet
from ...sections import Positive, Section
from ..base import Place


class FilterSection(Section):
    """The model is read as the camera reads the fabric."""

    facet: Positive
    order: Literal[1, 2] = 1
    smoothing: int = 1
    step: Positive | None = None


def facet_of(
    section: FilterSection | None, place: Place, scale: float, symmetry: str, match: str
) -> Facet | None:
    """The facet of a section, in mm; None where points are read as they are.

    scale : mm per unit of the project's lengths.

    Raises
    ------
    InputError : what makes no facet; a quarter model, or surfaces that are matched.
    """
    if section is None:
        return None
    at = "data.points.filter"
    if symmetry == "quarter":
        problem = 'a facet reaches over the edge of a quarter; expected symmetry = "full"'
        raise place.error(at, problem)
    if match != "points":
        raise place.error(at, "surfaces are matched, not points: leave this out")
    step = None if section.step is None else section.step * scale
    try:
        return Facet(section.facet * scale, section.order, section.smoothing, step)
    except InputError as error:
        raise place.error(f"{at}.{error.field}", error.problem) from None
