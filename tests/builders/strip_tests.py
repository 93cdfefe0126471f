"""Strips whose specimens are straight lines."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from bubblefit.experiments.measured import FittedPart
from bubblefit.experiments.registry import presenter_of
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.load_objective import LoadObjective
from bubblefit.materials.law import HypoelasticLaw
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


def notes_on_directions(shares, compared_with, poissons_ratio=None):
    """Notes on strips whose modelled loads are these shares of the measured ones."""
    strip = WARP
    if poissons_ratio is not None:
        lateral = [-poissons_ratio * curve.elongation / 20 for curve in TWO]
        curves = [replace(c, lateral=x) for c, x in zip(TWO, lateral, strict=True)]
        strip = replace(WARP, curves=tuple(curves))
    parts = []
    for direction, share in {"warp": 1.0, **shares}.items():
        strip = replace(strip, direction=direction)
        measured = np.array([200.0, 400.0])
        history = SimpleNamespace(load=share * measured)
        objective = LoadObjective([2.0, 4.0], [2.0, 4.0], measured)
        parts.append(FittedPart(strip, None, objective, history))
    weights = dict.fromkeys(["warp", *shares], 1.0)
    test = SimpleNamespace(name="s", match_by="points", weights=weights, bias_angle=45.0)
    prepared = SimpleNamespace(test=test, seen=(), fitted_parts=lambda _: parts)
    law = HypoelasticLaw.linear(500.0, 200.0, 20.0)
    fitted = SimpleNamespace(compared_with=compared_with, law=law)
    return presenter_of("strips").findings(prepared, fitted).warnings
