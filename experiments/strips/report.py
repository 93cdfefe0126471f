"""What a finished fit means for a test of strips: RMS errors beside the specimens' scatter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...errors import InputError
from ...materials.forms.base import COMPONENTS
from ...meshes.mesh import middle_strain
from ...meshes.strip_models import UniaxialModel
from ...notes import Note, NoteKind
from ...reports.content import Table
from ...reports.moduli import moduli_together
from ...reports.strips import (
    OrderErrors,
    StripCurves,
    load_charts,
    order_charts,
    specimen_charts,
    strip_charts,
)
from ...reports.vega import save
from ...reports.vtu import write_vtu
from ...solvers.base import History
from ...writing import replacing
from ..kinds import Exhibit, Findings, FittedTest, Output, Shown
from .data import Strip
from .doubts import curves_of
from .polynomials import compare_orders
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


def misfit_table(strips: Sequence[FittedStrip]) -> Table:
    """Misfit strip by strip beside the specimens' scatter (Eqs 3.4 to 3.6)."""
    rows: list[list[object]] = []
    for fitted in strips:
        strip, polynomial = fitted.strip, fitted.strip.polynomial
        rows.append(
            [
                strip.direction,
                fitted.rms,
                strip.scatter,
                polynomial.r_squared if polynomial is not None else None,
                polynomial.rmse if polynomial is not None else None,
                len(fitted.objective.load),
                float(fitted.history.load[-1]),
            ]
        )
    header = ["strip", "RMS error, N", "scatter of specimens, N", "R² of polynomial",
              "its RMSE, N", "points matched", "load at the end, N"]  # fmt: skip
    note = (
        "RMS error: root mean square of modelled less measured load; scatter: standard deviation "
        "of the measured loads about the polynomial"
    )
    return Table("Misfit by strip", header, rows, note)


def load_table(strips: Sequence[FittedStrip]) -> pd.DataFrame:
    """Load curves of the model, and the polynomials where there are any (else NaN)."""
    parts = []
    for fitted in strips:
        u, polynomial = np.array(fitted.model.elongations), fitted.strip.polynomial
        parts.append(
            pd.DataFrame(
                {
                    "direction": fitted.direction,
                    "elongation_mm": u,
                    "engineering_strain": u / fitted.strip.gauge_length,
                    "model_N": fitted.history.load,
                    "polynomial_N": np.nan if polynomial is None else polynomial(u),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def residual_table(strips: Sequence[FittedStrip]) -> pd.DataFrame:
    """Every matched load: part, elongation_mm, quantity, measured, modelled, difference, unit."""
    parts = []
    for fitted in strips:
        modelled, measured = fitted.objective.modelled(fitted.history), fitted.objective.load
        parts.append(
            pd.DataFrame(
                {
                    "part": fitted.direction,
                    "elongation_mm": fitted.objective.elongation,
                    "quantity": "load",
                    "measured": measured,
                    "modelled": modelled,
                    "difference": modelled - measured,
                    "unit": fitted.objective.unit,
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


Array = NDArray[np.float64]
#: Name, elongation (mm), load (N).
Curve = tuple[str, Array, Array]

SMOOTH = 200  # places at which a polynomial is drawn
FINE = 121  # places at which a modulus is drawn
ORDERS = range(1, 9)


def load_panels(
    strips: Sequence[Strip],
    models: Mapping[str, Sequence[Curve]],
    rms: Mapping[str, Sequence[float]],
) -> list[StripCurves]:
    """What the panels of `load_charts` show; `models` and their `rms` (N) by direction."""
    panels = []
    for strip in strips:
        curve = None
        if strip.polynomial is not None:
            u = np.linspace(0.0, strip.elongation, SMOOTH)
            curve = u, strip.polynomial(u)
        panels.append(
            StripCurves(
                strip.direction,
                models.get(strip.direction, ()),
                strip.points if strip.curves else None,
                curve,
                strip.scatter,
                rms.get(strip.direction, ()),
            )
        )
    return panels


def draw_bias(model: UniaxialModel, history: History, picture: Path, vtu: Path) -> None:
    """The deformed strip with its shear strain as a picture and for ParaView."""
    u = history.displacement[-1]
    strain = middle_strain(model.mesh, u, model.warp)
    mesh = model.mesh
    gauge = mesh.node_sets["gauge"]
    save(picture, strip_charts(mesh.points, mesh.quads, u, strain[:, 2], gauge))
    write_vtu(mesh, u, vtu, cell_data={"log_strain_1_2_12": strain})


def draw_moduli(strips: Sequence[FittedStrip], fitted: FittedTest, picture: Path) -> None:
    """Moduli up to the strains at the end of the strips, in one picture (as Fig. 3.8)."""
    ends = failure_strains(strips, fitted.valid)
    strains = np.array([np.linspace(0.0, ends[c], FINE) for c in COMPONENTS.values()])
    curves = [fitted.law.modulus(name, x) for name, x in zip(COMPONENTS, strains, strict=True)]
    save(picture, moduli_together(strains, np.array(curves)))


def failure_strains(strips: Sequence[FittedStrip], valid: Array) -> Array:
    """(3,) logarithmic strain of warp and fill at the end, and shear strain in the bias gauge.

    valid : (3,) the ends up to which the moduli are fitted, which no strain shown exceeds; they
    take the place of a strip that is not there.
    """
    ends = np.array(valid, dtype=float)
    for fitted in strips:
        if fitted.direction == "bias":
            ends[2] = min(ends[2], _gauge_shear(fitted.model, fitted.history))
        else:
            component = 0 if fitted.direction == "warp" else 1
            ends[component] = min(ends[component], fitted.strip.strain)
    return ends


def _gauge_shear(model: UniaxialModel, history: History) -> float:
    """Largest shear strain of the quads between the gauge's ends."""
    strain = middle_strain(model.mesh, history.displacement[-1], model.warp)
    corners = model.mesh.points[model.mesh.quads][:, :, 1]
    low, high = model.mesh.points[model.mesh.node_sets["gauge"]][:, 1]
    inside = (corners.min(axis=1) > low - 1e-9) & (corners.max(axis=1) < high + 1e-9)
    return float(np.abs(strain[inside, 2]).max())


def draw_orders(strips: Sequence[Strip], picture: Path) -> bool:
    """Which order the load polynomials should have; False where there are no points to ask."""
    panels = []
    for strip in strips:
        if strip.polynomial is None:
            continue
        whose = strip.specimen_of.tolist()
        specimens = whose if len(set(whose)) > 1 else None
        try:
            scores = compare_orders(
                *strip.points, ORDERS, through_origin=strip.through_origin, specimens=specimens
            ).scores
        except InputError:  # too few points for the highest order, or at too few elongations
            continue
        panels.append(
            OrderErrors(
                strip.direction,
                [s.order for s in scores],
                [s.rmse for s in scores],
                [s.left_out for s in scores],
                strip.polynomial.order,
            )
        )
    if panels:
        save(picture, order_charts(panels))
    return bool(panels)


LOADS = "Load over gauge elongation: measured and modelled"
MATCHED = {"polynomial": "load polynomials", "points": "measured points"}


def exhibit(
    test: StripsTest, strips: Sequence[FittedStrip], fitted: FittedTest, out: Output
) -> Exhibit:
    """Write loads.csv, bias.vtu and the pictures; what the page says of them."""
    with replacing(out.path("loads.csv")) as path:
        load_table(strips).to_csv(path, index=False)
    panels = _panels(strips)
    charts = load_charts(f"{test.name} loads", panels, LOADS)
    save(out.path("loads.png"), charts)
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
        parts=[charts],
    )


def _panels(strips: Sequence[FittedStrip]) -> list[StripCurves]:
    """Load curves against what was measured."""
    models = {
        s.direction: [("model", np.array(s.model.elongations), s.history.load)] for s in strips
    }
    return load_panels([s.strip for s in strips], models, {s.direction: [s.rms] for s in strips})


CURVES = "curves.png"


def exhibit_examined(test: StripsTest, out: Output) -> Exhibit:
    """Write the curves; a table of what each specimen holds."""
    curves = {direction: curves_of(strip) for direction, strip in test.strips.items()}
    save(out.path(CURVES), specimen_charts(curves))
    rows: list[list[object]] = [
        [
            direction,
            name or "polynomial",
            len(load),
            float(elongation[0]),
            float(elongation[-1]),
            float(np.log1p(elongation[-1] / test.strips[direction].gauge_length)),
            float(load[0]),
            float(load.max()),
        ]
        for direction, specimens in curves.items()
        for name, elongation, load in specimens
    ]
    header = [
        "direction", "specimen", "points", "first elongation, mm", "last, mm", "last strain",
        "first load, N", "largest load, N",
    ]  # fmt: skip
    table = Table("Load curves as read", header, rows, text=(1,))
    return Exhibit(figures=[(out.name(CURVES), "load curves as they were read")], tables=[table])
