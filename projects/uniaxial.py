"""The project file of a uniaxial fit, read and converted to mm, N, MPa."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..experiments.regions import strain_regions
from ..models.uniaxial import GRIP_DISTANCE, WIDTH
from .fit import FitProject, common_settings, parse
from .schema import LENGTH_UNITS, CommonFile
from .uniaxial_data import StripData, read_strips
from .uniaxial_schema import UniaxialFile, UniaxialSection

PLACES = 200  # at which a polynomial is asked for its regions


@dataclass(frozen=True, eq=False, kw_only=True)
class UniaxialProject(FitProject):
    """What a uniaxial fit is asked to do. Lengths mm, loads N, moduli MPa, angles degrees.

    `strips` and `weights` by direction (warp, fill, bias).
    """

    width: float
    grip_distance: float
    bias_angle: float
    increments: int
    strips: Mapping[str, StripData]
    match_by: Literal["polynomial", "points"]
    weights: Mapping[str, float]
    objective: Literal["N", "relative"]


def read_uniaxial(
    path: Path,
    data_folder: Path | None = None,
    need_data: bool = True,
    moduli: str | None = None,
    match: Literal["polynomial", "points"] | None = None,
) -> UniaxialProject:
    """Read a project file (TOML) and its load curves.

    Parameters
    ----------
    data_folder : where measured files lie; replaces `uniaxial.data.folder`.
    need_data : whether measured files must be there (a forward analysis does without).
    moduli, match : in the place of `material.moduli` and `uniaxial.match`.

    Raises
    ------
    InputError : one line naming the file and the dotted key.
    """
    path = Path(path)
    file = parse(path, {"uniaxial": UniaxialFile})
    if moduli is not None:
        kept = file.material.breaks if moduli == "trilinear" else None
        changed = {"moduli": moduli, "degree": None, "breaks": kept}
        file.material = file.material.model_copy(update=changed)
    if match is not None:
        file.uniaxial = file.uniaxial.model_copy(update={"match": match})
    settings = uniaxial_settings(path, file, file.uniaxial, data_folder, need_data)
    strips = settings["strips"]
    ends = default_range(strips, settings["bias_angle"])
    common = common_settings(path, file, ends, functools.partial(default_breaks, strips))
    return UniaxialProject(**common, **settings, objective=file.fit.objective)


def uniaxial_settings(
    path: Path,
    file: CommonFile,
    section: UniaxialSection,
    data_folder: Path | None,
    need_data: bool,
    option: str = "--data",
) -> dict[str, Any]:
    """The fields of `UniaxialProject` that the strips' own section gives."""
    length = LENGTH_UNITS[file.units.length]
    width = WIDTH if section.width is None else section.width * length
    grips = GRIP_DISTANCE if section.grip_distance is None else section.grip_distance * length
    strips = read_strips(path, section, file.units, data_folder, need_data, option)
    weights = section.weights.model_dump()
    if not sum(weights[d] for d in strips) > 0:
        raise InputError(path, "uniaxial.weights", "expected one above 0: nothing would be matched")
    if "bias" in strips and not strips["bias"].gauge_length < grips:
        problem = f"expected less than the distance of the grips, {grips:g} mm"
        raise InputError(path, "uniaxial.bias.gauge_length", problem)
    matched_points = section.match == "points"
    if matched_points and need_data and not all(s.curves for s in strips.values()):
        problem = "'points' needs measured points (data.files), not polynomials"
        raise InputError(path, "uniaxial.match", problem)
    for direction, strip in strips.items():
        if matched_points and strip.curves and not len(strip.points[0]):
            problem = "no measured point lies between the gauge length and this one"
            raise InputError(path, f"uniaxial.{direction}.final_length", problem)
    return {
        "thickness": section.thickness * length,
        "width": width,
        "grip_distance": grips,
        "bias_angle": section.bias_angle,
        "increments": section.increments,
        "strips": strips,
        "match_by": section.match,
        "weights": weights,
    }


def default_range(
    strips: Mapping[str, StripData], bias_angle: float
) -> tuple[float, float, float] | None:
    """Strains that the tests can reach, where all three directions are there.

    Warp and fill: the logarithmic strain of their gauges at the end. Shear: that of a strip which
    keeps its area, 2 sin(2 angle) ln(l_f/l_i).
    """
    if set(strips) != {"warp", "fill", "bias"}:
        return None
    ends = {d: math.log(s.final_length / s.gauge_length) for d, s in strips.items()}
    shear = 2 * math.sin(math.radians(2 * bias_angle)) * ends["bias"]
    return ends["warp"], ends["fill"], shear


def default_breaks(
    strips: Mapping[str, StripData], ends: tuple[float, float, float]
) -> NDArray[np.float64]:
    """(3, 2) breaks of a tri-linear law: where three lines follow each load curve best.

    In the shares of the logarithmic strain of its gauge, taken from the strain range `ends`;
    thirds of it where a test is not there.
    """
    breaks = np.outer(ends, [1 / 3, 2 / 3])
    for row, direction in enumerate(("warp", "fill", "bias")):
        strip = strips.get(direction)
        if strip is not None and strip.polynomial is not None:
            u = np.linspace(0.0, strip.final_length - strip.gauge_length, PLACES)[1:]
            strain = np.log1p(u / strip.gauge_length)
            regions = strain_regions(strain, strip.polynomial(u))
            breaks[row] = ends[row] * np.array(regions) / strain[-1]
    return breaks
