"""Rectangular meshes of cut strips, pulled along y."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .mesh import Mesh

Array = NDArray[np.float64]


def strip_mesh(
    width: float,
    length: float,
    across: int,
    along: int,
    gauge_length: float | None = None,
    symmetry: Literal["full", "half"] = "full",
) -> Mesh:
    """Rectangular quads in the xy plane, the middle of the width at x = 0, y from 0 to length.

    Parameters
    ----------
    width : mm, of the WHOLE strip.
    length : mm, between the lower and the upper end.
    across, along : quads in each direction, across counted on what is meshed; even across on a
        whole strip, so that there are nodes on its middle line.
    gauge_length : mm between the two gauge nodes, which lie on the middle line at equal distance
        from both ends; the rows between them are stretched or squeezed to meet it exactly. The
        whole length unless given.
    symmetry : the whole strip, or the half x >= 0.

    Returns
    -------
    Mesh : quads counter-clockwise (normal +z). Node sets: `bottom`, `top` (the ends), `gauge` (two
        nodes, the lower first), `free_edges`; on a half also `symmetry_x` (x = 0, where u_x = 0).

    Raises
    ------
    InputError : lengths that are not positive, a gauge that does not fit, counts that are not
        whole numbers above zero, an odd number of quads across a whole strip.
    """
    gauge = length if gauge_length is None else gauge_length
    for name, value in (("width", width), ("length", length), ("gauge_length", gauge)):
        if not 0 < value < math.inf:
            raise InputError(None, name, f"expected a length above 0 mm, got {value!r}")
    if gauge > length:
        raise InputError(None, "gauge_length", f"{gauge} mm is longer than the strip, {length} mm")
    for name, count in (("across", across), ("along", along)):
        if count != int(count) or count < 1:
            raise InputError(None, name, f"expected a whole number of quads, got {count!r}")
    if symmetry == "full" and across % 2:
        raise InputError(None, "across", f"expected an even number on a whole strip, got {across}")
    y, lower = _levels(length, along, gauge)
    x = np.linspace(0.0 if symmetry == "half" else -0.5 * width, 0.5 * width, across + 1)
    middle = 0 if symmetry == "half" else across // 2
    x[middle] = 0.0
    row = across + 1
    points = np.zeros((row * (along + 1), 3))
    points[:, 0], points[:, 1] = np.tile(x, along + 1), np.repeat(y, row)
    first = (row * np.arange(along)[:, None] + np.arange(across)).ravel()
    quads = np.stack([first, first + 1, first + row + 1, first + row], axis=1).astype(np.intp)
    nodes = np.arange(len(points)).reshape(along + 1, row)
    sets = {
        "bottom": nodes[0],
        "top": nodes[-1],
        "gauge": nodes[[lower, along - lower], middle],
        "free_edges": nodes[:, -1] if symmetry == "half" else np.sort(nodes[:, [0, -1]].ravel()),
    }
    if symmetry == "half":
        sets["symmetry_x"] = nodes[:, 0]
    return Mesh(points, quads, sets)


def _levels(length: float, along: int, gauge: float) -> tuple[Array, int]:
    """Heights of the rows of nodes (along + 1,), and the row of the lower gauge node.

    The gauge gets the number of rows, as odd or even as `along`, that keeps the quads nearest to
    one height.
    """
    if gauge == length:
        return np.linspace(0.0, length, along + 1), 0
    if along < 3:
        raise InputError(None, "along", f"a gauge inside the strip needs 3 rows, got {along}")
    inside = np.arange(2 - along % 2, along - 1, 2)
    rows = int(inside[np.argmin(np.abs(inside / along - gauge / length))])
    outside = (along - rows) // 2
    ends = 0.5 * (length - gauge), 0.5 * (length + gauge)
    return (
        np.concatenate(
            [
                np.linspace(0.0, ends[0], outside + 1),
                np.linspace(ends[0], ends[1], rows + 1)[1:-1],
                np.linspace(ends[1], length, outside + 1),
            ]
        ),
        outside,
    )


def yarn_direction(angle: float) -> Array:
    """Unit vector (3,) of a yarn at `angle` degrees from the pull (y), turned towards x."""
    turn = math.radians(angle)
    return np.array([math.sin(turn), math.cos(turn), 0.0])
