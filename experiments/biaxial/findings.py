"""What a finished fit means for a biaxial test: RMS errors of the strains, ratio by ratio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...notes import Note, NoteKind
from ..fittable import Findings
from .prepared import FittedPath
from .test import BiaxialTest


def findings_of(test: BiaxialTest, paths: Sequence[FittedPath]) -> Findings:
    """Numbers and words of the best fit."""
    errors = ", ".join(f"{p.path.ratio} {p.rms[0]:.3g} / {p.rms[1]:.3g}" for p in paths)
    summary = f"RMS errors of strain along warp / fill in %: {errors}"
    return Findings(
        numbers={"ratios": {p.path.ratio: _numbers(p) for p in paths}},
        warnings=tuple(_warnings(test)),
        lines=(summary,),
        quality=summary,
        summary=summary,
    )


def _numbers(fitted: FittedPath) -> dict[str, Any]:
    path = fitted.path
    return {
        "rms_warp_percent": fitted.rms[0],
        "rms_fill_percent": fitted.rms[1],
        "matched": len(path.load),
        "cycle": path.cycle.number,
        "cycles": path.cycles,
        "end_load_warp_kN_per_m": float(path.load[-1, 0]),
        "end_load_fill_kN_per_m": float(path.load[-1, 1]),
        "residual_warp_percent": 100 * float(path.residual[0]),
        "residual_fill_percent": 100 * float(path.residual[1]),
    }


def _warnings(test: BiaxialTest) -> list[Note]:
    """What the data leave open before any fit."""
    words = (
        f"{test.name} pulls along the yarns only: it says nothing of G12, which rests on other "
        "tests or stays where its fit began"
    )
    notes = [Note(NoteKind.UNMATCHED, words)]
    said = dict.fromkeys(note for table in test.data.tables for note in table.source.notes)
    return notes + [Note(NoteKind.READING, words) for words in said]
