"""The rigid bodies of the bending test: two supports and a collar."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from ..errors import InputError

#: Inner diameter and length (mm) of the collar by the largest diameter of cylinder it is for: those
#: of thesis section 6.2, which goes no further.
COLLARS = {200.0: (240.0, 145.0), 250.0: (295.0, 147.0)}


@dataclass(frozen=True)
class RigidSupports:
    """Two cylinders along x under the tube, frictionless, at z = span / 2 and -span / 2.

    Parameters
    ----------
    span : mm between their axes.
    diameter : mm, outer.
    """

    span: float = 2000.0
    diameter: float = 100.0

    def __post_init__(self) -> None:
        _check(self, "supports")


@dataclass(frozen=True)
class Collar:
    """A ring around the middle of the tube, its axis along z, frictionless, pulled down.

    Parameters
    ----------
    inner_diameter, length : mm. fillet : mm, radius of its inner edges.
    """

    inner_diameter: float
    length: float
    fillet: float = 10.0

    def __post_init__(self) -> None:
        _check(self, "collar")
        if self.fillet > 0.5 * self.length:
            problem = f"{self.fillet:g} mm is more than half the collar's length, {self.length:g}"
            raise InputError(None, "collar.fillet", problem)


def usual_collar(diameter: float) -> Collar:
    """The collar for a cylinder of this diameter (mm) where none is given.

    Raises
    ------
    InputError : the cylinder is larger than any that there is one for.
    """
    for largest, (inner, length) in COLLARS.items():
        if diameter <= largest:
            return Collar(inner, length)
    problem = f"there is none for {diameter:g} mm; give inner_diameter and length"
    raise InputError(None, "collar", problem)


def _check(body: RigidSupports | Collar, name: str) -> None:
    for field in fields(body):
        value = getattr(body, field.name)
        if not 0 < value < math.inf:
            problem = f"expected a length above 0 mm, got {value!r}"
            raise InputError(None, f"{name}.{field.name}", problem)
