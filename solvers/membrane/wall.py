"""Assumptions on the wall of a closed membrane in compression: the two ends of a band."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...errors import InputError
from ..base import BandEnd


@dataclass(frozen=True)
class Wall:
    """Behaviour of the wall of a closed membrane in compression.

    Attributes
    ----------
    wrinkle_stiffness : float or None
        Share of the fabric's stiffness that is left across a wrinkle (a tension field, see
        materials/wrinkles.py); None if the wall carries compression.
    bending_stiffness : float
        Bending stiffness as a share of that of a solid sheet, E t^3/12 (t is the thickness), where
        rigid bodies bend the membrane. With 0, folds become as fine as the mesh.
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


#: Names of the walls: both ends of the band, or one of them alone.
Walls = Literal["band", "tension field", "stiff"]
#: Share of the fabric's stiffness that a tension field keeps across a wrinkle. It carries about one
#: per cent of the load of a bent beam; with a third of it, a beam of 25 mm elements collapses where
#: one of finer elements does not.
LEFT = 3e-4
#: The wall of a coated fabric, which bends far more easily than a solid sheet of its thickness.
TENSION_FIELD = Wall(wrinkle_stiffness=LEFT)
#: The wall that bends and carries compression like a solid sheet of its thickness.
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
    """Return the wall that the settings of the membrane solver describe.

    Parameters
    ----------
    name : {"band", "tension field", "stiff"}
    wrinkle_stiffness, bending_stiffness : float, optional
        See `Wall`.

    Returns
    -------
    Wall or None
        None for the band: `name` is "band" and neither stiffness is given.

    Raises
    ------
    InputError
        For another name, or settings that contradict each other.
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
