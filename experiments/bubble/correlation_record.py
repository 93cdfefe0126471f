"""What a report of image correlation should tell, as far as it is known of a bubble test."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...reports import Table
from .point_files import PointFiles

if TYPE_CHECKING:
    from .prepared import PreparedBubble
    from .test import BubbleTest

NOT_GIVEN = "not given"
TITLE = "Image correlation"
NOTE = (
    "The fields that the good practices guide of the International Digital Image Correlation "
    "Society asks for. What is not given stands in no file that was read: give it in "
    "[bubble.data.points.correlation] before the report leaves the laboratory."
)
#: Of the hardware and the analysis, which exports of image correlation do not hold: what the
#: section's keys are called on the page.
ASKED = {
    "camera": "camera",
    "resolution": "image resolution",
    "lens": "lens and aperture",
    "field_of_view": "field of view",
    "scale": "image scale",
    "stereo": "stereo angle and stand-off",
    "exposure": "exposure and frame rate",
    "pattern": "patterning technique",
    "pattern_size": "pattern feature size",
    "subset": "subset size",
    "step": "step size",
    "strain_window": "strain window and virtual gauge length",
    "matching": "shape function, matching criterion, interpolant",
    "prefilter": "prefilter and data filter",
}


def correlation_table(prepared: PreparedBubble) -> list[Table]:
    """A row a field; nothing where the data were computed."""
    test = prepared.test
    if not isinstance(test.data, PointFiles) or not prepared.fields:
        return []
    given = {**_of_filter(test), **test.data.correlation}
    formats = sorted({f.source.format for f in prepared.fields if f.source.format})
    points = [len(f.points) for f in prepared.fields]
    software = [given.get("software", ""), ", ".join(formats)]
    known: list[list[object]] = [
        ["software and format of the export", "; ".join(filter(None, software)) or NOT_GIVEN],
        ["images evaluated", str(len(prepared.fields))],
        ["points in an image", f"{min(points)} to {max(points)}"],
        ["points left out as doubtful", str(prepared.dropped)],
        ["coordinates", "registered on the rim" if prepared.registration else "as exported"],
        ["noise floor of a displacement", _mm(test.noise) or NOT_GIVEN],
    ]
    if test.match_by == "surfaces":
        known.append(["smoothing", f"polynomial surfaces of degree {test.match_degree}"])
    asked: list[list[object]] = [[name, given.get(key, NOT_GIVEN)] for key, name in ASKED.items()]
    return [Table(f"{TITLE}: {test.name}", ["", ""], [*known, *asked], NOTE, text=(1,))]


def _of_filter(test: BubbleTest) -> dict[str, str]:
    """What the section of the camera's own filter tells, mm."""
    if test.facet is None:
        return {}
    told = {"subset": _mm(test.facet.size), "step": _mm(test.facet.step)}
    return {key: words for key, words in told.items() if words}


def _mm(value: float | None) -> str:
    return "" if value is None else f"{value:.3g} mm"
