"""Result files of other programs: their mesh, their frames, and how meshio reads them.

`meshio.read("job.frd")` works in whoever imports us; meshio is not imported for that, but given our
readers when somebody imports it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import field
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path
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


class _MeshioReader(MetaPathFinder):
    """Gives meshio a reader of a file's suffix, now or right after it is imported."""

    def __init__(self, suffix: str, read: Callable[..., Any]) -> None:
        self.suffix = suffix
        self.read = read
        if "meshio" in sys.modules:
            self._register(sys.modules["meshio"])
        else:
            sys.meta_path.insert(0, self)

    def _register(self, module: Any) -> None:
        module.register_format(self.suffix, [f".{self.suffix}"], self.read, {})

    def find_spec(self, name: str, *_: Any) -> ModuleSpec | None:
        """Return the module meshio, which registers the reader as soon as it is loaded."""
        if name != "meshio":
            return None
        sys.meta_path.remove(self)
        spec = find_spec(name)
        if spec is not None and spec.loader is not None:
            loader: Any = spec.loader
            load = loader.exec_module

            def exec_module(module: Any) -> None:
                load(module)
                self._register(module)

            loader.exec_module = exec_module
        return spec


def register_with_meshio(suffix: str, read: Callable[[Path | str], Any]) -> None:
    """Let `meshio.read` read files of this suffix."""
    _MeshioReader(suffix, read)
