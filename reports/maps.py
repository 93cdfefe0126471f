"""Values at places over several loads as data: what maps of the page are drawn from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .packed import Packed, pack

Array = NDArray[np.float64]
#: Colours: from nothing to much, or with zero in the middle.
Shades = Literal["from least", "about zero"]

#: What stands beside each other in a row of maps, and how it is coloured.
BESIDE: Mapping[str, Shades] = {
    "measured": "from least",
    "modelled": "from least",
    "modelled − measured": "about zero",
}
#: Places that are drawn of one load; of more, every second, third ... is.
MOST_PLACES = 700


@dataclass(frozen=True)
class Panel:
    """One map: values (places of all loads one after the other,) in a unit.

    row : in which it stands; maps of a row with the same shades have the same ends of colours.
    """

    name: str
    unit: str
    values: Packed
    row: int = 0
    shades: Shades = "from least"


@dataclass(frozen=True)
class Maps:
    """Maps of the same places, load by load, with a slider of the loads.

    loads : a name each ("22 kPa"). counts : places of each load. places : (all, 2) mm.
    """

    name: str
    loads: Sequence[str]
    slider: str
    counts: Sequence[int]
    places: Packed
    panels: Sequence[Panel]
    x_label: str
    y_label: str
    caption: str
    alt: str = ""
    part: Literal["maps"] = "maps"


@dataclass(frozen=True)
class Shade:
    """What a solid can be coloured by: (loads, faces) in a unit."""

    name: str
    unit: str
    values: Packed
    shades: Shades = "from least"


@dataclass(frozen=True)
class Solid:
    """A surface of quads to turn: points (loads, nodes, 3) mm, faces (m, 4) of node numbers."""

    name: str
    loads: Sequence[str]
    slider: str
    points: Packed
    faces: Packed
    shades: Sequence[Shade]
    caption: str
    alt: str = ""
    part: Literal["solid"] = "solid"


def maps_of(
    name: str,
    slider: str,
    loads: Sequence[str],
    places: Sequence[Array],
    rows: Sequence[tuple[str, str, Sequence[Array], Sequence[Array], Sequence[Array]]],
    labels: tuple[str, str],
    caption: str,
    alt: str,
) -> Maps:
    """Measured, modelled and their difference of several quantities.

    places : (n, 2) mm of each load. rows : name, unit, and of each load (n,) measured, modelled,
    and what is left between them, of each quantity. labels : of the axes.
    """
    every = [max(1, -(-len(own) // MOST_PLACES)) for own in places]

    def thin(parts: Sequence[ArrayLike]) -> Array:
        return np.concatenate(
            [np.asarray(part, dtype=float)[::k] for part, k in zip(parts, every, strict=True)]
        )

    panels = [
        Panel(f"{title}, {what}", unit, pack(thin(values)), number, shades)
        for number, (title, unit, *three) in enumerate(rows)
        for (what, shades), values in zip(BESIDE.items(), three, strict=True)
    ]
    counts = [len(own[::k]) for own, k in zip(places, every, strict=True)]
    if max(every) > 1:
        caption += f" Of the places one in {max(every)} is shown."
    return Maps(name, loads, slider, counts, pack(thin(places)), panels, *labels, caption, alt)
