"""The files of [strips.data]: which there are, and the measured curves they hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...data.curves import DIRECTIONS, LoadCurve, read_load_curves, split_at_restarts
from ..base import Place
from ..formats import named_format
from .section import CurvesSection


@dataclass(frozen=True)
class ListedFile:
    """A file that a section lists.

    field : its key below the section. direction : the one it is listed for; None where the file
    itself names it.
    """

    path: Path
    field: str
    direction: str | None = None


def listed_files(place: Place, data: CurvesSection, folder: Path) -> list[ListedFile]:
    """The files of [strips.data], there or not, in the order of the section.

    Raises
    ------
    InputError : none in any direction, one that is listed twice for the same.
    """
    if data.polynomials is not None:
        return [ListedFile(folder / data.polynomials, "data.polynomials")]
    field = "data.files"
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
                raise place.error(f"{key}[{i}]", problem)
            listed.append(ListedFile(folder / name, f"{key}[{i}]", direction))
    if not listed:
        problem = "expected files of one direction at least: { warp = [...], fill = [...] }"
        raise place.error(field, problem)
    return listed


def measured_curves(
    place: Place, data: CurvesSection, listed: Sequence[ListedFile], width: float
) -> dict[str, tuple[LoadCurve, ...]]:
    """The specimens' curves by direction, in the order of `DIRECTIONS`; only those there are.

    A file with one curve in a direction perhaps lists several specimens, one after the other and
    not named: it is split where the elongation starts again. width : of the strips, mm.

    Raises
    ------
    InputError : naming the data file and line: see `read_load_curves`; naming the project and
        key: one curve listed for two directions.
    """
    format = named_format(place, "data.format", "machine table", data.format)
    columns = {k: v for k, v in data.columns.model_dump().items() if v is not None}
    by_direction: dict[str, list[LoadCurve]] = {direction: [] for direction in DIRECTIONS}
    first: dict[Path, LoadCurve] = {}
    for file in listed:
        curves = read_load_curves(
            file.path,
            columns=columns or None,
            load_unit=data.load_unit,
            length_unit=data.length_unit,
            width=width,
            comment=data.comment,
            direction=file.direction,
            decimal=data.decimal,
            format=format,
        )
        before = first.setdefault(file.path, curves[0])
        if before.direction != curves[0].direction and _same(before, curves[0]):
            problem = f"is listed for {before.direction} too, and does not tell the two apart"
            raise place.error(file.field, problem)
        for direction in DIRECTIONS:
            own = [curve for curve in curves if curve.direction == direction]
            if len(own) == 1:
                parts = split_at_restarts(own[0])
                own = list(parts) if len(parts) > 1 else own
            by_direction[direction] += own
    return {direction: tuple(curves) for direction, curves in by_direction.items() if curves}


def _same(one: LoadCurve, other: LoadCurve) -> bool:
    return np.array_equal(one.elongation, other.elongation) and np.array_equal(one.load, other.load)
