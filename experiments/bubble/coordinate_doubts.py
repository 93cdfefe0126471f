"""Doubts about a bubble's coordinates (origin, radius, tilt, warp) and about its units."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...readers.units import pressure_remedy, unit_doubt
from ..doubts import Doubt
from .measured_view import MeasuredView
from .placement import line_angle

ADVICE = "let a registration find the frame ([bubble.data.points.registration])"


@dataclass(frozen=True)
class CoordinateLimits:
    """Errors of the coordinate system beyond which it is doubted; lengths in radii of the rim.

    Beyond the limits `sure_` a doubt is sure.
    """

    height: float = 0.1  # median height of the sheet before the test
    edge: float = 0.03  # relative error of the clamp's radius
    sure_edge: float = 0.06
    centre: float = 0.035  # distance of the rim's centre from the origin
    sure_centre: float = 0.15
    small_centre: float = 0.015  # that distance where it exceeds `small_sigmas` standard errors
    small_sigmas: float = 20.0
    sigmas: float = 4.0  # standard errors that a distance or an angle must exceed
    tilt: float = 1.2  # degrees, angle of the mean motion from z
    sure_tilt: float = 8.0
    turn: float = 5.0  # degrees, turn of the yarns or of an elliptic rim
    min_clarity: float = 0.6  # smallest `Axes.clarity` of axes of symmetry that are judged
    strain_ratio: float = 1.1  # strain of the warp over that of the fill: seem to be swapped


COORDINATE_LIMITS = CoordinateLimits()


def camera_height(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt heights counted from somewhere else than the rim."""
    height = 0.0 if view.last.z is None else float(np.median(view.last.z))
    if not abs(height) < COORDINATE_LIMITS.height * view.outline.radius:
        text = f"the reference heights lie about z = {height:.4g} mm, not about the rim: {ADVICE}"
        yield Doubt("camera-frame", False, text)


def clamped_elsewhere(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt a radius that is not that of the edge beyond which points stand still."""
    edge = view.clamp
    if edge is None or abs(edge.scale - 1.0) < COORDINATE_LIMITS.edge:
        return
    outline = view.outline
    sizes = {"radius": outline.major}
    if not outline.round:
        sizes = {"major": outline.major, "minor": outline.minor}
    measured, stated = (
        " and ".join(f"{name} {scale * size:.3g} mm" for name, size in sizes.items())
        for scale in (edge.scale, 1.0)
    )
    text = (
        f"{edge.still_count} points of the clamp stand still, beyond an edge of {measured}; the "
        f"project says {stated}: {scale_words(edge.scale)}give that of the free disk inside the "
        "clamp"
    )
    text += ', or radius = "clamp" with a nominal_radius by a ruler' if outline.round else ""
    yield Doubt("radius", abs(edge.scale - 1.0) > COORDINATE_LIMITS.sure_edge, text)


def clamp_scale(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt a radius of the clamp in the data that is not the one by a ruler."""
    if view.nominal_radius is None:
        return
    scale = view.outline.radius / view.nominal_radius
    if abs(scale - 1.0) < COORDINATE_LIMITS.edge:
        return
    text = (
        f"the clamp's radius is {view.outline.radius:.4g} mm in the files and "
        f"{view.nominal_radius:.4g} mm by nominal_radius: {scale_words(scale)}correct the "
        "calibration or length_unit, which change displacements as much"
    )
    yield Doubt("radius", abs(scale - 1.0) > COORDINATE_LIMITS.sure_edge, text)


#: Factors by which scales are often wrong, and how they come about.
USUAL_FACTORS = {
    2.54: "inches for centimetres",
    25.4: "inches for millimetres",
    10.0: "centimetres for millimetres",
    1000.0: "metres for millimetres",
    7.0: "the spacing of a calibration plate taken for its width",
}


def scale_words(scale: float) -> str:
    """Return words on a scale of lengths that is not 1, with its cause where the factor is usual.

    Parameters
    ----------
    scale : float
        Measured length over the stated one.
    """
    words = f"the scale of the coordinates is wrong by a factor of {scale:.3g}"
    for factor, cause in USUAL_FACTORS.items():
        if min(abs(scale / factor - 1), abs(scale * factor - 1)) < 0.05:
            words += f" ({cause}?)"
    return f"{words}, or the radius is: measure it with a ruler; "


def off_centre(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt an origin that is not the rim's centre."""
    rim = view.clamp or view.rim
    if rim is None:
        return
    offset = float(np.hypot(rim.x, rim.y))
    radius = view.outline.radius
    large = max(COORDINATE_LIMITS.centre * radius, COORDINATE_LIMITS.sigmas * rim.error)
    small = max(COORDINATE_LIMITS.small_centre * radius, COORDINATE_LIMITS.small_sigmas * rim.error)
    if not offset < min(large, small):
        text = (
            f"the sheet rises about x = {rim.x:.3g}, y = {rim.y:.3g} mm (+- {rim.error:.2g}), not "
            f"about the origin: {ADVICE}"
        )
        yield Doubt("off-centre", offset > COORDINATE_LIMITS.sure_centre * radius, text)


def rise_tilted(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt a rise that is not along z: on average the sheet moves sideways."""
    motion = view.mean_motion
    if motion is None:
        return
    x, y, z = motion
    sideways = np.hypot(x, y)
    tilt = float(np.degrees(np.arctan2(sideways, abs(z)))) if z else 0.0
    if not tilt < COORDINATE_LIMITS.tilt:
        text = (
            f"the sheet moves along a line {tilt:.2g} degrees from z: its frame is tilted, or the "
            f"clamp moved; {ADVICE}"
        )
        yield Doubt("tilted", tilt > COORDINATE_LIMITS.sure_tilt, text)


def axes_turned(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt that warp and fill lie along x and y, or that an elliptic rim lies as it is said to."""
    if view.rim is None:
        return
    if not view.outline.round:
        angle = view.outline.angle
        turn = line_angle(view.rim.angle - angle)
        error = view.rim.turn_error
        text = (
            f"the sheet rises within an ellipse whose major axis lies {angle + turn:.3g} degrees "
            f"from x (+- {error:.2g}), not {angle:.3g}: is its angle right, and {ADVICE}"
        )
    elif view.axes is None or view.axes.clarity < COORDINATE_LIMITS.min_clarity:
        return
    else:
        turn = view.axes.misalignment
        error = view.axes.error
        text = (
            f"the fields are symmetric about axes {turn:.3g} degrees from x and y (+- "
            f"{error:.2g}): warp and fill lie there; {ADVICE}"
        )
    if not abs(turn) < max(COORDINATE_LIMITS.turn, COORDINATE_LIMITS.sigmas * error):
        yield Doubt("turned", False, text)


def yarns_swapped(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt warp and fill that seem swapped; an ellipse is strained more along its minor axis."""
    if not view.outline.round or not view.apexes:
        return
    if not view.expected.moduli or not view.expected.warp_is_stiffer:
        return
    warp, fill = view.apexes[-1].strain
    if len(view.apexes) > 1:
        # What the sheet's first shape adds to both frames cancels.
        warp = warp - view.apexes[0].strain[0]
        fill = fill - view.apexes[0].strain[1]
    if warp > COORDINATE_LIMITS.strain_ratio * fill > 0:
        text = (
            f"the centre is strained by {warp:.3g} along the warp and {fill:.3g} along the fill, "
            "and the bounds have the warp stiffer: warp and fill seem to be swapped"
        )
        yield Doubt("swapped", False, text)


@dataclass(frozen=True)
class UnitLimits:
    """Ranges of plausible lengths and moduli; lengths are in radii of the disk."""

    reach: tuple[float, float] = (0.2, 5.0)  # distance of the outermost point from the centre
    rise: tuple[float, float] = (0.004, 1.5)  # rise of the centre at the highest pressure
    modulus_factor: float = 1.1  # a modulus beyond its bounds by this factor is doubted
    min_strain: float = 0.002  # smaller strains are mostly due to the sheet's shape before the test
    contraction: float = 0.25  # Poisson's ratio, which is not known yet and matters little here


UNIT_LIMITS = UnitLimits()


def length_unit(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt mm taken for m, in places or in displacements."""
    reach = float(view.outline.share(view.last.points).max())
    rise = abs(float(view.rises[-1])) / view.outline.radius
    if not UNIT_LIMITS.reach[0] < reach < UNIT_LIMITS.reach[1]:
        text = (
            f"the outermost point is {reach:.3g} radii from the centre: are x and y in the length "
            "unit that is said, and is the radius right?"
        )
        yield Doubt("length-unit", True, text)
    if not UNIT_LIMITS.rise[0] < rise < UNIT_LIMITS.rise[1]:
        text = (
            f"the centre rises by {rise:.3g} radii at {view.highest_pressure} kPa: are the "
            "displacements in the length unit that is said (mm beside m)?"
        )
        yield Doubt("length-unit", True, text)


def pressure_unit(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt bar taken for kPa, or a wrong thickness, by the membrane force at the apex."""
    modulus = _apex_modulus(view)
    doubt = None
    if modulus is not None and view.expected.moduli:
        doubt = _modulus_doubt(view, modulus)
    problem = unit_doubt("pressure", 1e3 * view.last.pressure, "kPa", 1e-3)
    if doubt is None and problem:
        doubt = Doubt("pressure-unit", True, f"the highest pressure: {problem}")
    if doubt is not None:
        yield doubt


def _modulus_doubt(view: MeasuredView, modulus: float) -> Doubt | None:
    """Return a doubt about the pressure if a modulus (MPa) lies beyond the bounds."""
    expected = view.expected
    names = ("E1", "E2")
    beyond_bounds = expected.outside(modulus, names, UNIT_LIMITS.modulus_factor)
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


def _apex_modulus(view: MeasuredView) -> float | None:
    """Return a rough modulus of the sheet from equilibrium of the apex, MPa.

    None where the apex is unknown or hardly strained.
    """
    if not view.apexes:
        return None
    apex = view.apexes[-1]
    if not np.isfinite(apex.force) or 0.5 * sum(apex.strain) < UNIT_LIMITS.min_strain:
        return None
    return apex.stiffness * (1 - UNIT_LIMITS.contraction) / view.thickness
