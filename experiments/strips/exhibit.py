"""What a test of strips puts on the page of a fit, and the files that it writes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...reports import StripCurves, plot_loads
from ...reports.load_charts import load_charts
from ...writing import replacing
from ..exhibit import Exhibit, Output, Shown
from ..fittable import FittedTest
from .figures import draw_bias, draw_moduli, draw_orders, load_panels
from .prepared import FittedStrip
from .tables import load_table, misfit_table
from .test import StripsTest

LOADS = "Load over gauge elongation: measured and modelled"
MATCHED = {"polynomial": "load polynomials", "points": "measured points"}


def exhibit(
    test: StripsTest, strips: Sequence[FittedStrip], fitted: FittedTest, out: Output
) -> Exhibit:
    """Write loads.csv, bias.vtu and the pictures; what the page says of them."""
    with replacing(out.path("loads.csv")) as path:
        load_table(strips).to_csv(path, index=False)
    panels = _panels(strips)
    plot_loads(out.path("loads.png"), panels)
    figures: list[Shown] = []
    files = [
        (out.name("loads.csv"), "load curves of the best fit"),
        (out.name("loads.png"), "picture of the load curves"),
    ]
    for strip in strips:
        if strip.direction == "bias":
            picture, vtu = out.path("bias.png"), out.path("bias.vtu")
            draw_bias(strip.model, strip.history, picture, vtu)
            figures.append((out.name("bias.png"), "The bias strip at the end, and its shear"))
            files.append((out.name("bias.vtu"), "the deformed bias strip, for ParaView"))
    draw_moduli(strips, fitted, out.path("failure.png"))
    caption = "Tangent moduli up to the strains at the end of each strip"
    figures.append((out.name("failure.png"), caption))
    if draw_orders([s.strip for s in strips], out.path("orders.png")):
        caption = "Error of load polynomials by order, and with a specimen left out"
        figures.append((out.name("orders.png"), caption))
    return Exhibit(
        facts=[("matched", MATCHED[test.match_by])],
        figures=figures,
        tables=[misfit_table(strips)],
        files=files,
        parts=[load_charts(f"{test.name} loads", panels, LOADS)],
    )


def _panels(strips: Sequence[FittedStrip]) -> list[StripCurves]:
    """Load curves against what was measured."""
    models = {
        s.direction: [("model", np.array(s.model.elongations), s.history.load)] for s in strips
    }
    return load_panels([s.strip for s in strips], models, {s.direction: [s.rms] for s in strips})
