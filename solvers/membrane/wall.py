"""The wall of a closed membrane where it is pressed together: a band of two behaviours."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...errors import InputError
from ..base import BandEnd


@dataclass(frozen=True)
class Wall:
    """Behaviour of a closed membrane's wall where it is pressed together.

    wrinkle_stiffness : share of its stiffness left across a wrinkle (a tension field, see
    materials/wrinkles.py); None: it carries compression. bending_stiffness : share of E t^3/12
    where rigid bodies bend the membrane; with none, folds are as fine as the mesh.
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
#: Share of its stiffness that a tension field keeps across a wrinkle, with about one per cent of
#: the load. With a third of it a beam of 25 mm elements collapses where finer ones do not.
LEFT = 3e-4
#: A coated fabric, which bends far more easily than a solid sheet of its thickness.
TENSION_FIELD = Wall(wrinkle_stiffness=LEFT)
#: A solid sheet of its thickness.
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
    """Return the wall of the settings.

    Parameters
    ----------
    name : {"band", "tension field", "stiff"}
    wrinkle_stiffness, bending_stiffness : float, optional
        See `Wall`.

    Returns
    -------
    Wall or None
        None for the band, without both stiffnesses.
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
