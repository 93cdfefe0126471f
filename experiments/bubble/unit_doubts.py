"""Doubts about the units of a bubble's lengths and pressures."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...readers.unit_plausibility import pressure_remedy, unit_doubt
from ..doubts import Doubt, Expected
from .measured_view import View


@dataclass(frozen=True)
class UnitLimits:
    """Ranges of plausible lengths and moduli; lengths are in radii of the disk."""

    reach: tuple[float, float] = (0.1, 20.0)  # distance of the outermost point from the centre
    rise: tuple[float, float] = (0.004, 1.5)  # rise of the centre at the highest pressure
    modulus_factor: float = 1.1  # a modulus beyond its bounds by this factor is doubted
    min_strain: float = 0.002  # smaller strains are mostly due to the sheet's shape before the test
    contraction: float = 0.25  # Poisson's ratio, which is not known yet and matters little here


LIMITS = UnitLimits()


def length_unit(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt mm taken for m, in places or in displacements."""
    reach = float(view.outline.share(view.last.points).max())
    rise = abs(float(view.rises[-1])) / view.outline.radius
    if not LIMITS.reach[0] < reach < LIMITS.reach[1]:
        text = (
            f"the outermost point is {reach:.3g} radii from the centre: are x and y in the length "
            "unit that is said, and is the radius right?"
        )
        yield Doubt("length-unit", True, text)
    if not LIMITS.rise[0] < rise < LIMITS.rise[1]:
        text = (
            f"the centre rises by {rise:.3g} radii at {view.highest_pressure} kPa: are the "
            "displacements in the length unit that is said (mm beside m)?"
        )
        yield Doubt("length-unit", True, text)


def pressure_unit(view: View, expected: Expected) -> Iterator[Doubt]:
    """Doubt bar taken for kPa, or a wrong thickness, by the membrane force at the apex."""
    modulus = _apex_modulus(view)
    doubt = None
    if modulus is not None and expected.moduli:
        doubt = _modulus_doubt(view, expected, modulus)
    problem = unit_doubt("pressure", 1e3 * view.last.pressure, "kPa", 1e-3)
    if doubt is None and problem:
        doubt = Doubt("pressure-unit", True, f"the highest pressure: {problem}")
    if doubt is not None:
        yield doubt


def _modulus_doubt(view: View, expected: Expected, modulus: float) -> Doubt | None:
    """Return a doubt about the pressure if a modulus (MPa) lies beyond the bounds."""
    names = ("E1", "E2")
    beyond_bounds = expected.outside(modulus, names, LIMITS.modulus_factor)
    if not beyond_bounds:
        return None
    apex = view.apexes[-1]
    strain = 0.5 * sum(apex.strain)
    text = (
        f"equilibrium of the apex at {view.highest_pressure} kPa gives {apex.force:.3g} N/mm at a "
        f"strain of {strain:.3g}, a modulus of about {beyond_bounds}: is the pressure in the unit "
        "that is said (bar beside kPa), and are thickness and lengths right?"
    )
    text += pressure_remedy(modulus, expected.limits(names))
    return Doubt("pressure-unit", bool(expected.outside(modulus, names)), text)


def _apex_modulus(view: View) -> float | None:
    """Return a rough modulus of the sheet from equilibrium of the apex, MPa.

    None where the apex is unknown or hardly strained.
    """
    if not view.apexes:
        return None
    apex = view.apexes[-1]
    if not np.isfinite(apex.force) or 0.5 * sum(apex.strain) < LIMITS.min_strain:
        return None
    return apex.stiffness * (1 - LIMITS.contraction) / view.thickness
