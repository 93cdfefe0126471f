"""Supports and collar as rigid surfaces of four-point patches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...models.cylinder import CylinderModel
from ..rigid import collar_body, support_body

Array = NDArray[np.float64]

#: mm that the support reaches into the inflated cylinder, so that it touches; that the collar
#: begins above it, so that it does not; and that the support waits below while it is inflated.
INTO, ABOVE, BELOW = 0.02, 0.5, 50.0
SUPPORT_PATH, COLLAR_PATH = 2, 3
UP = [0.0, 1.0, 0.0]


def contact_bodies(model: CylinderModel, inflated: Array) -> list[dict[str, Any]]:
    """Support, then collar: name, table of the path, patches (n, 12) towards the cylinder.

    Parameters
    ----------
    inflated : (nodes, 3) mm of displacement of the inflated cylinder.

    Raises
    ------
    InputError : a whole cylinder, whose bodies this does not make.
    """
    if model.copies != 4:
        problem = "Marc's deck bends a quarter; mesh it as 'quarter'"
        raise InputError(None, "symmetry", problem)
    mesh = model.mesh
    at, under = mesh.points + inflated, mesh.node_sets["support_bottom"]
    radius = float(np.abs(mesh.points[:, 1]).max())
    support = support_body(model.supports, radius, float(at[under, 1].min()) + INTO)
    collar = collar_body(model.collar, at, ABOVE)
    return [
        {
            "name": name,
            "path": path,
            "direction": UP,
            "patches": body.faces.reshape(-1, 12).tolist(),
        }
        for name, path, body in (
            ("support", SUPPORT_PATH, support),
            ("collar", COLLAR_PATH, collar),
        )
    ]


def paths(inflation: int, deflections: Sequence[float]) -> tuple[list[float], list[float]]:
    """Heights (mm) of support and collar over their places, at times 0, 1, 2, ...

    inflation : increments of it; one more brings the support up, then the collar goes down.
    """
    bent = len(deflections)
    support = [-BELOW] * (inflation + 1) + [0.0] * (1 + bent)
    collar = [0.0] * (inflation + 2) + [-(ABOVE + d) for d in deflections]
    return support, collar
