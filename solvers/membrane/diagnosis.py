"""Diagnosis of the embedded solver by its law on the bars."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...files import __version__
from ...materials.responses import bar
from ..bars import BARS, INCREMENTS, TOLERANCE, bar_law, difference
from ..base import Diagnosis

EMBEDDED = "embedded"


def diagnose(named: Path | str | None = None) -> list[Diagnosis]:
    """Return one entry, with the bars in the solver's increments; there is no program to name."""
    stresses = []
    for one in BARS:
        pulled = int(one.direction == "fill")
        ends = np.log1p(one.elongation * np.arange(1, INCREMENTS + 1) / INCREMENTS)
        stresses.append(float(bar(bar_law(one.model), pulled, ends)[1][-1, pulled]))
    off = difference(tuple(stresses))
    advice = "the embedded law is broken; install bubblefit and numba again"
    return [Diagnosis("membrane", __version__, None, EMBEDDED, True, None, off < TOLERANCE,
                      tuple(stresses), off, "" if off < TOLERANCE else advice)]  # fmt: skip
