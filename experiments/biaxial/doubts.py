"""Doubts about the paths of a biaxial test: units, ratios, moduli and swapped yarns."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...materials.designers import shares
from ..doubts import Doubt, Expected
from .paths import BiaxialPath, nearest_ratio


@dataclass(frozen=True)
class PathLimits:
    """Limits beyond which a load path is doubtful for a coated fabric."""

    end_strain: tuple[float, float] = (5e-4, 0.5)  # least and largest strain of a coated fabric
    load: tuple[float, float] = (0.05, 500.0)  # kN/m, least and largest load of a path
    angle: float = 6.0  # degrees between the loads' direction and that of their stated ratio
    stiffer: float = 1.15  # strain across over strain along the more loaded yarn: swapped beyond


LIMITS = PathLimits()


def doubts_of_paths(
    paths: Sequence[BiaxialPath], thickness: float, expected: Expected
) -> list[Doubt]:
    """Return the doubts about the load paths of a test: units, ratios, moduli and swapped yarns.

    Parameters
    ----------
    paths : sequence of BiaxialPath
        Loading branches that are evaluated.
    thickness : float, mm
        Thickness of the fabric.
    expected : Expected
        Bounds that the project gives the moduli.
    """
    doubts = [doubt for path in paths for doubt in _of_path(path)]
    if expected.moduli:
        doubts += _of_modulus(paths, thickness, expected)
    doubts += _of_yarns(paths)
    if not any(doubt.name == "swapped" for doubt in doubts) and expected.warp_is_stiffer:
        doubts += _of_stiffer_yarn(paths)
    return doubts


def _of_path(path: BiaxialPath) -> Iterator[Doubt]:
    """Yield doubts about the units of one path, and about its load ratio."""
    strain = float(np.abs(path.strain_change).max())
    load = float(path.load.max())
    if not LIMITS.end_strain[0] < strain < LIMITS.end_strain[1]:
        text = (
            f"ratio {path.ratio}: the strain changes by {100 * strain:.3g} % along the path: are "
            "the strains in the unit that is said?"
        )
        yield Doubt("strain-unit", True, text)
    if not LIMITS.load[0] < load < LIMITS.load[1]:
        text = (
            f"ratio {path.ratio}: the loads go up to {load:.3g} kN/m: are they per width, and in "
            "the unit that is said?"
        )
        yield Doubt("load-unit", True, text)
    warp, fill = (path.load[-1] - path.load[0]).tolist()
    expected_angle = np.degrees(np.arctan2(*shares(path.ratio)[::-1]))
    if abs(np.degrees(np.arctan2(fill, warp)) - expected_angle) > LIMITS.angle:
        measured_ratio = nearest_ratio([warp, fill])
        text = (
            f"ratio {path.ratio}: the loads change by {warp:.4g} and {fill:.4g} kN/m along warp "
            f"and fill, which is {measured_ratio}: are the columns of warp and fill right?"
        )
        is_sure = measured_ratio == ":".join(path.ratio.split(":")[::-1])
        yield Doubt("ratio", is_sure, text)


def _of_modulus(
    paths: Sequence[BiaxialPath], thickness: float, expected: Expected
) -> Iterator[Doubt]:
    """Yield the doubt about the first path whose modulus is far outside the bounds."""
    for path in paths:
        yarn = int(np.argmax(path.load[-1] - path.load[0]))
        strain = float(path.strain_change[-1, yarn])
        if not strain > 0:
            continue
        load = float(path.load[-1, yarn] - path.load[0, yarn])
        unlikely = expected.outside(load / strain / thickness, ["E1", "E2"])
        if unlikely:
            text = (
                f"ratio {path.ratio}: load over strain and thickness is about {unlikely}: "
                "are loads and strains in the units that are said, and is the thickness right?"
            )
            yield Doubt("modulus", True, text)
            return


def _of_yarns(paths: Sequence[BiaxialPath]) -> Iterator[Doubt]:
    """Yield the doubt that warp and fill are swapped: the less loaded yarn strains more."""
    ends = {path.ratio: path.strain_change[-1] for path in paths}
    for ratio, mirrored_ratio in (("2:1", "1:2"), ("1:0", "0:1")):
        if ratio not in ends or mirrored_ratio not in ends:
            continue
        warp, fill = ends[ratio]
        mirrored_warp, mirrored_fill = ends[mirrored_ratio]
        is_fill_longer = fill > LIMITS.stiffer * warp
        if is_fill_longer and mirrored_warp > LIMITS.stiffer * mirrored_fill:
            text = (
                f"in ratios {ratio} and {mirrored_ratio} the yarn that is pulled less "
                "stretches more: the strains of warp and fill seem to be swapped"
            )
            yield Doubt("swapped", True, text)
            return


def _of_stiffer_yarn(paths: Sequence[BiaxialPath]) -> Iterator[Doubt]:
    """Yield the doubt that warp and fill are swapped, where the bounds have the warp stiffer.

    Equal loads are compared: those of 1:1, or those of a ratio and its mirror image.
    """
    compliance = {
        path.ratio: path.strain_change[-1] / np.maximum(path.load[-1] - path.load[0], 1e-9)
        for path in paths
    }
    for ratio, mirrored_ratio in (("1:1", "1:1"), ("2:1", "1:2"), ("1:0", "0:1")):
        if ratio not in compliance or mirrored_ratio not in compliance:
            continue
        warp = compliance[ratio][0]
        fill = compliance[mirrored_ratio][1]
        if warp > LIMITS.stiffer * fill > 0:
            text = (
                f"in {ratio} the warp is strained {warp / fill:.3g} times as much as the fill is "
                f"by the same load in {mirrored_ratio}, and the bounds have the warp stiffer: warp "
                "and fill, or their strains alone, seem to be swapped"
            )
            yield Doubt("swapped", False, text)
            return
