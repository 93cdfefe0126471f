"""What a finished fit means for a test of strips: RMS errors beside the specimens' scatter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...notes import Note, NoteKind
from ..fittable import Findings
from .prepared import FittedStrip
from .test import StripsTest

#: The modulus that each direction pins down.
PINS = {"warp": "E1", "fill": "E2", "bias": "G12"}


def findings_of(test: StripsTest, strips: Sequence[FittedStrip]) -> Findings:
    """Numbers and words of the best fit."""
    total = sum(s.rms for s in strips)
    errors = ", ".join(f"{s.direction} {s.rms:.3g}" for s in strips)
    return Findings(
        numbers={
            "directions": {s.direction: _numbers(test, s) for s in strips},
            "e_uniaxial_N": total,
            "matched_by": test.match_by,
        },
        warnings=tuple(_warnings(test, strips)),
        lines=(_line(strips, total),),
        quality="RMS errors in N: " + ", ".join(f"{s.direction} {s.rms:.4g}" for s in strips),
        summary=f"RMS errors in N: {errors}, together {total:.4g}",
    )


def _numbers(test: StripsTest, fitted: FittedStrip) -> dict[str, Any]:
    strip = fitted.strip
    return {
        "rms_N": fitted.rms,
        "scatter_N": strip.scatter,
        "weight": test.weights[strip.direction],
        "matched": len(fitted.objective.load),
        "gauge_length_mm": strip.gauge_length,
        "final_length_mm": strip.final_length,
        "end_load_N": float(fitted.history.load[-1]),
    }


def _warnings(test: StripsTest, strips: Sequence[FittedStrip]) -> list[Note]:
    """What the data leave open before any fit."""
    directions = {s.direction for s in strips}
    notes = [
        Note(
            NoteKind.UNMATCHED,
            f"no {direction} strip of {test.name} is matched: {modulus} rests on the other "
            "directions",
        )
        for direction, modulus in PINS.items()
        if direction not in directions
    ]
    said = dict.fromkeys(note for s in strips for curve in s.strip.curves for note in curve.notes)
    notes += [Note(NoteKind.READING, words) for words in said]
    if test.match_by == "points":
        notes += [
            Note(
                NoteKind.LEFT_OUT,
                f"{s.strip.beyond} points beyond the final length (or before zero) were left out",
                s.direction,
            )
            for s in strips
            if s.strip.beyond
        ]
    return notes


def _line(strips: Sequence[FittedStrip], total: float) -> str:
    parts = []
    for fitted in strips:
        scatter = fitted.strip.scatter
        beside = "" if scatter is None else f" (specimens scatter by {scatter:.3g})"
        parts.append(f"{fitted.direction} {fitted.rms:.3g}{beside}")
    return "RMS error, N: " + ", ".join(parts) + f"; sum {total:.4g}"
