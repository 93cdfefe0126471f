"""The cases of a bending project: what is common, what is a case's own, what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..experiments.bending import BendingCurve, Channel, read_bending_curves
from ..models.bending import DEFLECTION, FRAMES, LENGTH, SEAM_WIDTH
from ..models.bodies import Collar, RigidSupports, thesis_collar
from ..models.gas import Gas
from .bend_schema import BendFile, CaseSection, MeasuredSection, ShapeSection
from .schema import LENGTH_UNITS, PRESSURE_UNITS

#: mm of an element, unless the file says otherwise.
SIZE = 25.0


def case_settings(
    path: Path, file: BendFile, folder: Path, need_data: bool
) -> list[dict[str, Any]]:
    """The fields of `BendCase`, case by case, in mm and MPa.

    Raises
    ------
    InputError : naming the project and the key, or a measured file and line.
    """
    found: list[dict[str, Any]] = []
    for i, case in enumerate(file.cases):
        at = f"cases[{i}]"
        settings = _settings(path, at, file, case)
        if any(settings["name"] == other["name"] for other in found):
            problem = f"{settings['name']!r} is there twice; give one of them another name"
            raise InputError(path, f"{at}.name", problem)
        settings["measured"] = _measured(path, at, case, file.measured, folder, need_data)
        found.append(settings)
    return found


def _settings(path: Path, at: str, file: BendFile, case: CaseSection) -> dict[str, Any]:
    length, pressure = LENGTH_UNITS[file.units.length], PRESSURE_UNITS[file.units.pressure]

    def said(key: str) -> Any:
        own = getattr(case, key)
        return getattr(file.cylinder, key) if own is None else own

    def measure(key: str, default: float) -> float:
        value = said(key)
        return default if value is None else float(value * length)

    diameter, gauge = case.diameter * length, case.pressure * pressure
    try:
        supports = RigidSupports(
            measure("span", RigidSupports().span),
            measure("support_diameter", RigidSupports().diameter),
        )
        collar = thesis_collar(diameter) if said("collar") is None else None
        if collar is None:
            given = {k: v * length for k, v in said("collar").model_dump(exclude_none=True).items()}
            collar = Collar(**given)
        air = (said("gas") or {}) and said("gas").model_dump(exclude_none=True)
        if "ambient" in air:
            air["ambient"] *= pressure
        gas = Gas(**air)
    except InputError as error:
        raise InputError(path, f"{at}, {error.field}", error.problem) from None
    return {
        "name": case.name or f"{diameter:g} mm, {1e3 * gauge:g} kPa",
        "diameter": diameter,
        "pressure": gauge,
        "length": measure("length", LENGTH),
        "seam_width": measure("seam_width", SEAM_WIDTH),
        "size": measure("element_size", SIZE),
        "symmetry": said("symmetry") or "quarter",
        "cap_warp": said("cap_warp") or "x",
        "supports": supports,
        "collar": collar,
        "deflections": _deflections(path, at, file, case, length),
        "gas": gas,
    }


def _deflections(
    path: Path, at: str, file: BendFile, case: CaseSection, length: float
) -> tuple[float, ...]:
    """Of the case where it says anything of them, else of [cylinder]."""
    keys = ("deflections", "deflection", "frames")
    section: ShapeSection = case
    if all(getattr(case, key) is None for key in keys):
        section, at = file.cylinder, "cylinder"
    if section.deflections is not None:
        if section.deflection is not None or section.frames is not None:
            problem = "give these, or deflection and frames, not both"
            raise InputError(path, f"{at}.deflections", problem)
        return tuple(d * length for d in section.deflections)
    end = DEFLECTION if section.deflection is None else section.deflection * length
    return tuple(np.linspace(0.0, end, (section.frames or FRAMES) + 1)[1:].tolist())


def _measured(
    path: Path,
    at: str,
    case: CaseSection,
    how: MeasuredSection,
    folder: Path,
    need_data: bool,
) -> tuple[BendingCurve, ...]:
    curves: list[BendingCurve] = []
    names = case.measured or []
    for k, name in enumerate(names):
        file, key = folder / name, f"{at}.measured[{k}]"
        if Path(name) in map(Path, names[:k]):
            raise InputError(path, key, f"{name!r} is listed twice; it would count double")
        if not file.is_file():
            if not need_data:
                continue
            problem = f"there is no file {file}; --data DIR names another folder"
            raise InputError(path, key, problem)
        curves += read_bending_curves(
            file,
            deflection=Channel(**how.deflection.model_dump()),
            load=Channel(**how.load.model_dump()),
            repetition=how.repetition,
            preload=how.preload,
            zero=how.zero,
            comment=how.comment,
            decimal=how.decimal,
        )
    return tuple(curves)
