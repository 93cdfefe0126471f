"""A closed membrane, inflated and then bent between rigid cylinders, as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..meshes.mesh import Mesh
from .gas import Gas

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class RigidCylinder:
    """A rigid post (infinitely long) that the membrane lies on, or a ring around it.

    Parameters
    ----------
    name : of its reaction in the history; bodies of one name are added up.
    axis : unit vector. centre : mm.
    radius : mm, outside of a post, inside of a ring.
    ring : the membrane is inside.
    length, fillet : mm, of a ring: how long it is and how its mouth is rounded.
    """

    name: str
    axis: Vector
    centre: Vector
    radius: float
    ring: bool = False
    length: float = np.inf
    fillet: float = 10.0


@dataclass(frozen=True, eq=False)
class Bending:
    """Rigid cylinders that bend an inflated membrane with a constant mass of gas in it.

    Parameters
    ----------
    supports : bodies at rest; each is brought up along minus `direction` to touch first.
    collar : the body that moves along `direction`; it is brought down to touch first.
    displacements : mm of the collar from touching, increasing: the increments.
    reported : index of each of them that is a frame; all unless given.
    released : node set held only while inflating.
    penalty : MPa/mm of contact. gas : what is closed in.
    """

    supports: Sequence[RigidCylinder]
    collar: RigidCylinder
    displacements: Sequence[float]
    direction: Vector = (0.0, -1.0, 0.0)
    released: str | None = None
    penalty: float = 5.0
    gas: Gas = field(default_factory=Gas)
    reported: Sequence[int] | None = None


@dataclass(frozen=True, eq=False)
class InflatedModel:
    """A closed membrane of any shape, or the part of one that symmetry planes close.

    Parameters
    ----------
    mesh : mm; quads counter-clockwise seen from outside.
    thickness : mm, one or (elements,). warp : (3,) or (elements, 3) direction of the warp yarn,
        projected on each facet.
    pressures : MPa, increasing: the increments of inflation, and frames where nothing bends it.
    supports : degrees of freedom held at zero, by node set; symmetry planes among them.
    copies : how many times the mesh makes the whole (4 for a quarter): forces and volume are
        reported for the whole.
    bending : what happens after inflation.

    Raises
    ------
    InputError : pressures or displacements that do not increase, a thickness that is not
        positive, a node set that the mesh does not have.
    """

    mesh: Mesh
    thickness: ArrayLike
    warp: ArrayLike
    pressures: Sequence[float]
    supports: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    copies: int = 1
    bending: Bending | None = None

    def __post_init__(self) -> None:
        schedules = {"pressures": (self.pressures, "MPa")}
        sets = list(self.supports)
        if self.bending is not None:
            schedules["displacements"] = (self.bending.displacements, "mm")
            sets += [self.bending.released] if self.bending.released else []
        for name, (values, unit) in schedules.items():
            if not len(values) or not (np.diff(values, prepend=0.0) > 0).all():
                raise InputError(None, name, f"expected positive, increasing, got {values} {unit}")
        if not (np.asarray(self.thickness, dtype=float) > 0).all():
            raise InputError(None, "thickness", "expected > 0 mm in every element")
        for name in sets:
            if name not in self.mesh.node_sets:
                raise InputError(
                    None, "supports", f"no node set {name!r} in the mesh; it has "
                    f"{', '.join(sorted(self.mesh.node_sets)) or 'none'}",
                )  # fmt: skip

    def fixed(self, bent: bool = False) -> NDArray[np.intp]:
        """Held unknowns, 3 * node + direction, sorted; fewer once `bent`."""
        released = self.bending.released if bent and self.bending else None
        dofs = [
            3 * self.mesh.node_sets[name] + direction
            for name, directions in self.supports.items()
            if name != released
            for direction in directions
        ]
        return np.unique(np.concatenate(dofs or [np.empty(0, dtype=np.intp)])).astype(np.intp)
