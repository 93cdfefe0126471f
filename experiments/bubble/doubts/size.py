"""Wrong units: lengths against the radius, pressure against the equilibrium of the apex."""

from __future__ import annotations

import numpy as np

from ...doubts import Doubt, Expected
from .view import View

#: Of the radius: the rise of a bubble at its highest pressure is somewhere between.
LEAST_RISE, MOST_RISE = 0.004, 1.5
#: Of the radius: how far from the centre the outermost point is.
LEAST_REACH, MOST_REACH = 0.1, 20.0
#: Of a biaxial stress and strain: Poisson's ratio is not known yet, and matters little here.
RATIO = 0.25
#: Below this mean strain the first shape of the sheet decides what looks like strain.
TELLING = 0.002


def length_unit(view: View, expected: Expected) -> list[Doubt]:
    """mm beside m, in places or in displacements."""
    reach = float(view.outline.share(view.last.points).max())
    rise = abs(float(view.rises[-1])) / view.radius
    found = []
    if not LEAST_REACH < reach < MOST_REACH:
        found.append(
            f"the outermost point is {reach:.3g} radii from the centre: are x and y in the length "
            "unit that is said, and is the radius right?"
        )
    if not LEAST_RISE < rise < MOST_RISE:
        found.append(
            f"the centre rises by {rise:.3g} radii at {_kilo(view)} kPa: are the displacements in "
            "the length unit that is said (mm beside m)?"
        )
    return [Doubt("length-unit", True, text) for text in found]


def pressure_unit(view: View, expected: Expected) -> list[Doubt]:
    """bar beside kPa, or a wrong thickness: n1 k1 + n2 k2 = p gives the force without a model."""
    if not view.apexes or not expected.moduli:
        return []
    top = view.apexes[-1]
    mean = 0.5 * sum(top.strain)
    if not np.isfinite(top.force) or mean < TELLING:
        return []
    modulus = top.stiffness * (1 - RATIO) / view.thickness
    far = expected.outside(modulus, ("E1", "E2"))
    if not far:
        return []
    text = (
        f"equilibrium of the apex at {_kilo(view)} kPa gives {top.force:.3g} N/mm at a strain of "
        f"{mean:.3g}, a modulus of about {far}: is the pressure in the unit that is said (bar "
        "beside kPa), and are thickness and lengths right?"
    )
    return [Doubt("pressure-unit", True, text)]


def _kilo(view: View) -> str:
    return f"{1e3 * view.last.pressure:.4g}"
