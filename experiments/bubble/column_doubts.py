"""Doubts about the columns of a bubble's files: exchanged, of opposite sense, not of one sheet."""

from collections.abc import Iterator

import numpy as np

from ..doubts import Doubt
from .column_consistency import Assignment, slope_of_rise_over_bumps, spreads, strain_of_rise
from .measured_view import CONSISTENCY, MeasuredView


def upside_down(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt a bubble that goes down as the pressure goes up: z is flipped."""
    if not view.rises[-1] >= 0:
        text = (
            f"the centre moves by {view.rises[-1]:.3g} mm along z at {view.highest_pressure} kPa: "
            "z is flipped; turn the axes, or let a registration find them"
        )
        yield Doubt("z-flipped", True, text)


def places_exchanged(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt places of which z is not the height: the points spread more along it than across."""
    spread, within = spreads(view.fields)
    if np.isfinite(within) and spread[2] > within:
        flat = "xyz"[int(np.argmin(spread))]
        text = (
            f"the points spread by {spread[0]:.3g}, {spread[1]:.3g} and {spread[2]:.3g} mm along "
            f"x, y and z (standard deviations), and a sheet is flat along z: exchange {flat} and z "
            "of the places"
        )
        yield Doubt("exchanged", True, text)


def rise_exchanged(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt displacements of which dz is not the rise: dx or dy has the dome."""
    motion = view.centre_motions[-1]
    if motion is None:
        return
    dx, dy, dz = np.abs(motion.dome)
    highest = max(dx, dy)
    is_visible = highest >= CONSISTENCY.visible_dome * view.outline.radius
    if not is_visible or dz > CONSISTENCY.dome_share * highest:
        return
    name = "dx" if dx > dy else "dy"
    text = (
        f"{name} is a dome of {highest:.3g} mm over the disk at {view.highest_pressure} kPa and dz "
        f"of {dz:.2g} mm, but the sheet rises along z: exchange {name} and dz, or the same two of "
        "x, y and z"
    )
    yield Doubt("exchanged", True, text)


def strain_unlike_rise(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt dx and dy that do not go with x and y, or not with the rise."""
    first = view.centre_motions[0]
    last = view.centre_motions[-1]
    if last is None:
        return
    low = first if len(view.fields) > 1 else None
    comparison = strain_of_rise(low, last, view.outline, CONSISTENCY)
    if not comparison.is_comparable or not comparison.is_outside(CONSISTENCY.doubtful):
        return
    smaller, larger = comparison.principal_strains
    rise, lower = comparison.rise
    due = " to ".join(dict.fromkeys(f"{strain:.2g}" for strain in comparison.expected))
    rises = f"a rise of {rise:.3g} mm" if not lower else f"a rise from {lower:.3g} to {rise:.3g} mm"
    text = (
        f"the centre is strained by {smaller:.2g} and {larger:.2g} (principal strains, of dx and "
        f"dy), and {rises} calls for about {due}"
    )
    is_sure = comparison.is_outside(CONSISTENCY.impossible)
    name, remedy = _remedy(comparison.assignment) if is_sure else ("strain-rise", "")
    if not remedy:
        remedy = "are dx, dy and dz all there and in one unit, and is the radius right?"
    yield Doubt(name, is_sure, f"{text}: {remedy}")


def _remedy(assignment: Assignment) -> tuple[str, str]:
    """Return the name of a doubt and what to do so that dx grows with x, dy with y."""
    (x_sign, x_column), (y_sign, _) = assignment
    if x_column == 1:
        minus_x, minus_y = ("minus " if sign < 0 else "" for sign in (x_sign, y_sign))
        text = f"dx and dy are exchanged; take {minus_x}dy for dx and {minus_y}dx for dy"
        return "exchanged", f"{text}, or exchange x and y in the same way"
    if x_sign > 0 and y_sign > 0:
        return "strain-rise", ""
    wrong = [name for name, sign in (("x", x_sign), ("y", y_sign)) if sign < 0]
    senses = " and ".join(f"{name} and d{name} have opposite senses" for name in wrong)
    return "axis-flipped", f"{senses}; flip one of them"


def height_flipped(view: MeasuredView) -> Iterator[Doubt]:
    """Doubt the sign of z: bumps of the sheet at rest grow, where pressure pulls them flat."""
    slope = slope_of_rise_over_bumps(view.last, view.outline, CONSISTENCY)
    if slope is not None and slope > CONSISTENCY.height_slope:
        text = (
            f"dz follows the bumps of the heights z by {slope:+.0%} at {view.highest_pressure} "
            "kPa, but a sheet that is pulled flat loses them: change the sign of z"
        )
        yield Doubt("height-flipped", False, text)
