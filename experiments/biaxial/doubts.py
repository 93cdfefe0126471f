"""Doubts about biaxial data: wrong units, wrong ratios, swapped yarns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...materials.designers import shares
from ..kinds import Doubt, Expected
from .data import BiaxialPath, nearest_ratio
from .test import BiaxialTest

#: Strains at the end of a path: no coated fabric ends below or above.
LEAST_END, MOST_END = 5e-4, 0.5
#: kN/m: a cruciform of a coated fabric is loaded by more, and by less.
LEAST_LOAD, MOST_LOAD = 0.05, 500.0
#: Degrees between the loads' direction and that of the ratio they are said to have.
OFF = 6.0
#: How much stiffer than the warp the fill must be to be taken for it.
STIFFER = 1.15


def doubts_of_biaxial(test: BiaxialTest, expected: Expected) -> Sequence[Doubt]:
    """Return the doubts about the paths of a test."""
    paths, found = test.data.paths, list[Doubt]()
    for path in paths:
        found += [*_units(path), *_ratio(path)]
    return [*found, *_modulus(paths, test.place.fabric.thickness, expected), *_swapped(paths)]


def _units(path: BiaxialPath) -> list[Doubt]:
    """Doubt strains that look like percent, loads that look like N/m."""
    end, load = float(np.abs(path.since).max()), float(path.load.max())
    found = []
    if not LEAST_END < end < MOST_END:
        text = (
            f"ratio {path.ratio}: the strain changes by {100 * end:.3g} % along the path: are the "
            "strains in the unit that is said?"
        )
        found.append(Doubt("strain-unit", True, text))
    if not LEAST_LOAD < load < MOST_LOAD:
        text = (
            f"ratio {path.ratio}: the loads go up to {load:.3g} kN/m: are they per width, and in "
            "the unit that is said?"
        )
        found.append(Doubt("load-unit", True, text))
    return found


def _ratio(path: BiaxialPath) -> list[Doubt]:
    """Doubt loads of another ratio than the one listed, mostly of the other yarn."""
    warp, fill = (path.load[-1] - path.load[0]).tolist()
    said = np.degrees(np.arctan2(*shares(path.ratio)[::-1]))
    own = np.degrees(np.arctan2(fill, warp))
    if abs(own - said) <= OFF:
        return []
    seen = nearest_ratio([warp, fill])
    text = (
        f"ratio {path.ratio}: the loads change by {warp:.4g} and {fill:.4g} kN/m along warp and "
        f"fill, which is {seen}: are the columns of warp and fill right?"
    )
    return [Doubt("ratio", seen == ":".join(path.ratio.split(":")[::-1]), text)]


def _modulus(paths: Sequence[BiaxialPath], thickness: float, expected: Expected) -> list[Doubt]:
    """Doubt a modulus that shows a unit wrong by a thousand."""
    if not expected.moduli:
        return []
    for path in paths:
        yarn = int(np.argmax(path.load[-1] - path.load[0]))
        strain = float(path.since[-1, yarn])
        if not strain > 0:
            continue
        load = float(path.load[-1, yarn] - path.load[0, yarn])
        far = expected.outside(load / strain / thickness, ["E1", "E2"])
        if far:
            text = (
                f"ratio {path.ratio}: load over strain and thickness is about {far}: are loads and "
                "strains in the units that are said, and is the thickness right?"
            )
            return [Doubt("modulus", True, text)]
    return []


def _swapped(paths: Sequence[BiaxialPath]) -> list[Doubt]:
    """Doubt mirrored ratios in which the yarn that is pulled less stretches more."""
    found = {path.ratio: path for path in paths}
    for ratio, other in (("2:1", "1:2"), ("1:0", "0:1")):
        if ratio not in found or other not in found:
            continue
        one, two = found[ratio].since[-1], found[other].since[-1]
        if one[1] > STIFFER * one[0] and two[0] > STIFFER * two[1]:
            text = (
                f"in ratios {ratio} and {other} the yarn that is pulled less stretches more: the "
                "strains of warp and fill seem to be swapped"
            )
            return [Doubt("swapped", True, text)]
    return []
