"""A surface of quads seen from one side, as SVG: far ones first."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from .map_svg import scale_bar
from .maps import Solid
from .markup import as_markup
from .shades import COLOURS, classes, ends

Array = NDArray[np.float64]

WIDTH, HEIGHT, MARGIN = 570.0, 430.0, 12.0
#: Of the width, for the colour bar and its numbers; the surface stands in the rest.
BAR = 112.0
#: From where it is seen at first, degrees: turned about z, and raised over the horizon.
TURN, RAISE = 35.0, 28.0
#: Where the middle of the surface stands.
CENTRE = (0.5 * (WIDTH - BAR), 0.5 * HEIGHT)


def solid_svg(solid: Solid, load: int, shade: int = 0) -> Markup:
    """The surface at a load, coloured by one of its shades."""
    every = solid.points.values
    faces = np.rint(solid.faces.values).astype(int)
    flat, depth = seen(every[load] - middle_of(every), TURN, RAISE)
    flat = flat * scale_of(every) * (1.0, -1.0) + CENTRE
    own = solid.shades[shade]
    low, high = ends(own.values.values, own.shades)
    number = classes(own.values.values[load], low, high)
    colours = COLOURS[own.shades]
    parts = [
        f'<svg class="solid" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" '
        f'aria-label="{escape(solid.alt or solid.caption)}"><g class="faces">'
    ]
    for k in np.argsort(depth[faces].mean(axis=1)):
        d = "L".join(f"{x:.1f} {y:.1f}" for x, y in flat[faces[k]])
        fill = colours[number[k]] if number[k] >= 0 else "#999"
        parts.append(f'<path fill="{fill}" d="M{d}Z"/>')
    parts.append(f'</g><g class="scale" transform="translate({WIDTH - BAR + 8:g} {2 * MARGIN:g})">')
    parts.append(scale_bar(own.shades, own.unit, low, high) + "</g></svg>")
    return as_markup("".join(parts))


def middle_of(points: Array) -> Array:
    """(3,) of the box around all loads, about which it is turned."""
    flat = points.reshape(-1, 3)
    return np.asarray(0.5 * (flat.min(axis=0) + flat.max(axis=0)))


def scale_of(points: Array) -> float:
    """Of the picture, so that it fits however it is turned."""
    flat = points.reshape(-1, 3)
    radius = float(np.linalg.norm(flat - middle_of(points), axis=1).max()) or 1.0
    return (min(HEIGHT, WIDTH - BAR) / 2 - MARGIN) / radius


def seen(points: Array, turn: float, height: float) -> tuple[Array, Array]:
    """(n, 2) to the right and up, and (n,) how near, of points (n, 3) mm."""
    a, b = np.radians(turn), np.radians(height)
    right = points @ (np.cos(a), np.sin(a), 0.0)
    away = points @ (-np.sin(a), np.cos(a), 0.0)
    up = points[:, 2] * np.cos(b) + away * np.sin(b)
    near = points[:, 2] * np.sin(b) - away * np.cos(b)
    return np.column_stack([right, up]), near
