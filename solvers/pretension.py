"""Sheets that are clamped under tension: their strain before the test, and its derivatives.

The stress-free sheet is smaller than its clamp. By how much follows from the law: its force per
width at the strains of the clamped sheet, in one increment, is the tension.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import SolverFailure
from ..materials.law import HypoelasticLaw, law_beside, usual_step
from ..meshes.bubble_model import SLACK, TENSION, THICKNESS, BubbleModel
from ..meshes.mesh import Array

#: Relative change of the moduli in differences of the force by constants of the law.
DIFFERENCE = 1e-4
MAX_ITERATIONS = 50
#: Log strain beyond which no sheet is clamped.
MAX_STRAIN = 2.0
#: Error of the force, as a share of the moduli times the thickness, at which the strain is found.
TOLERANCE = 1e-13


def force_per_width(law: HypoelasticLaw, thickness: float, strain: Array) -> tuple[Array, Array]:
    """Return the force per width of the stretched sheet, N/mm, and its derivatives by strain.

    Parameters
    ----------
    law : HypoelasticLaw
    thickness : float, mm
        Thickness without stress.
    strain : (2,) array
        Log strains along warp and fill, reached in one increment.

    Returns
    -------
    force : (2,) ndarray, N/mm
    stiffness : (2, 2) ndarray, N/mm
    """
    zero = np.zeros((1, 3))
    stress, tangent = law.increment(zero, np.append(strain, 0.0), zero)
    power = law.area_power - 1.0
    current_thickness = thickness * np.exp(power * strain.sum())
    force = current_thickness * stress[0, :2]
    return force, current_thickness * tangent[0, :2, :2] + power * force[:, None]


def clamped_strain(law: HypoelasticLaw, thickness: float, tension: Array) -> Array:
    """Return the log strains (2,) of a sheet clamped under tension (2,), N/mm; SolverFailure."""
    strain = np.zeros(2)
    for _ in range(MAX_ITERATIONS):
        force, stiffness = force_per_width(law, thickness, strain)
        if np.abs(force - tension).max() <= TOLERANCE * np.abs(stiffness).max():
            return strain
        strain = strain - np.linalg.solve(stiffness, force - tension)
        if not np.abs(strain).max() < MAX_STRAIN:
            break
    words = " and ".join(f"{value:g}" for value in tension)
    raise SolverFailure(f"the law carries no tension of {words} N/mm in warp and fill")


def stretched(model: BubbleModel, law: HypoelasticLaw) -> BubbleModel:
    """Return a model whose tension is replaced by the slack, below zero, that it makes."""
    if not any(model.tension):
        return model
    strain = clamped_strain(law, model.thickness, np.array(model.tension))
    warp, fill = (1.0 + np.array(model.slack)) * np.exp(-strain) - 1.0
    return replace(model, slack=(float(warp), float(fill)), tension=(0.0, 0.0))


def slack_slopes(model: BubbleModel, law: HypoelasticLaw, parameters: Sequence[str]) -> Array:
    """Return the derivatives (2, n) of the slack of `stretched` by n parameters."""
    strain = clamped_strain(law, model.thickness, np.array(model.tension))
    length = (1.0 + np.array(model.slack)) * np.exp(-strain)
    force, stiffness = force_per_width(law, model.thickness, strain)
    slopes = np.zeros((2, len(parameters)))
    for column, name in enumerate(parameters):
        if name in SLACK:
            axis = SLACK.index(name)
            slopes[axis, column] = np.exp(-strain[axis])
            continue
        by_tension = np.zeros(2)
        if name in TENSION:
            by_tension[TENSION.index(name)] = 1.0
        elif name == THICKNESS:
            by_tension = -force / model.thickness
        elif name == "nu12" or name.startswith("beta_"):
            by_tension = -_force_slope(law, model.thickness, strain, name)
        slopes[:, column] = -length * np.linalg.solve(stiffness, by_tension)
    return slopes


def _force_slope(law: HypoelasticLaw, thickness: float, strain: Array, name: str) -> Array:
    """Return the derivatives (2,) of the force per width by a constant of the law.

    Parameters
    ----------
    strain : (2,) array
        Log strains along warp and fill.
    """
    step = usual_step(law, name, thickness, DIFFERENCE)
    higher, lower = (
        force_per_width(law_beside(law, name, sign * step), thickness, strain)[0]
        for sign in (1.0, -1.0)
    )
    return (higher - lower) / (2.0 * step)
