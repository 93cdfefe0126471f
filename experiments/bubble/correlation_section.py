"""[bubble.data.points.correlation]: how the displacements were measured, for the record."""

from __future__ import annotations

from typing import Annotated

from pydantic import StringConstraints

from ...sections import Section

Words = Annotated[
    str,
    StringConstraints(strip_whitespace=True, min_length=1, max_length=300, pattern=r"^[^\r\n]*$"),
]


class CorrelationSection(Section):
    """Words with their units, as they are to stand in a report; no result depends on them."""

    software: Words | None = None
    camera: Words | None = None
    resolution: Words | None = None
    lens: Words | None = None
    field_of_view: Words | None = None
    scale: Words | None = None
    stereo: Words | None = None
    exposure: Words | None = None
    pattern: Words | None = None
    pattern_size: Words | None = None
    subset: Words | None = None
    step: Words | None = None
    strain_window: Words | None = None
    matching: Words | None = None
    prefilter: Words | None = None
