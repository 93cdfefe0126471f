"""Result files of other programs: their mesh, their frames, and the mesh that meshio gets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..light_dataclasses import dataclass

if TYPE_CHECKING:
    import meshio

Array = NDArray[np.float64]
#: meshio's name of an element type, and its order of the nodes where that differs.
Cells = Mapping[int, tuple[str, tuple[int, ...] | None]]


@dataclass(frozen=True, eq=False)
class ResultMesh:
    """Numbers (n,) and points (n, 3) of the nodes; per element its type and node numbers."""

    numbers: NDArray[np.int64]
    points: Array
    elements: tuple[tuple[int, NDArray[np.int64]], ...]

    @classmethod
    def of_points(cls, points: Array) -> ResultMesh:
        """Return points (n, 1 to 3), zero along further axes, numbered from 1, without elements."""
        numbers = np.arange(1, len(points) + 1)
        return cls(numbers, np.pad(points, ((0, 0), (0, 3 - points.shape[1]))), ())


@dataclass(eq=False)
class ResultFrame:
    """An increment: total time, step, its number, fields by name (nodes, c), NaN: no value."""

    time: float = 0.0
    step: int = 0
    increment: int = 0
    fields: dict[str, Array] = field(default_factory=dict)


def last_frame(file: Any, types: Cells) -> meshio.Mesh:
    """Return mesh and last increment of a result file; InputError: an unknown type or node."""
    import meshio

    mesh = file.mesh
    cells = list[tuple[str, list[Any]]]()
    for kind, nodes in mesh.elements:
        if kind not in types:
            raise InputError(file.path, "elements", f"of type {kind} are not known here")
        name, order = types[kind]
        place = np.minimum(np.searchsorted(mesh.numbers, nodes), len(mesh.numbers) - 1)
        if (mesh.numbers[place] != nodes).any():
            raise InputError(file.path, "elements", "refer to a node that is not there")
        if not cells or cells[-1][0] != name:
            cells.append((name, []))
        cells[-1][1].append(place if order is None else place[list(order)])
    result = meshio.Mesh(mesh.points, [(name, np.array(rows)) for name, rows in cells])
    for frame in file.frames():
        result.point_data = dict(frame.fields)
        names = ("time", "step", "increment")
        result.field_data = {name: np.array([getattr(frame, name)]) for name in names}
    return result
