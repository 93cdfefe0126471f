"""What a report of image correlation should tell, as far as it is known of a bubble test."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...reports import Table

if TYPE_CHECKING:
    from .prepared import PreparedBubble

NOT_GIVEN = "not given"
TITLE = "Image correlation"
NOTE = (
    "The fields that the good practices guide of the International Digital Image Correlation "
    "Society asks for. What is not given here stands in no file that was read: add it before the "
    "report leaves the laboratory."
)
#: Of the hardware and the analysis: nothing that exports of image correlation hold.
UNKNOWN = (
    "camera", "image resolution", "lens and aperture", "field of view", "image scale",
    "stereo angle and stand-off", "exposure and frame rate", "patterning technique",
    "pattern feature size", "subset size", "step size", "strain window and virtual gauge length",
    "shape function, matching criterion, interpolant", "prefilter and data filter",
)  # fmt: skip


def correlation_table(prepared: PreparedBubble) -> list[Table]:
    """A row a field; nothing where the data were computed."""
    if prepared.known is not None or not prepared.fields:
        return []
    formats = sorted({f.source.format for f in prepared.fields if f.source.format})
    points = [len(f.points) for f in prepared.fields]
    noise = prepared.test.noise
    known: list[list[object]] = [
        ["software or format of the export", ", ".join(formats) or NOT_GIVEN],
        ["images evaluated", str(len(prepared.fields))],
        ["points in an image", f"{min(points)} to {max(points)}"],
        ["points left out as doubtful", str(prepared.dropped)],
        ["coordinates", "registered on the rim" if prepared.registration else "as exported"],
        ["noise floor of a displacement", NOT_GIVEN if noise is None else f"{noise:.3g} mm"],
    ]
    if prepared.test.match_by == "surfaces":
        known.append(["smoothing", f"polynomial surfaces of degree {prepared.test.match_degree}"])
    unknown: list[list[object]] = [[name, NOT_GIVEN] for name in UNKNOWN]
    rows = [*known, *unknown]
    return [Table(f"{TITLE}: {prepared.test.name}", ["", ""], rows, NOTE, text=(1,))]
