"""What is told of the sheet as it was: numbers, lines, a warning, tables, pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...models.bubble import BubbleModel
from ...notes import Note, NoteKind
from ...reports import plot_disk
from ...writing import replacing
from ..exhibit import Output, Shown
from ..fittable import FittedTest
from .objective import FieldObjective
from .sheet_section import DIRECTIONS

if TYPE_CHECKING:
    from .prepared import PreparedBubble

Array = NDArray[np.float64]

PICTURE, TABLE = "reference_surface.png", "reference_surface.csv"
CONSTANT_PICTURE, CONSTANT_TABLE = "constant_field.png", "constant_field.csv"
NOT_BELIEVED = (
    "the moduli of this test are not to be believed: the sheet is taken for flat and taut in the "
    "reference picture, as a real one is not, which has moved E1 by a factor of up to eight; let "
    "[bubble.sheet] take the measured surface, look for modes, or take out a constant field"
)


def fitted_model(fitted: FittedTest) -> BubbleModel:
    """The model with its parameters as the fit found them."""
    (comparison,) = fitted.comparisons
    model: BubbleModel = comparison.model
    own = [n for n in comparison.nuisance if n.model_parameter is not None]
    values = {str(n.model_parameter): n.scale * fitted.nuisance[n.name] for n in own}
    return model.with_parameters(values)


def sheet_numbers(prepared: PreparedBubble, fitted: FittedTest) -> dict[str, Any]:
    """For result.json; lengths mm, slack %."""
    sheet, model = prepared.test.sheet, fitted_model(fitted)
    heights, surface = model.mesh.points[:, 2], prepared.sheet.surface
    moved = model.rim_motion
    numbers: dict[str, Any] = {
        "used": _used(prepared),
        "surface_mm": {"least": float(heights.min()), "largest": float(heights.max())},
        "measured_rms_mm": None if surface is None else float(surface.rms[0]),
        "modes_mm": {name: fitted.nuisance[name] for name in model.modes},
        "slack_percent": [100 * s for s in model.slack] if sheet.slack else None,
        "rim_motion_mm": None if moved is None else float(np.linalg.norm(moved, axis=2).max()),
        "constant_field_rms_mm": None,
        "from_pressure_kPa": None,
    }
    if sheet.constant:
        field = _constant(fitted)[1]
        rms = np.sqrt(np.mean(field**2, axis=0))
        numbers["constant_field_rms_mm"] = {DIRECTIONS[k]: float(rms[k]) for k in sheet.constant}
    if sheet.since is not None:
        numbers["from_pressure_kPa"] = 1e3 * prepared.test.pressures[sheet.since]
    return numbers


def sheet_lines(numbers: dict[str, Any]) -> list[str]:
    """For the terminal: which of them the fit used, each with its size."""
    words = []
    surface = numbers["surface_mm"]
    if numbers["measured_rms_mm"] is not None:
        words.append(f"measured surface (followed to {numbers['measured_rms_mm']:.2g} mm RMS)")
    if numbers["modes_mm"]:
        words.append(f"{len(numbers['modes_mm'])} modes of the surface")
    if words:
        words.append(f"z0 from {surface['least']:.2f} to {surface['largest']:.2f} mm")
    if numbers["slack_percent"] is not None:
        warp, fill = numbers["slack_percent"]
        words.append(f"slack {warp:.3f} % in warp, {fill:.3f} % in fill")
    if numbers["rim_motion_mm"] is not None:
        words.append(f"rim as measured, up to {numbers['rim_motion_mm']:.2f} mm")
    if numbers["constant_field_rms_mm"] is not None:
        sizes = numbers["constant_field_rms_mm"].items()
        taken = ", ".join(f"{name} {size:.2f} mm RMS" for name, size in sizes)
        words.append(f"constant field taken out: {taken}")
    if numbers["from_pressure_kPa"] is not None:
        words.append(f"displacements counted from {numbers['from_pressure_kPa']:.4g} kPa")
    return ["sheet: " + ("; ".join(words) if words else "flat and taut, its rim fixed")]


def sheet_warnings(prepared: PreparedBubble) -> list[Note]:
    """A real test of which nothing is known of the sheet's shape."""
    if prepared.known is not None or prepared.test.sheet.known:
        return []
    return [Note(NoteKind.FLAT_SHEET, NOT_BELIEVED)]


def sheet_exhibit(
    prepared: PreparedBubble, fitted: FittedTest, out: Output
) -> tuple[list[Shown], list[Shown]]:
    """Figures and files of the surface and of a constant field, where there are any."""
    figures, files = [], []
    sheet, edge = prepared.test.sheet, prepared.test.outline.edge()
    if sheet.measured or sheet.modes:
        points = fitted_model(fitted).mesh.points
        _write(out, TABLE, {"x_mm": points[:, 0], "y_mm": points[:, 1], "z0_mm": points[:, 2]})
        plot_disk(out.path(PICTURE), [("z0, mm", points[:, :2], points[:, 2])], edge)
        how = " and ".join(w for w in _used(prepared) if w in ("measured surface", "modes"))
        words = "surface of the sheet in the reference picture"
        figures.append((out.name(PICTURE), f"{prepared.test.name}: {words} ({how})"))
        files.append((out.name(TABLE), f"{words}, node by node"))
    if sheet.constant:
        places, field = _constant(fitted)
        own = [(f"{DIRECTIONS[k]}, mm", places, field[:, k]) for k in sheet.constant]
        columns = {f"{DIRECTIONS[k]}_mm": field[:, k] for k in sheet.constant}
        _write(out, CONSTANT_TABLE, {"x_mm": places[:, 0], "y_mm": places[:, 1], **columns})
        plot_disk(out.path(CONSTANT_PICTURE), own, edge)
        words = "measured less modelled, as far as it is the same at all pressures"
        figures.append((out.name(CONSTANT_PICTURE), f"Taken out of the fit: {words}"))
        files.append((out.name(CONSTANT_TABLE), f"{words}, point by point"))
    return figures, files


def _used(prepared: PreparedBubble) -> list[str]:
    sheet = prepared.test.sheet
    return [
        words
        for words, on in (
            ("measured surface", sheet.measured),
            ("modes", sheet.modes),
            ("slack", sheet.slack),
            ("measured rim", sheet.moving_rim),
            ("constant field", sheet.constant),
            ("loaded reference frame", sheet.since is not None),
        )
        if on
    ]


def _constant(fitted: FittedTest) -> tuple[Array, Array]:
    """Places (n, 2) mm and the field (n, 3) mm that was taken out there."""
    (comparison,) = fitted.comparisons
    objective = comparison.objective
    assert isinstance(objective, FieldObjective)
    field = objective.constant_field(fitted.histories[0].displacement, fitted.nuisance)
    places = np.zeros((len(field), 2))
    for target in objective.targets:
        places[target.places] = target.at(comparison.model.mesh.points[:, :2])
    return places, field


def _write(out: Output, name: str, columns: dict[str, Array]) -> None:
    with replacing(out.path(name)) as path:
        pd.DataFrame(columns).to_csv(path, index=False, float_format="%.6g")
