"""Quadrilateral surface meshes as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of four-node quadrilaterals.

    Parameters
    ----------
    points : (n, 3) mm; warp is x, fill is y.
    quads : (m, 4) node numbers, counter-clockwise seen from the side that pressure inflates to.
    node_sets : node numbers by name, each sorted and without repeats.
    """

    points: NDArray[np.float64]
    quads: NDArray[np.intp]
    node_sets: Mapping[str, NDArray[np.intp]]
