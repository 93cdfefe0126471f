"""The inflated bubble for the page: to turn, coloured by residual, strain or stress."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...reports import Shade, Solid, pack
from ...reports.maps import Shades
from ..fittable import FittedTest
from .charts import kilo
from .inflated import inflated_sheets
from .sheet_report import fitted_model

if TYPE_CHECKING:
    from .prepared import PreparedBubble

Array = NDArray[np.float64]

#: Signs of x and y of the parts of a whole: a quarter is seen four times.
WHOLE, QUARTERS = ((1, 1),), ((1, 1), (-1, 1), (-1, -1), (1, -1))
STRAINS = ("strain along the warp ε1", "strain along the fill ε2", "shear strain γ12")
STRESSES = ("stress along the warp σ1", "stress along the fill σ2", "shear stress τ12")


def bubble_solid(
    prepared: PreparedBubble, fitted: FittedTest, left: Sequence[Array | None]
) -> Solid:
    """The modelled surface at every pressure of the test.

    left : (nodes, 3) mm a pressure, between model and measurement; None where nothing is matched.
    """
    test, model = prepared.test, fitted_model(fitted)
    mesh, sheets = model.mesh, list(inflated_sheets(model, fitted.histories[0], fitted.law))
    signs = np.array(QUARTERS if test.symmetry == "quarter" else WHOLE, dtype=float)
    residual = np.tile(np.array([_sizes(own, mesh.quads) for own in left]), len(signs))
    shades = [Shade("residual, length", "mm", pack(residual))]
    fields = (
        (STRAINS, "1", np.array([sheet.strain for sheet in sheets])),
        (STRESSES, "MPa", np.array([sheet.stress for sheet in sheets])),
    )
    for names, unit, values in fields:
        every = _around(values, signs)
        for k, name in enumerate(names):
            ends: Shades = "about zero" if k == 2 else "from least"
            shades.append(Shade(name, unit, pack(every[..., k]), ends))
    points = mesh.points + np.array([sheet.displacement for sheet in sheets])
    around = [points * (sx, sy, 1.0) for sx, sy in signs]
    quads = [mesh.quads + k * len(mesh.points) for k in range(len(signs))]
    caption = (
        f"{test.name}: the modelled bubble; drag it, or use the arrow keys, to turn it. Strain is "
        "logarithmic, stress Cauchy stress, both in the middle of each element; the residual "
        "is the distance of modelled and measured, grey where nothing was measured."
    )
    alt = f"the inflated bubble of {test.name}, {points[-1, :, 2].max():.3g} mm high at the end"
    return Solid(
        f"{test.name} bubble", [kilo(sheet.pressure) for sheet in sheets], "pressure",
        pack(np.concatenate(around, axis=1)), pack(np.concatenate(quads)), shades, caption, alt,
    )  # fmt: skip


def _sizes(left: Array | None, quads: NDArray[np.intp]) -> Array:
    """(quads,) mm, mean over the corners; NaN where one of them has none."""
    if left is None:
        return np.full(len(quads), np.nan)
    return np.asarray(np.linalg.norm(left, axis=1)[quads].mean(axis=1))


def _around(values: Array, signs: Array) -> Array:
    """(frames, parts * quads, 3): a mirrored part is sheared the other way."""
    return np.concatenate([values * (1.0, 1.0, sx * sy) for sx, sy in signs], axis=1)
