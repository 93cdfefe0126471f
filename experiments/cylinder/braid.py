"""Describe how sensitive the load of a bent braided tube is to the angle of its braid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import BeamModel, BraidedWall
from ...solvers.membrane.solver import MembraneSolver
from .curve import loads_at

#: Angle from the axis, in degrees, at which a braid carries all of the axial force of the pressure,
#: and none is left to cords.
NEUTRAL_ANGLE = math.degrees(math.atan(math.sqrt(2.0)))
#: Difference from this angle, in degrees, up to which a small error of the angle matters.
SENSITIVE_RANGE = 3.3
#: A small error of a measured angle, in degrees.
ANGLE_ERROR = 0.5
#: Law that a solver asks for. The model does not use it: wall and cords have their own stiffness.
UNUSED_LAW = HypoelasticLaw.linear(1.0, 1.0, 1.0)


def is_near_neutral(model: object) -> bool:
    """Return whether a model is a braided tube with an angle near `NEUTRAL_ANGLE`."""
    if not isinstance(model, BeamModel) or not isinstance(model.section.wall, BraidedWall):
        return False
    return abs(model.section.wall.angle - NEUTRAL_ANGLE) < SENSITIVE_RANGE


def angle_sensitivity(model: BeamModel, load: np.ndarray, places: Mapping[str, float]) -> str:
    """Describe by how much half a degree of the braid's angle changes the load.

    Parameters
    ----------
    model : BeamModel
        Tube with a braid near `NEUTRAL_ANGLE`.
    load : (frames,) array
        Load of the model, N, from the inflated tube on.
    places : mapping of str to float
        Deflections by name, mm; the load is compared at the last one that is reached.

    Returns
    -------
    str
        A sentence without its first capital letter and full stop.
    """
    wall = model.section.wall
    assert isinstance(wall, BraidedWall)
    begin = (
        f"the braid's {wall.angle:g} degrees are near {NEUTRAL_ANGLE:.1f}, where it leaves no "
        "thrust to the cords"
    )
    reached = {n: f for n, f in loads_at(_deflections(model, load), load, places).items() if f}
    if not reached:
        return f"{begin}: the load depends much on the angle"
    place = list(reached)[-1]
    effects = []
    for error, words in ((-ANGLE_ERROR, "less"), (ANGLE_ERROR, "more")):
        other = _load_at(model, wall.angle + error, {place: places[place]})
        effect = "leaves no equilibrium"
        if other is not None:
            change = 100 * (other / reached[place] - 1)
            effect = f"changes the load at {place} by {change:+.0f} %"
        effects.append(f"half a degree {words} {effect}")
    return f"{begin}: {', '.join(effects)}; measure the angle"


def _load_at(model: BeamModel, angle: float, places: Mapping[str, float]) -> float | None:
    """Return the load (N) with another braid angle (degrees); None without an equilibrium."""
    assert isinstance(model.section.wall, BraidedWall)
    try:
        section = replace(model.section, wall=replace(model.section.wall, angle=angle))
        load = MembraneSolver().run(replace(model, section=section), UNUSED_LAW).load
    except (InputError, SolverFailure):
        return None
    assert load is not None
    return next(iter(loads_at(_deflections(model, load), load, places).values()))


def _deflections(model: BeamModel, load: np.ndarray) -> np.ndarray:
    return np.array([0.0, *model.deflections])[: len(load)]
