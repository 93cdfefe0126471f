"""Inflated cylinders in three-point bending as models: mesh, sections, bodies, schedule."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from ..errors import InputError
from ..meshes.cylinder import cylinder_mesh
from ..meshes.graded import Refinement
from .bodies import Collar, RigidSupports, usual_collar
from .cylinder import CylinderModel
from .gas import Gas
from .reading import CurveReading, curve_reading

#: mm, unless given; as many layers of fabric lie upon each other in the seam.
LENGTH, SEAM_WIDTH, SEAM_LAYERS = 3000.0, 40.0, 3
#: How far the collar goes, mm, and in how many equal steps, unless given.
DEFLECTION, FRAMES = 240.0, 60
#: Equal increments of pressure on inflation.
INFLATION = 10
#: Sides around the tube over mm of an element. How deep the collar dents the round tube at first is
#: what goes wrong with long ones, at its top and its sides alike (shorter ones at the top alone do
#: not help): with sides of 25 mm the load of the first millimetres was 3 % off that of fine meshes.
AROUND = 0.4
#: Elements next to collar and supports: mm along the axis over mm elsewhere, and mm beyond the
#: edge of the collar or to either side of a support in which they are that small. With half of it
#: the collar's mouth, whose edge is round with 10 mm, took hold of the wall row by row: the load
#: went up and down by 2 % with 25 mm elements, and fell by 4 % where the beam folds.
FINER, BESIDE_COLLAR, BESIDE_SUPPORT = 0.25, 15.0, 40.0


def inflated_cylinder(
    diameter: float,
    pressure: float,
    thickness: float,
    size: float,
    length: float = LENGTH,
    seam_width: float = SEAM_WIDTH,
    supports: RigidSupports | None = None,
    collar: Collar | None = None,
    deflections: Sequence[float] | None = None,
    symmetry: Literal["quarter", "full"] = "quarter",
    cap_warp: Literal["x", "y"] = "x",
    gas: Gas | None = None,
    reading: CurveReading | None = None,
) -> CylinderModel:
    """A cylinder that is inflated and bent.

    Parameters
    ----------
    diameter, length, seam_width : mm, before inflation. pressure : MPa, gauge.
    thickness : mm of one layer; the seam has three.
    size : mm of an element; around the tube 0.4 of that, and along it a quarter next to collar and
        supports.
    collar : `usual_collar` unless given.
    deflections : mm; 60 equal ones to 240 mm unless given, each an increment.
    reading : by the diameter unless given.

    Raises
    ------
    InputError : as `CylinderModel` and `cylinder_mesh`; a pressure or thickness not above zero.
    """
    for name, value in (("pressure", pressure), ("thickness", thickness)):
        if not 0 < value < math.inf:
            raise InputError(None, name, f"expected > 0, got {value!r}")
    supports = supports or RigidSupports()
    collar = collar or usual_collar(diameter)
    # Before the mesh is made, which would complain of rows where the supports are.
    if not supports.span + supports.diameter < length:
        problem = f"{supports.span:g} mm does not fit under {length:g} mm of cylinder"
        raise InputError(None, "supports.span", problem)
    fine = FINER * size
    zones = (
        Refinement("collar", 0.0, 0.5 * collar.length + BESIDE_COLLAR, fine),
        Refinement("support", 0.5 * supports.span, BESIDE_SUPPORT, fine),
    )
    mesh = cylinder_mesh(length, diameter, size, seam_width, symmetry, zones, cap_warp, AROUND)
    layers = np.ones(len(mesh.quads))
    if "seam" in mesh.element_sets:
        layers[mesh.element_sets["seam"]] = SEAM_LAYERS
    if deflections is None:
        deflections = np.linspace(0.0, DEFLECTION, FRAMES + 1)[1:].tolist()
    steps = np.linspace(0.0, pressure, INFLATION + 1)[1:].tolist()
    return CylinderModel(
        mesh,
        thickness * layers,
        steps,
        deflections,
        collar,
        supports,
        gas or Gas(),
        reading=reading or curve_reading(diameter),
    )
