"""Maps as SVG at one load: dots in few colours, a scale beside each."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from .maps import Maps, Panel, Shades
from .markup import as_markup
from .shades import COLOURS, classes, ends
from .ticks import written

Array = NDArray[np.float64]

#: RIGHT: of the colour bar, and of numbers as long as "−7.43e−11".
SIDE, ABOVE, BELOW, LEFT, RIGHT = 190.0, 22.0, 34.0, 8.0, 102.0


def frame_of(maps: Maps, values: Array, load: int) -> Array:
    """What of values (all, ...) belongs to a load."""
    first = sum(maps.counts[:load])
    return values[first : first + maps.counts[load]]


def row_ends(maps: Maps, panel: Panel, load: int) -> tuple[float, float]:
    """Of the colours: the same for the maps of a row that have the same shades."""
    alike = [p for p in maps.panels if p.row == panel.row and p.shades == panel.shades]
    return ends(
        np.concatenate([frame_of(maps, p.values.values, load) for p in alike]), panel.shades
    )


def map_svg(maps: Maps, panel: Panel, load: int) -> Markup:
    """One map at one load."""
    every = maps.places.values
    low, high = every.min(axis=0), every.max(axis=0)
    span = float((high - low).max()) or 1.0
    # About as wide as neighbours lie apart.
    size = min(max(1.15 * SIDE / np.sqrt(max(maps.counts)), 3.0), 14.0)
    scale = (SIDE - size) / span
    places = frame_of(maps, every, load)
    middle = 0.5 * (low + high)
    spots = SIDE / 2 + scale * (places - middle) * (1.0, -1.0)
    start, end = row_ends(maps, panel, load)
    number = classes(frame_of(maps, panel.values.values, load), start, end)
    colours = COLOURS[panel.shades]
    width, height = LEFT + SIDE + RIGHT, ABOVE + SIDE + BELOW
    parts = [
        f'<svg class="map" viewBox="0 0 {width:g} {height:g}" role="img" '
        f'aria-label="{escape(panel.name)}, {escape(panel.unit)}, {escape(maps.loads[load])}">',
        f'<text class="title" x="{LEFT:g}" y="14">{escape(panel.name)}</text>',
        f'<g class="spots" transform="translate({LEFT:g} {ABOVE:g})" stroke-width="{size:.1f}">',
    ]
    for k, shade in enumerate(colours):
        d = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in spots[number == k])
        parts.append(f'<path stroke="{shade}" d="{d}"/>')
    parts.append("</g>")
    parts.append(f'<g class="scale" transform="translate({LEFT + SIDE + 8:g} {ABOVE:g})">')
    parts.append(scale_bar(panel.shades, panel.unit, start, end) + "</g>")
    across = f'x="{LEFT + SIDE / 2:g}" y="{ABOVE + SIDE + 16:g}" text-anchor="middle"'
    parts.append(f'<text class="label" {across}>{escape(maps.x_label)} →</text></svg>')
    return as_markup("".join(parts))


def scale_bar(shades: Shades, unit: str, low: float, high: float) -> str:
    """The colours from low to high, upwards, with three values and the unit."""
    colours = COLOURS[shades]
    each = 0.8 * SIDE / len(colours)
    bars = "".join(
        f'<rect y="{each * (len(colours) - 1 - k):.1f}" width="12" height="{each + 0.5:.1f}" '
        f'fill="{shade}"/>'
        for k, shade in enumerate(colours)
    )
    tall = each * len(colours)
    words = "".join(
        f'<text class="end" x="16" y="{at:.1f}">{written(float(f"{value:.3g}"))}</text>'
        for value, at in ((high, 9.0), (0.5 * (low + high), 0.5 * tall + 4), (low, tall))
    )
    return f'{bars}{words}<text class="unit" x="0" y="{tall + 16:.1f}">{escape(unit)}</text>'
