"""Elements of a solver's result file as meshio's blocks of cells."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError


def cell_blocks(
    path: Path,
    numbers: NDArray[np.int64],
    elements: Iterable[tuple[int, NDArray[np.int64]]],
    names: Mapping[int, tuple[str, tuple[int, ...] | None]],
) -> list[tuple[str, NDArray[Any]]]:
    """Runs of elements of one type, their nodes counted from 0.

    Parameters
    ----------
    numbers : (n,) of the nodes in the file, increasing.
    names : by the file's type: meshio's name, and its order of the nodes where it differs.

    Raises
    ------
    InputError : a type that `names` does not have, a node that is not there.
    """
    cells: list[tuple[str, list[Any]]] = []
    for kind, nodes in elements:
        if kind not in names:
            raise InputError(path, "elements", f"of type {kind} are not known here")
        name, order = names[kind]
        place = np.searchsorted(numbers, nodes)
        place = np.minimum(place, len(numbers) - 1)
        if (numbers[place] != nodes).any():
            raise InputError(path, "elements", "refer to a node that is not there")
        if not cells or cells[-1][0] != name:
            cells.append((name, []))
        cells[-1][1].append(place if order is None else place[list(order)])
    return [(name, np.array(rows)) for name, rows in cells]
