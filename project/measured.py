"""Reading of measured files into tables, and registration of bubbles in the test's coordinates."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, check_one_of
from ..experiments.biaxial.paths import read_biaxial_table
from ..experiments.bubble.findings import registration_line, registration_numbers
from ..experiments.bubble.prepared import read_measured
from ..experiments.bubble.registration import CameraRegistration
from ..experiments.sections import Fabric
from ..lazy_modules import pandas as pd
from ..readers.bending import read_bending_curves
from ..readers.curves import read_load_curves
from ..readers.fields import DisplacementField
from ..readers.frames import QUANTITIES, FrameOptions, read_frames
from ..readers.sections import LENGTH_UNITS
from .objects import Biaxial, Bubble, Files, Numbers, file_names
from .project import Project, naming_arguments


def read(files: Files, of: str | None = None, **options: Any) -> pd.DataFrame:
    """Read measured files of any format into one table, in mm, N and MPa.

    Parameters
    ----------
    files : path or pattern, or a sequence of them
    of : {"bubble", "strips", "biaxial", "cylinder"}, optional
        The kind of test; the first that the files can be read as by default.
    **options
        Options of the readers: `columns`, `format`, `decimal`, `length_unit`, `direction`,
        `width` ...

    Returns
    -------
    DataFrame
        One row per reading, its columns by the kind of test. "bubble": frame (from 0), x, y, z,
        dx, dy, dz (mm). "strips": direction, specimen, elongation (mm), load (N). "biaxial":
        warp_load, fill_load (N/mm), warp_strain, fill_strain (mm/mm) and, if the files have it,
        ratio. "cylinder": repetition, deflection (mm), load (N).

    Raises
    ------
    InputError
        The files cannot be read.
    """
    paths = [Path(name) for name in file_names(files)]
    check_one_of(of, READERS, "of")
    problems = []
    for kind, reader in READERS.items():
        if of in (None, kind):
            try:
                return reader(paths, **options)
            except InputError as error:
                if of is not None:
                    raise
                problems.append(f"as {kind}: {error.problem}")
            except TypeError as error:  # this kind's readers do not have one of the options
                problems.append(f"as {kind}: {error}")
    raise InputError(paths[0], "", f"cannot be read {'; '.join(problems)}")


def _frames(
    paths: Sequence[Path], length_unit: str = "mm", format: str | None = None, **options: Any
) -> pd.DataFrame:
    """Return the points and displacements of all frames of a bubble in one table."""
    scale = LENGTH_UNITS[length_unit]
    frame_options = FrameOptions(("x", "y", "dx", "dy", "dz"), length_scale=scale, **options)
    tables = [
        pd.DataFrame(np.column_stack([frame.points, frame.displacement]), columns=list(QUANTITIES))
        for frame in read_frames(paths, frame_options, format)
    ]
    for number, table in enumerate(tables):
        table.insert(0, "frame", number)
    return pd.concat(tables, ignore_index=True)


def _of_curves(
    read: Callable[..., Iterable[Any]], names: Sequence[str]
) -> Callable[..., pd.DataFrame]:
    """Return a function that reads curves into one table with these attributes as columns."""

    def table(paths: Sequence[Path], **options: Any) -> pd.DataFrame:
        curves = [curve for path in paths for curve in read(path, **options)]
        return pd.concat(
            [pd.DataFrame({name: getattr(curve, name) for name in names}) for curve in curves],
            ignore_index=True,
        )

    return table


def _biaxial(paths: Sequence[Path], **options: Any) -> pd.DataFrame:
    """Return the readings of all files of a biaxial test in one table."""
    tables = []
    for path in paths:
        readings = read_biaxial_table(path, **options)
        values = np.column_stack([readings.load, readings.strain])
        table = pd.DataFrame(values, columns=list(Biaxial.columns))
        if readings.ratio is not None:
            table["ratio"] = readings.ratio
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


READERS = {
    "bubble": _frames,
    "strips": _of_curves(read_load_curves, ("direction", "specimen", "elongation", "load")),
    "biaxial": _biaxial,
    "cylinder": _of_curves(read_bending_curves, ("repetition", "deflection", "load")),
}


@dataclass(frozen=True, eq=False)
class Registered:
    """A bubble in the test's coordinates, and the registration that found them.

    Attributes
    ----------
    bubble : Bubble
        Its points in the coordinates of the test.
    registration : Registration
        The steps from the camera's coordinates to the test's, with their errors.
    """

    bubble: Bubble
    registration: CameraRegistration

    @property
    def numbers(self) -> dict[str, Any]:
        """Return centre (mm), tilt and warp direction (degrees), with errors, as plain values."""
        return registration_numbers(self.registration)

    def __str__(self) -> str:
        return registration_line(self.registration)


def register(
    bubble: Bubble | Numbers,
    displacements: Numbers = None,
    pressures: Numbers = None,
    **keys: Any,
) -> Registered:
    """Register a bubble: transform its points from the camera's to the test's coordinates.

    Parameters
    ----------
    bubble : Bubble or array
        The bubble, or its points in the camera's coordinates as `Bubble` takes them.
    displacements : (frames, m, 3) array, or a sequence of (m, 3) arrays, mm
        Displacements of the points, if arrays are given.
    pressures : (frames,) array, MPa
        Pressure of each frame, if arrays are given.
    **keys
        Further arguments of `Bubble`. Steps of the registration that its `registration` does not
        give are found from the data.

    Returns
    -------
    Registered

    Raises
    ------
    InputError
        A step cannot be found from the data and must be given.
    """
    if not isinstance(bubble, Bubble):
        bubble = Bubble(bubble, displacements, pressures, **keys)
    if (points := bubble.section["data"].get("points")) is None:
        raise InputError(bubble.name, "", "is computed; nothing is to be registered")
    points = {**points, "registration": points.get("registration", {})}
    project = Project.of(bubble.with_keys(data={"points": points}), fabric=Fabric("", 0.1))
    test: Any = project.tests[bubble.name]
    with naming_arguments():
        fields, registration = read_measured(test)
    assert registration is not None
    section = {k: v for k, v in bubble.section.items() if k not in ("data", "pressures")}
    section |= {k: points[k] for k in ("filter", "correlation") if k in points}
    registered = Bubble(
        [_points_of(field) for field in fields],
        [field.displacement for field in fields],
        [field.pressure for field in fields],
        **section,
    )
    return Registered(registered, registration)


def _points_of(field: DisplacementField) -> np.ndarray:
    """Return the (m, 3) points of a field at rest; z is NaN where no height is known."""
    z = np.full(len(field.points), np.nan) if field.z is None else field.z
    return np.column_stack([field.points, z])
