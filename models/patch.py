"""A patch of a sheet in a biaxial test as plain data: homogeneous, pulled along warp and fill."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..meshes.mesh import Mesh
from .parameters import OfThickness

Array = NDArray[np.float64]

#: mm; any square would do.
SIDE = 100.0
#: Degrees of freedom held at zero: the lines x = 0 and y = 0 stay where they are.
ROLLERS: Mapping[str, tuple[int, ...]] = {"symmetry_x": (0,), "symmetry_y": (1,)}
#: Node sets of the edges that are pulled, along x and along y.
PULLED = ("right", "top")
#: The corner whose displacement over the side is the strain of the patch.
FAR_CORNER = 2


@dataclass(frozen=True, eq=False)
class PatchModel(OfThickness):
    """A square of the sheet, warp along x and fill along y, with loads per width on its edges.

    Parameters
    ----------
    loads : (n, 2) N/mm (the same number as kN/m) along warp and fill, forces over the width before
        the test: the increments over which the law is integrated, every one reported.
    thickness : mm, before the test.

    Raises
    ------
    InputError : loads that are not such numbers, a thickness that is not positive.
    """

    loads: Array
    thickness: float

    def __post_init__(self) -> None:
        values = np.array(self.loads, dtype=float)
        if values.ndim != 2 or values.shape[1:] != (2,) or not len(values):
            raise InputError(None, "loads", f"expected loads (n, 2), got shape {values.shape}")
        if not np.isfinite(values).all():
            raise InputError(None, "loads", "expected finite numbers")
        if not self.thickness > 0:
            raise InputError(None, "thickness", f"expected > 0, got {self.thickness}")
        object.__setattr__(self, "loads", values)

    @cached_property
    def mesh(self) -> Mesh:
        """One quad, for solvers that need a mesh."""
        points = SIDE * np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
        sets = {"symmetry_x": [0, 3], "symmetry_y": [0, 1], "right": [1, 2], "top": [2, 3]}
        return Mesh(
            points,
            np.array([[0, 1, 2, 3]]),
            {name: np.array(nodes) for name, nodes in sets.items()},
        )

    def displacements(self, elongation: ArrayLike) -> Array:
        """(n, 4, 3) mm of the corners at elongations (n, 2)."""
        e = np.asarray(elongation, dtype=float)
        moved = np.zeros((len(e), 4, 3))
        moved[:, :, :2] = self.mesh.points[:, :2] * e[:, None, :]
        return moved


def elongations(displacement: ArrayLike) -> Array:
    """(n, 2, ...) elongation along warp and fill from displacements (n, 4, 3, ...) of a patch."""
    return np.asarray(displacement, dtype=float)[:, FAR_CORNER, :2] / SIDE
