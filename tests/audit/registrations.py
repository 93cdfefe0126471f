"""Auditor of the registration of measured frames within a fit: places in the test's axes."""

import numpy as np

from .fields import axes_of, centre_of, frames_of
from .ledger import NUM


def audit(bubble):
    """Audit origin and axes by residuals.csv, and all that is said of them."""
    ledger, numbers = bubble.ledger, bubble.numbers["registration"]
    path = (*bubble.path, "registration")
    origin, axes = np.array(numbers["origin_mm"]), np.array(numbers["axes"])
    if not np.allclose(axes @ axes.T, np.eye(3), atol=1e-9) or np.linalg.det(axes) < 0:
        ledger.find("result.json: registration.axes", "are no rotation")
    tilt = float(np.degrees(np.arccos(np.clip(axes[2, 2], -1.0, 1.0))))
    warp = float(np.degrees(np.arctan2(axes[0, 1], axes[0, 0])))
    ledger.json((*path, "tilt_degrees"), tilt, abs=1e-6)
    off = (numbers["warp_degrees"] - warp + 90.0) % 180.0 - 90.0
    ledger.json((*path, "warp_degrees"), numbers["warp_degrees"] - off, abs=0.05)
    for key in ("origin_mm", "axes", "plane", "centre", "warp", "clamp_motion"):
        ledger.claim_json((*path, key), "consistent")
    frames = _frames(bubble, origin, axes)
    if frames is not None:
        _placed(bubble, frames)
        _centre_and_axes(bubble, numbers, frames)
    _said(bubble, numbers)


def _frames(bubble, origin, axes):
    """Return the frames in the axes of the test, as `checks.Bubble` has them; None if not plain."""
    points = bubble.section.get("data", {}).get("points", {})
    settings = points.get("registration") or {}
    if "filter" in points or "sheet" in bubble.section or settings.get("remove_clamp_motion"):
        return None
    frames = frames_of(bubble.folder, bubble.section)
    if frames is None:
        return None
    placed = []
    for name, places, moved, heights in frames:
        x, y, z = ((np.column_stack([places, heights]) - origin) @ axes.T).T
        placed.append((name, None, np.column_stack([x, y]), moved @ axes.T, z))
    return placed


def _placed(bubble, frames):
    """Measured values of residuals.csv are those of the files, in the axes of the test."""
    for (name, _, places, moved, _), (frame, rows) in zip(frames, bubble.frames, strict=True):
        for k, axis in enumerate(("dx", "dy", "dz")):
            part = rows[rows["quantity"] == axis]
            matched = part[["x_mm", "y_mm"]].to_numpy(float)
            nearest = np.argmin(np.hypot(*(matched[:, None] - places[None]).transpose(2, 0, 1)), 1)
            place = f"residuals.csv: {bubble.test}, frame {frame}, {axis}"
            if not np.allclose(places[nearest], matched, atol=1e-6):
                bubble.ledger.find(place, f"places are not those of {name} in the test's axes")
            elif not np.allclose(moved[nearest, k], part["measured"], atol=1e-6):
                bubble.ledger.find(place, f"is not that of {name} in the test's axes")


def _centre_and_axes(bubble, numbers, frames):
    """What was found: the sheet rises about the origin, and its axes are the yarns'."""
    place = f"result.json: {bubble.test}.registration"
    radius = bubble.section["radius"]
    error = numbers.get("centre", {}).get("error_mm")
    if error is not None:
        centre, right = centre_of(frames, radius)
        if np.hypot(*centre) > 3 * right + 0.02 or not 0.8 < error / right < 1.25:
            bubble.ledger.find(place, f"centre +- {error:.3g}; {centre} +- {right:.3g} is left")
    found = numbers.get("warp", {})
    if found.get("clear") is not None:
        if not 0.0 <= found["clear"] <= 1.0:
            bubble.ledger.find(f"{place}.warp.clear", f"is {found['clear']}")
        off = (axes_of(frames[-1]) + 45.0) % 90.0 - 45.0
        if found["clear"] > 0.5 and abs(off) > 3 * found["error_degrees"] + 3:
            bubble.ledger.find(f"{place}.warp", f"axes are {off:.2f} degrees off the warp")


def _said(bubble, numbers):
    """Table of the page and line of the terminal, from result.json."""
    ledger = bubble.ledger
    x, y, z = (f"{value + 0.0:.2f}" for value in numbers["origin_mm"])
    tilt, warp = f"{numbers['tilt_degrees']:.2f}", f"{numbers['warp_degrees']:.2f}"
    error = numbers.get("warp", {}).get("error_degrees")
    within = rf" \(\+- {NUM}\)" if error is not None else ""
    ledger.text(
        rf"^registration: centre {NUM}, {NUM}, {NUM} mm, tilt {NUM}, warp {NUM} degrees{within}",
        [x, y, z, tilt, warp, *([f"{error:.1f}"] if error is not None else [])],
        source="terminal",
        needed=False,
    )
    if bubble.folder.page is None:
        return
    tables = [t for t in bubble.folder.page.tables if t.title == "Registration"]
    if len(tables) != 1:
        return
    deviation = numbers["plane"].get("deviation_mm")
    centre = numbers.get("centre", {}).get("error_mm")
    rows = [
        [
            "plane of the rim",
            f"tilted by {tilt} degrees",
            _pattern(r".* deviate by (\S+) mm", deviation),
        ],
        ["centre of the rim, mm", f"{x}, {y}, {z}", _pattern(r".*\+- (\S+)", centre)],
        ["warp, degrees from the camera's x", warp, _found_by(numbers.get("warp", {}))],
        ["motion of the clamp", None, None],
    ]
    ledger.table("Registration", None, rows)


def _pattern(pattern, number):
    """Return the cell that holds a number of two digits; None, not looked at, without it."""
    return None if number is None else (pattern, float(f"{number:.2g}"))


def _found_by(warp):
    """Return the cell that says how the warp was found, with its numbers; None if it was given."""
    error, clear = warp.get("error_degrees"), warp.get("clear")
    if error is None or clear is None:
        return _pattern(r".*\+- (\S+)", error)
    pattern = r".*\((\d+)% clear\), \+- ([^;]+);.*"
    return pattern, int(f"{100 * clear:.0f}"), float(f"{error:.2g}")
