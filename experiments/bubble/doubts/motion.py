"""Frames that do not move as an inflated sheet does."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...doubts import Doubt, Expected
from .view import View

#: Of the highest rise: a centre that sinks by more while the pressure rises is no noise.
SINKS = 0.02
#: Of the displacements: how much of them the reference places follow, when they are deformed ones.
FOLLOWS, LIKE = 0.5, 0.9
#: Of the larger strain at the apex: the other one is not as negative as this under pressure.
NEGATIVE = -0.25
#: Shares of a rise.
HALF = 0.5


def upside_down(view: View, expected: Expected) -> list[Doubt]:
    """z flipped: the bubble goes down as the pressure goes up."""
    rise = float(view.rises[-1])
    if rise >= 0:
        return []
    text = (
        f"the centre moves by {rise:.3g} mm along z at {1e3 * view.last.pressure:.4g} kPa: z is "
        "flipped; turn the axes, or let a registration find them"
    )
    return [Doubt("z-flipped", True, text)]


def order(view: View, expected: Expected) -> list[Doubt]:
    """Frames that are not in the order of their pressures."""
    rises, steps = view.rises, []
    for k, (a, b) in enumerate(pairwise(rises)):
        if b < a - SINKS * rises.max():
            low, high = (1e3 * view.fields[i].pressure for i in (k, k + 1))
            steps.append(f"from {a:.3g} to {b:.3g} mm between {low:.4g} and {high:.4g} kPa")
    if not steps:
        return []
    text = f"the centre sinks {steps[0]}: the frames are not in the order of the pressures"
    return [Doubt("frame-order", True, text)]


def repeated(view: View, expected: Expected) -> list[Doubt]:
    """The same frame for two pressures."""
    pairs = []
    for first, second in pairwise(view.fields):
        same = first.displacement.shape == second.displacement.shape and np.array_equal(
            first.displacement, second.displacement
        )
        if same and np.abs(first.displacement).max() > 0:
            pairs.append(f"{1e3 * first.pressure:.4g} and {1e3 * second.pressure:.4g} kPa")
    if not pairs:
        return []
    more = f" (and in {len(pairs) - 1} more pairs)" if pairs[1:] else ""
    text = (
        f"the displacements at {pairs[0]} are the same to the last digit{more}: one frame is given "
        "twice"
    )
    return [Doubt("repeated-frame", True, text)]


def rejected_at_zero(view: View, expected: Expected) -> list[Doubt]:
    """Points without correlation that were written as zeros."""
    inner = view.inner(view.last)
    moved = view.last.displacement[inner]
    still = int((moved == 0).all(axis=1).sum())
    twice = int((view.last.points == 0).all(axis=1).sum())
    if still == 0 and twice < 2:
        return []
    found = [f"{still} of {len(moved)} points well within the rim do not move at all"] * (still > 0)
    found += [f"{twice} points lie at exactly x = y = 0"] * (twice > 1)
    text = (
        f"{' and '.join(found)} at {1e3 * view.last.pressure:.4g} kPa: points without correlation "
        "seem to be written as zeros; name the column that marks them (flag_column)"
    )
    return [Doubt("zero-points", True, text)]


def deformed_coordinates(view: View, expected: Expected) -> list[Doubt]:
    """Places after the motion where those before it are meant."""
    last = view.last
    if last.z is not None and not view.registered:
        # A reference surface that has the bubble's own shape.
        alike = _follows(last.z[:, None], last.displacement[:, 2:])
        if alike is not None and alike > FOLLOWS:
            return [_deformed(f"the height z follows dz by {alike:.0%}")]
    for other in view.fields[:-1]:
        if len(other.points) != len(last.points):
            continue
        place = last.points - other.points
        moved = (last.displacement - other.displacement)[:, :2]
        alike = _follows(place, moved)
        if alike is not None and alike > FOLLOWS:
            return [_deformed(f"x and y change from frame to frame by {alike:.0%} of dx and dy")]
    return []


def _follows(place: np.ndarray, moved: np.ndarray) -> float | None:
    """By how much places follow displacements, where the two are alike; None where they are not."""
    a, b = place - place.mean(axis=0), moved - moved.mean(axis=0)
    size = float(np.sqrt((a**2).sum() * (b**2).sum()))
    if not size > 0 or float((a * b).sum()) < LIKE * size:
        return None
    return float((a * b).sum() / (b**2).sum())


def _deformed(seen: str) -> Doubt:
    text = (
        f"{seen}: the coordinates are those of the deformed sheet; export the reference coordinates"
    )
    return Doubt("deformed-coordinates", True, text)


def mirrored(view: View, expected: Expected) -> list[Doubt]:
    """x or y flipped in places or in displacements, not in both."""
    if not view.apexes:
        return []
    strain = np.array(view.apexes[-1].strain)
    if not strain.max() > 0:
        text = f"the sheet shrinks at its centre (strains {strain[0]:.3g}, {strain[1]:.3g})"
        return [Doubt("axis-flipped", True, f"{text}: x, y, dx and dy do not go together")]
    negative = [n for n, s in zip("xy", strain, strict=True) if s < NEGATIVE * strain.max()]
    return [
        Doubt(
            "axis-flipped",
            True,
            f"the centre is strained by {strain[0]:.3g} along x and {strain[1]:.3g} along y: "
            f"{name} and d{name} have opposite senses; flip one of them",
        )
        for name in negative
    ]
