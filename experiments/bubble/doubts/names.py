"""What the doubts about a bubble test are trusted by."""

from __future__ import annotations

NAMES = (
    "length-unit", "zero-points", "repeated-frame", "z-flipped", "frame-order",
    "deformed-coordinates", "axis-flipped", "pressure-unit", "camera-frame", "off-centre", "tilted",
    "turned", "swapped",
)  # fmt: skip
