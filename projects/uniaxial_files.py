"""The files of [uniaxial.data]: which there are, and the measured curves they hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..experiments.curves import LoadCurve, read_load_curves, split_at_restarts
from .uniaxial_schema import CurvesSection

DIRECTIONS = ("warp", "fill", "bias")


@dataclass(frozen=True)
class ListedFile:
    """A file of the project.

    field : its key. direction : the one it is listed for; None where the file itself names it.
    """

    path: Path
    field: str
    direction: str | None = None


def listed_files(path: Path, data: CurvesSection, folder: Path) -> list[ListedFile]:
    """The files of [uniaxial.data], there or not, in the order of the project.

    Raises
    ------
    InputError : none in any direction, one that is listed twice for the same.
    """
    if data.polynomials is not None:
        return [ListedFile(folder / data.polynomials, "uniaxial.data.polynomials")]
    field = "uniaxial.data.files"
    by_direction: dict[str | None, list[str]] = {}
    if isinstance(data.files, list):
        by_direction[None] = data.files
    elif data.files is not None:
        by_direction = {d: getattr(data.files, d) or [] for d in DIRECTIONS}
    listed = []
    for direction, names in by_direction.items():
        key = field if direction is None else f"{field}.{direction}"
        for i, name in enumerate(names):
            if Path(name) in map(Path, names[:i]):
                problem = f"{name!r} is listed twice; its points would count double"
                raise InputError(path, f"{key}[{i}]", problem)
            listed.append(ListedFile(folder / name, f"{key}[{i}]", direction))
    if not listed:
        problem = "expected files of one direction at least: { warp = [...], fill = [...] }"
        raise InputError(path, field, problem)
    return listed


def measured_curves(
    path: Path, data: CurvesSection, listed: Sequence[ListedFile]
) -> dict[str, tuple[LoadCurve, ...]]:
    """The specimens' curves by direction, in the order of `DIRECTIONS`; only those there are.

    A file with one curve in a direction perhaps lists several specimens, one after the other and
    not named: it is split where the elongation starts again.

    Raises
    ------
    InputError : naming the data file and line: see `read_load_curves`; naming the project and
        key: one curve listed for two directions.
    """
    columns = {k: v for k, v in data.columns.model_dump().items() if v is not None}
    found: dict[str, list[LoadCurve]] = {direction: [] for direction in DIRECTIONS}
    first: dict[Path, LoadCurve] = {}
    for file in listed:
        curves = read_load_curves(
            file.path,
            columns=columns or None,
            load_unit=data.load_unit,
            length_unit=data.length_unit,
            comment=data.comment,
            direction=file.direction,
            decimal=data.decimal,
        )
        before = first.setdefault(file.path, curves[0])
        if before.direction != curves[0].direction and _same(before, curves[0]):
            problem = f"is listed for {before.direction} too, and does not tell the two apart"
            raise InputError(path, file.field, problem)
        for direction in DIRECTIONS:
            own = [curve for curve in curves if curve.direction == direction]
            if len(own) == 1:
                parts = split_at_restarts(own[0])
                own = list(parts) if len(parts) > 1 else own
            found[direction] += own
    return {direction: tuple(curves) for direction, curves in found.items() if curves}


def _same(one: LoadCurve, other: LoadCurve) -> bool:
    return np.array_equal(one.elongation, other.elongation) and np.array_equal(one.load, other.load)
