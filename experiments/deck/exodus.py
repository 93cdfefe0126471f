"""Read the nodal results of Exodus II files, as MOOSE, Sierra and SfePy write them.

meshio reads the first time step of such a file alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...solvers.result_files import ResultFrame, ResultMesh

#: A component of a vector: "disp_x", "DISPLX".
_COMPONENT = re.compile(r"(.+?)_?([xyz])", re.IGNORECASE)


class ExodusFile:
    """The results of an Exodus file: places of the nodes, node sets, and all time steps.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    mesh : ResultMesh
        Nodes, numbered from 1, without elements.
    sets : dict of str to array of int
        Numbers of the nodes of every named set, by its name in capitals.

    Raises
    ------
    ModuleNotFoundError
        netCDF4 is not installed.
    """

    def __init__(self, path: Path) -> None:
        import netCDF4

        with netCDF4.Dataset(path) as dataset:
            dataset.set_auto_mask(False)
            variables = dataset.variables
            self.mesh = ResultMesh.of_points(_places(variables))
            set_names = _names(variables, "ns_names")
            self.sets = {
                name.upper(): variables[f"node_ns{number}"][:]
                for number, name in enumerate(set_names, start=1)
                if f"node_ns{number}" in variables
            }
            self._times = variables["time_whole"][:]
            self._fields = _vectors(_nodal_variables(variables))

    def frames(self) -> Iterator[ResultFrame]:
        """Yield the results of every time step."""
        for step, time in enumerate(self._times):
            fields = {name: values[step] for name, values in self._fields.items()}
            yield ResultFrame(float(time), fields=fields)


def _places(variables: Any) -> np.ndarray:
    """Return the places (nodes, axes) of the nodes along the axes that the file has."""
    if "coord" in variables:
        return np.transpose(variables["coord"][:])
    keys = [key for key in ("coordx", "coordy", "coordz") if key in variables]
    return np.column_stack([variables[key][:] for key in keys])


def _names(variables: Any, key: str) -> list[str]:
    """Return the names in a table of characters (names, length), none where there is no table."""
    if key not in variables:
        return []
    return [b"".join(row).split(b"\0")[0].decode().strip() for row in variables[key][:]]


def _nodal_variables(variables: Any) -> dict[str, np.ndarray]:
    """Return the values (steps, nodes) of every nodal variable: an array each, or one for all."""
    names = _names(variables, "name_nod_var")
    if "vals_nod_var" in variables:
        return dict(zip(names, np.moveaxis(variables["vals_nod_var"][:], 1, 0), strict=True))
    return {name: variables[f"vals_nod_var{k}"][:] for k, name in enumerate(names, start=1)}


def _vectors(scalars: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the fields (steps, nodes, c): components of a vector are one field."""
    components: dict[str, list[str]] = {}
    for name in sorted(scalars, key=str.lower):
        component = _COMPONENT.fullmatch(name)
        components.setdefault(component[1] if component else name, []).append(name)
    return {
        stem if len(names) > 1 else names[0]: np.stack([scalars[name] for name in names], axis=-1)
        for stem, names in components.items()
    }
