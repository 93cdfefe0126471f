"""Pictures of strips: load curves, the deformed bias strip, moduli, orders of the polynomials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...data.polynomial_order import compare_orders
from ...errors import InputError
from ...materials.forms.base import COMPONENTS
from ...meshes.strain import middle_strain
from ...models.uniaxial import UniaxialModel
from ...reports import (
    OrderErrors,
    StripCurves,
    plot_moduli_together,
    plot_orders,
    plot_strip,
    write_vtu,
)
from ...solvers.base import History
from ..fittable import FittedTest
from .prepared import FittedStrip
from .strip import Strip

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
    """What the panels of `plot_loads` show; `models` and their `rms` (N) by direction."""
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
    plot_strip(picture, mesh.points, mesh.quads, u, strain[:, 2], mesh.node_sets["gauge"])
    write_vtu(mesh, u, vtu, cell_data={"log_strain_1_2_12": strain})


def draw_moduli(strips: Sequence[FittedStrip], fitted: FittedTest, picture: Path) -> None:
    """Moduli up to the strains at the end of the strips, in one picture (as Fig. 3.8)."""
    ends = failure_strains(strips, fitted.valid)
    strains = np.array([np.linspace(0.0, ends[c], FINE) for c in COMPONENTS.values()])
    curves = [fitted.law.modulus(name, x) for name, x in zip(COMPONENTS, strains, strict=True)]
    plot_moduli_together(picture, strains, np.array(curves))


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
        plot_orders(picture, panels)
    return bool(panels)
