"""Coordinates that are not the test's: shifted, tilted, turned, warp and fill swapped."""

from __future__ import annotations

import numpy as np

from ....data.registration.directions import line_angle
from ...doubts import Doubt, Expected
from .view import View

ADVICE = "let a registration find the frame ([bubble.data.points.registration])"
#: Of the radius: a centre, or a sheet's height, further off is no small thing.
OFF, FAR_OFF, HIGH = 0.035, 0.15, 0.1
#: Degrees.
TILT, STEEP = 1.2, 8.0
TURN = 5.0
#: Standard errors that a place or an angle must be off by.
SURE = 4.0
#: How clear axes must be, and how much more the warp must be strained than the fill.
CLEAR, MORE = 0.6, 1.1


def camera_height(view: View, expected: Expected) -> list[Doubt]:
    """Heights counted from somewhere else than the rim."""
    if view.last.z is None:
        return []
    height = float(np.median(view.last.z))
    if abs(height) < HIGH * view.radius:
        return []
    text = f"the reference heights lie about z = {height:.4g} mm, not about the rim: {ADVICE}"
    return [Doubt("camera-frame", False, text)]


def off_centre(view: View, expected: Expected) -> list[Doubt]:
    """The rim's centre is not the origin."""
    if view.rim is None:
        return []
    off = float(np.hypot(view.rim.x, view.rim.y))
    if off < max(OFF * view.radius, SURE * view.rim.error):
        return []
    text = (
        f"the sheet rises about x = {view.rim.x:.3g}, y = {view.rim.y:.3g} mm (+- "
        f"{view.rim.error:.2g}), not about the origin: {ADVICE}"
    )
    return [Doubt("off-centre", off > FAR_OFF * view.radius, text)]


def tilted(view: View, expected: Expected) -> list[Doubt]:
    """The rise is not along z: on average the sheet moves sideways."""
    last = view.last
    inner = view.inner(last)
    if not inner.any():
        return []
    x, y, z = last.displacement[inner].mean(axis=0) - view.fields[0].displacement[
        view.inner(view.fields[0])
    ].mean(axis=0) * (len(view.fields) > 1)
    tilt = float(np.degrees(np.arctan2(np.hypot(x, y), abs(z)))) if z else 0.0
    if tilt < TILT:
        return []
    text = (
        f"the sheet moves along a line {tilt:.2g} degrees from z: its frame is tilted, or the "
        f"clamp moved; {ADVICE}"
    )
    return [Doubt("tilted", tilt > STEEP, text)]


def turned(view: View, expected: Expected) -> list[Doubt]:
    """Warp and fill are not along x and y."""
    if not view.outline.round:
        return _turned_rim(view)
    if view.axes is None or view.axes.clear < CLEAR or view.rim is None:
        return []
    if abs(view.axes.off) < max(TURN, SURE * view.axes.error):
        return []
    text = (
        f"the fields are symmetric about axes {view.axes.off:.3g} degrees from x and y (+- "
        f"{view.axes.error:.2g}): warp and fill lie there; {ADVICE}"
    )
    return [Doubt("turned", False, text)]


def _turned_rim(view: View) -> list[Doubt]:
    """An elliptic rim does not lie where it is said to."""
    if view.rim is None:
        return []
    said = view.outline.angle
    off = line_angle(view.rim.angle - said)
    if abs(off) < max(TURN, SURE * view.rim.turn_error):
        return []
    text = (
        f"the sheet rises within an ellipse whose major axis lies {said + off:.3g} degrees from x "
        f"(+- {view.rim.turn_error:.2g}), not {said:.3g}: is its angle right, and {ADVICE}"
    )
    return [Doubt("turned", False, text)]


def swapped(view: View, expected: Expected) -> list[Doubt]:
    """Warp and fill for one another, by the bounds of the moduli.

    An ellipse is strained more along its minor axis, whatever the law.
    """
    if not view.outline.round:
        return []
    if not view.apexes or not expected.moduli or not expected.warp_is_stiffer:
        return []
    warp, fill = view.apexes[-1].strain
    if len(view.apexes) > 1:
        # What the sheet's first shape adds to both frames cancels.
        warp, fill = warp - view.apexes[0].strain[0], fill - view.apexes[0].strain[1]
    if not warp > MORE * fill > 0:
        return []
    text = (
        f"the centre is strained by {warp:.3g} along the warp and {fill:.3g} along the fill, and "
        "the bounds have the warp stiffer: warp and fill seem to be swapped"
    )
    return [Doubt("swapped", False, text)]
