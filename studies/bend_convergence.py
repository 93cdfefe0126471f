"""Refined cylinders and what converges: shape when inflated, stiffness, loads, buckling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np

from ..errors import InputError
from ..models.cylinder import CylinderModel
from ..projects.bend import BendCase
from ..solvers.base import History
from .bend_measures import PLACES, initial_stiffness, knee_point, limit_point
from .refinement import Curve


def refined_cylinder(
    case: BendCase, thickness: float, what: Literal["elements", "increments"], factor: float
) -> CylinderModel:
    """The case with edges, or with every increment of pressure and deflection, divided.

    Parameters
    ----------
    thickness : mm of one layer. factor : of increments a whole number, so that the reported
        deflections stay among them.

    Raises
    ------
    InputError : a mesh that cannot be had; increments to be joined.
    """
    if what == "elements":
        return replace(case, size=case.size / factor).model(thickness)
    if factor != int(factor):
        problem = "the cylinder's steps are divided, never joined: use --coarser 0"
        raise InputError(None, "increments", problem)
    model, parts = case.model(thickness), int(factor)
    return replace(
        model,
        inflation=_divided(model.inflation, parts),
        increments=_divided(model.increments, parts),
    )


def _divided(ends: Sequence[float], parts: int) -> list[float]:
    steps = [np.linspace(a, b, parts + 1)[1:] for a, b in pairwise((0.0, *ends))]
    return [float(value) for part in steps for value in part]


def deflection_curve(model: CylinderModel, history: History) -> Curve:
    """Deflection (mm) and load (N) from the inflated cylinder to where the run ended."""
    return np.array([0.0, *model.deflections])[: len(history.load)], history.load


def loads(model: CylinderModel, history: History) -> dict[str, float]:
    """Load (N) at 40, 100 and 240 mm, as far as the run went."""
    d, load = deflection_curve(model, history)
    reached = [p for p in PLACES if p <= d[-1] * (1 + 1e-9)]
    return {f"load at {p:g} mm, N": float(np.interp(p, d, load)) for p in reached}


def quantities(model: CylinderModel, history: History) -> dict[str, float]:
    """What a study of the mesh looks at; knee and limit point where the run has them."""
    mesh = model.mesh
    side = np.intersect1d(mesh.node_sets["side_line"], mesh.node_sets["mid_span"])
    wide = np.abs(mesh.points[side, 0] + history.displacement[0, side, 0]).max()
    found = {"radius sideways at mid-span, inflated, mm": float(wide)}
    if history.cavity_volume is not None:
        found["volume, inflated, l"] = 1e-6 * float(history.cavity_volume[0])
    d, load = deflection_curve(model, history)
    stiffness = initial_stiffness(d, load)
    if stiffness is not None:
        found["initial stiffness, N/mm"] = stiffness
    found |= loads(model, history)
    for name, point in (("knee", knee_point(d, load, stiffness)), ("limit", limit_point(d, load))):
        if point is not None:
            found[f"load at the {name} point, N"] = point[1]
    return found
