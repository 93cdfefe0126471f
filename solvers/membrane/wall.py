"""What the wall of a closed membrane does where it is pressed together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...errors import InputError
from ..base import BandEnd


@dataclass(frozen=True)
class Wall:
    """What a closed membrane's wall does where it is pressed together.

    Parameters
    ----------
    wrinkle_stiffness : share of its stiffness that is left across a wrinkle (a tension field, see
        materials/relaxation.py); None: it carries compression as it carries tension, and folds
        where that makes it unstable.
    bending_stiffness : share of the wall's own, E t^3/12, that counts where rigid bodies bend the
        membrane; with none, folds are as fine as the mesh.

    Raises
    ------
    InputError : a share that is not a number from 0 to 1 (bending: to any size).
    """

    wrinkle_stiffness: float | None = None
    bending_stiffness: float = 1.0

    def __post_init__(self) -> None:
        share = self.wrinkle_stiffness
        if share is not None and not 0 < share <= 1:
            raise InputError(None, "wrinkle_stiffness", f"expected 0 < share <= 1, got {share!r}")
        if not 0 <= self.bending_stiffness < np.inf:
            problem = f"expected 0 or more, got {self.bending_stiffness!r}"
            raise InputError(None, "bending_stiffness", problem)


#: Names of the walls: both ends of the band, what is predicted first; or one of them alone.
Walls = Literal["band", "tension field", "stiff"]

#: Share of its stiffness that a tension field keeps across a wrinkle: what it carries is about one
#: per cent of the load. With a third of it a beam of 25 mm elements collapses where finer ones do
#: not (150 mm, 140 kPa, card "bubble 1": 4 % less load at 240 mm), and three times the work.
LEFT = 3e-4
#: A coated fabric bends far more easily than a solid sheet of its thickness: it wrinkles where it
#: is pressed together.
TENSION_FIELD = Wall(wrinkle_stiffness=LEFT)
#: The other end: as stiff as a solid sheet.
STIFF = Wall()

BAND = (
    BandEnd(
        "tension field",
        "the wall wrinkles where it is pressed together and carries no compression, as a fabric "
        "that bends far more easily than a solid sheet of its thickness; this is what is predicted",
        {"wall": "tension field"},
    ),
    BandEnd(
        "stiff wall",
        "the wall carries compression as it carries tension, and bends and folds like a solid "
        "sheet of its thickness: more than a coated fabric can; where it folds its loads also "
        "depend on the mesh",
        {"wall": "stiff"},
        predicted=False,
    ),
)


def chosen_wall(
    name: Walls, wrinkle_stiffness: float | None, bending_stiffness: float | None
) -> Wall | None:
    """The one wall that settings ask for; None: the band.

    Parameters
    ----------
    wrinkle_stiffness, bending_stiffness : as `Wall` has them, None where they are not given. Where
        one of them is, there is no band: the wall is a tension field if it has the first.

    Raises
    ------
    InputError : as `Wall`; a name that there is not, a stiff wall with wrinkles.
    """
    if name not in ("band", "tension field", "stiff"):
        problem = f"expected 'band', 'tension field' or 'stiff', got {name!r}"
        raise InputError(None, "wall", problem)
    if name == "band" and wrinkle_stiffness is None and bending_stiffness is None:
        return None
    if name == "stiff" and wrinkle_stiffness is not None:
        problem = "a stiff wall has no wrinkles; leave this out, or wall = 'stiff'"
        raise InputError(None, "wrinkle_stiffness", problem)
    if name == "tension field" and wrinkle_stiffness is None:
        wrinkle_stiffness = LEFT
    return Wall(wrinkle_stiffness, 1.0 if bending_stiffness is None else bending_stiffness)
