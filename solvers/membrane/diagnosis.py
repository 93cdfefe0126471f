"""Diagnosis of the embedded solver by its law on the bars."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...files import __version__
from ...materials.law import HypoelasticLaw
from ...materials.responses import bar
from ..bars import BARS, INCREMENTS, TOLERANCE, bar_law, difference
from ..base import Diagnosis

EMBEDDED = "embedded"


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """Return one entry; there is no program to name."""
    stresses = tuple(
        _end_stress(bar_law(one.model), one.elongation, int(one.direction == "fill"))
        for one in BARS
    )
    off = difference(stresses)
    good = off < TOLERANCE
    advice = "" if good else "the embedded law is broken; install bubblefit and numba again"
    return [Diagnosis("membrane", __version__, None, EMBEDDED, True, None, good,
                      stresses, off, advice)]  # fmt: skip


def _end_stress(law: HypoelasticLaw, elongation: float, pulled: int) -> float:
    """Return the end stress (MPa) of a bar pulled along warp (0) or fill (1), by the law."""
    ends = np.log1p(elongation * np.arange(1, INCREMENTS + 1) / INCREMENTS)
    return float(bar(law, pulled, ends)[1][-1, pulled])
