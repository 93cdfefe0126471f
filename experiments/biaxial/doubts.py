"""Doubts about biaxial data: wrong units, wrong ratios, swapped yarns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

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
    paths = test.data.paths
    found = [doubt for path in paths for doubt in _of_path(path)]
    for path in paths if expected.moduli else ():
        yarn = int(np.argmax(path.load[-1] - path.load[0]))
        strain = float(path.since[-1, yarn])
        if not strain > 0:
            continue
        load = float(path.load[-1, yarn] - path.load[0, yarn])
        far = expected.outside(load / strain / test.place.fabric.thickness, ["E1", "E2"])
        if far:
            text = (
                f"ratio {path.ratio}: load over strain and thickness is about {far}: are loads and "
                "strains in the units that are said, and is the thickness right?"
            )
            found.append(Doubt("modulus", True, text))
            break
    ends = {path.ratio: path.since[-1] for path in paths}
    for ratio, other in (("2:1", "1:2"), ("1:0", "0:1")):
        if ratio not in ends or other not in ends:
            continue
        one, two = ends[ratio], ends[other]
        if one[1] > STIFFER * one[0] and two[0] > STIFFER * two[1]:
            text = (
                f"in ratios {ratio} and {other} the yarn that is pulled less stretches more: the "
                "strains of warp and fill seem to be swapped"
            )
            return [*found, Doubt("swapped", True, text)]
    return found


def _of_path(path: BiaxialPath) -> Iterator[Doubt]:
    """Yield doubts about the units of one path, and about its ratio."""
    end, load = float(np.abs(path.since).max()), float(path.load.max())
    if not LEAST_END < end < MOST_END:
        text = (
            f"ratio {path.ratio}: the strain changes by {100 * end:.3g} % along the path: are the "
            "strains in the unit that is said?"
        )
        yield Doubt("strain-unit", True, text)
    if not LEAST_LOAD < load < MOST_LOAD:
        text = (
            f"ratio {path.ratio}: the loads go up to {load:.3g} kN/m: are they per width, and in "
            "the unit that is said?"
        )
        yield Doubt("load-unit", True, text)
    warp, fill = (path.load[-1] - path.load[0]).tolist()
    said = np.degrees(np.arctan2(*shares(path.ratio)[::-1]))
    if abs(np.degrees(np.arctan2(fill, warp)) - said) > OFF:
        seen = nearest_ratio([warp, fill])
        text = (
            f"ratio {path.ratio}: the loads change by {warp:.4g} and {fill:.4g} kN/m along warp "
            f"and fill, which is {seen}: are the columns of warp and fill right?"
        )
        yield Doubt("ratio", seen == ":".join(path.ratio.split(":")[::-1]), text)
