"""What the wall of a closed membrane does where it is pressed together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import InputError


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
