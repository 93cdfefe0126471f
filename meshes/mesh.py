"""Quadrilateral surface meshes as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Mesh:
    """points (n, 3) mm, quads (m, 4) node numbers, node_sets by name."""

    points: NDArray[np.float64]
    quads: NDArray[np.intp]
    node_sets: Mapping[str, NDArray[np.intp]]
