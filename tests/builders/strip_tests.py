"""Strips whose specimens are straight lines."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from bubblefit.experiments.strips.data import Strip
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial

# Results whose numbers are known
WAY = np.array([2.0, -0.5, 1.0, 4.0, 4.5, 0.0])


TWO = (
    LoadCurve("warp", "1", WAY, 100 * WAY, Path("w.csv"), notes=("a note", "another")),
    LoadCurve("warp", "2", WAY[:3], 120 * WAY[:3], None, notes=("a note",)),
)


LINE = fit_load_polynomial(np.linspace(0, 4, 9), 110 * np.linspace(0, 4, 9), 1)


WARP = Strip("warp", 20.0, 24.0, LINE, TWO, scatter=7.5)


BIAS = replace(WARP, direction="bias", scatter=None, curves=(), polynomial=None)
