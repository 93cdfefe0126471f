"""Quadrilateral surface meshes as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface of four-node quadrilaterals.

    Parameters
    ----------
    points : (n, 3) mm; warp is x, fill is y, unless `warp` says otherwise.
    quads : (m, 4) node numbers, counter-clockwise seen from the side that pressure inflates to.
    node_sets : node numbers by name, each sorted and without repeats.
    element_sets : numbers of quads by name, likewise.
    warp : (m, 3) direction of the warp yarn in each quad, unit vectors; None where it is the same
        for all and the model's to say. The fill yarn is a quarter turn from it, counter-clockwise.
    """

    points: NDArray[np.float64]
    quads: NDArray[np.intp]
    node_sets: Mapping[str, NDArray[np.intp]]
    element_sets: Mapping[str, NDArray[np.intp]] = field(default_factory=dict)
    warp: NDArray[np.float64] | None = None
