"""Measured files as tables, whatever their format, and bubbles in the test's coordinates."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, check_one_of
from ..experiments.biaxial.test import read_biaxial_table
from ..experiments.bubble.findings import registration_line, registration_numbers
from ..experiments.bubble.prepared import read_measured
from ..experiments.bubble.registration import CameraRegistration
from ..experiments.fabric import Fabric
from ..lazy_modules import pandas as pd
from ..readers.bending import read_bending_curves
from ..readers.curves import read_load_curves
from ..readers.frames import QUANTITIES, FrameOptions, read_frames
from ..readers.sections import LENGTH_UNITS
from .objects import Biaxial, Bubble, Files, Numbers, file_names
from .project import Project


def read(files: Files, of: str | None = None, **how: Any) -> pd.DataFrame:
    """Read measured files of any format into one table, in mm, N and MPa.

    of : the kind of test. "bubble": frame (from 0), x, y, z, dx, dy, dz. "strips": direction,
    specimen, elongation, load. "biaxial": warp_load, fill_load (N/mm), warp_strain, fill_strain
    (shares) and, where it is there, ratio. "cylinder": repetition, deflection, load. By default the
    first of these that the files can be read as. how : as their readers take it: columns, format,
    decimal, length_unit, direction, width. InputError in the files.
    """
    paths = [Path(name) for name in file_names(files)]
    check_one_of(of, READERS, "of")
    said = []
    for kind, reader in READERS.items():
        if of in (None, kind):
            try:
                return reader(paths, **how)
            except (InputError, TypeError) as error:
                if of is not None and isinstance(error, InputError):
                    raise
                said.append(f"as {kind}: {getattr(error, 'problem', error)}")
    raise InputError(paths[0], "", f"cannot be read {'; '.join(said)}")


def _frames(paths: Sequence[Path], length_unit: str = "mm", **how: Any) -> pd.DataFrame:
    format = how.pop("format", None)
    scale = LENGTH_UNITS[length_unit]
    options = FrameOptions(("x", "y", "dx", "dy", "dz"), length_scale=scale, **how)
    tables = [
        pd.DataFrame(np.column_stack([one.points, one.displacement]), columns=list(QUANTITIES))
        for one in read_frames(paths, options, format)
    ]
    for number, table in enumerate(tables):
        table.insert(0, "frame", number)
    return pd.concat(tables, ignore_index=True)


def _of_curves(
    read: Callable[..., Iterable[Any]], names: Sequence[str]
) -> Callable[..., pd.DataFrame]:
    def table(paths: Sequence[Path], **how: Any) -> pd.DataFrame:
        curves = [curve for path in paths for curve in read(path, **how)]
        return pd.concat(
            [pd.DataFrame({name: getattr(curve, name) for name in names}) for curve in curves],
            ignore_index=True,
        )

    return table


def _biaxial(paths: Sequence[Path], **how: Any) -> pd.DataFrame:
    tables = []
    for one in (read_biaxial_table(path, **how) for path in paths):
        values = np.column_stack([one.load, one.strain])
        tables.append(pd.DataFrame(values, columns=list(Biaxial.columns)))
        if one.ratio is not None:
            tables[-1]["ratio"] = one.ratio
    return pd.concat(tables, ignore_index=True)


READERS: dict[str, Callable[..., pd.DataFrame]] = {
    "bubble": _frames,
    "strips": _of_curves(read_load_curves, ("direction", "specimen", "elongation", "load")),
    "biaxial": _biaxial,
    "cylinder": _of_curves(read_bending_curves, ("repetition", "deflection", "load")),
}


@dataclass(frozen=True, eq=False)
class Registered:
    """A bubble in the test's coordinates, and how these were found; `str` is a line of it.
    numbers : centre, tilt, warp and their errors, in mm and degrees, as in result.json."""

    bubble: Bubble
    registration: CameraRegistration

    @property
    def numbers(self) -> dict[str, Any]:
        return registration_numbers(self.registration)

    def __str__(self) -> str:
        return registration_line(self.registration)


def register(
    bubble: Bubble | Numbers,
    displacements: Numbers = None,
    pressures: Numbers = None,
    **keys: Any,
) -> Registered:
    """Register a bubble, or arrays as `Bubble` takes them, in the camera's coordinates.

    Steps are found unless the bubble's registration gives them. InputError for a step that cannot
    be found and must be given.
    """
    if not isinstance(bubble, Bubble):
        bubble = Bubble(bubble, displacements, pressures, **keys)
    if (points := bubble.section["data"].get("points")) is None:
        raise InputError(bubble.name, "", "is computed; nothing is to be registered")
    asked = {**points, "registration": points.get("registration", {})}
    project = Project.of(bubble.with_keys(data={"points": asked}), fabric=Fabric("", 0.1))
    test: Any = project.tests[bubble.name]
    with project.naming_arguments():
        fields, registration = read_measured(test)
    assert registration is not None
    heights = [np.full(len(f.points), np.nan) if f.z is None else f.z for f in fields]
    places = [np.column_stack([f.points, z]) for f, z in zip(fields, heights, strict=True)]
    kept = {k: v for k, v in bubble.section.items() if k not in ("data", "pressures")}
    kept |= {k: points[k] for k in ("filter", "correlation") if k in points}
    moved = [f.displacement for f in fields]
    loads = [f.pressure for f in fields]
    return Registered(Bubble(places, moved, loads, **kept), registration)
