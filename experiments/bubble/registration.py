"""What is told of a registration: numbers, a table, a line, a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...data.fields import DisplacementField
from ...data.outline import Outline
from ...data.registration.register import Registration
from ...reports import Table, plot_registration
from ..exhibit import Output, Shown

PICTURE = "registration.png"

#: What each choice of the plane means.
PLANES = {
    "clamp": "through the points beyond the rim",
    "edge": "through the edge of the sheet",
    "camera": "the camera's own x and y",
}


def registration_numbers(found: Registration) -> dict[str, Any]:
    """For result.json."""
    seen = [m for m in found.motions if m.points]
    warp, rim, given = found.warp, found.rim, found.options
    return {
        "origin_mm": found.placement.origin.tolist(),
        "axes": found.placement.axes.tolist(),
        "plane": {"of": found.plane_of, "deviation_mm": found.flatness},
        "tilt_degrees": found.placement.tilt,
        "centre": "given" if rim is None else {"error_mm": rim.error},
        "warp_degrees": found.warp_angle,
        "warp": "given" if warp is None else {"error_degrees": warp.error, "clear": warp.clear},
        "clamp_motion": {
            "removed": bool(seen) and given.remove_clamp_motion,
            "shift_mm": [float(np.linalg.norm(m.shift)) for m in seen],
            "turn_degrees": [m.angle for m in seen],
        },
    }


def registration_table(found: Registration) -> Table:
    """What was found and what was given, step by step."""
    x, y, z = found.placement.origin
    rim, warp = found.rim, found.warp
    plane = f"tilted by {found.placement.tilt:.2f} degrees"
    how = PLANES[found.plane_of]
    if found.plane_of != "camera":
        how += f", which deviate by {found.flatness:.2g} mm"
    rows: list[list[object]] = [
        ["plane of the rim", plane, how],
        [
            "centre of the rim, mm",
            f"{x:.2f}, {y:.2f}, {z:.2f}",
            "given" if rim is None else f"found where the sheet does not rise, +- {rim.error:.2g}",
        ],
        [
            "warp, degrees from the camera's x",
            f"{found.warp_angle:.2f}",
            "given" if warp is None else _warp_words(found),
        ],
        ["motion of the clamp", *_motion_words(found)],
    ]
    note = "lengths and directions in the camera's coordinates"
    return Table("Registration", ["step", "value", "how"], rows, note)


def registration_line(found: Registration) -> str:
    """One line for the terminal."""
    x, y, z = found.placement.origin
    how = "given" if found.warp is None else f"+- {found.warp.error:.1g}"
    return (
        f"registration: centre {x:.2f}, {y:.2f}, {z:.2f} mm, tilt {found.placement.tilt:.2f}, warp "
        f"{found.warp_angle:.2f} degrees ({how})"
    )


def _warp_words(found: Registration) -> str:
    assert found.warp is not None
    if found.warp.clear is None:
        return f"found by the turn of the elliptic rim, +- {found.warp.error:.2g}"
    stiff = "stiffer" if found.options.warp_is_stiff else "softer"
    return (
        f"found by symmetry ({found.warp.clear:.0%} clear), +- {found.warp.error:.2g}; the "
        f"{stiff} of the two axes"
    )


def _motion_words(found: Registration) -> tuple[str, str]:
    seen = [m for m in found.motions if m.points]
    if not seen:
        return "not known", "no points beyond the rim all around"
    shift = max(float(np.linalg.norm(m.shift)) for m in seen)
    turn = max(m.angle for m in seen)
    removed = "removed" if found.options.remove_clamp_motion else "left in"
    return f"{shift:.3g} mm, {turn:.2g} degrees at most", removed


def registration_picture(
    fields: Sequence[DisplacementField], outline: Outline, out: Output
) -> Shown:
    """Maps of the reference height, where it was measured, and of the highest rise."""
    last = fields[-1]
    maps = [(f"rise at {1e3 * last.pressure:.4g} kPa, mm", last.displacement[:, 2])]
    if last.z is not None:
        maps.insert(0, ("reference height z, mm", last.z))
    plot_registration(out.path(PICTURE), last.points, maps, outline.edge())
    return out.name(PICTURE), "measured points in the test's coordinates, the rim, warp and fill"
