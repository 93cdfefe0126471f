"""The pieces of a law as lists of numbers: what libraries and subroutines of solvers are given."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .forms.base import COMPONENTS
from .law import HypoelasticLaw

Array = NDArray[np.float64]


def curve_pieces(law: HypoelasticLaw, name: str) -> Array:
    """(n, 5) pieces of the modulus "E1", "E2" or "G12", MPa, each of them once.

    A row is the upper end of a piece and its four coefficients, highest power of the strain
    first; below zero strain and beyond the last end the modulus is held.

    Raises
    ------
    InputError : moduli that pieces of strain do not tell, because they depend on the load ratio.
    """
    if law.of_load_ratio:
        problem = (
            f"a {law.form.name} law is for the solver membrane: its moduli depend on the ratio of "
            "the loads, and here they are moduli of strain"
        )
        raise InputError(None, "form", problem)
    rows = law.pieces[COMPONENTS[name]]
    # What repeats the last piece ends where it does.
    return np.asarray(rows[: 1 + int((np.diff(rows[:, 0]) > 0).sum())])


def piece_constants(law: HypoelasticLaw) -> tuple[float, ...]:
    """How many pieces E1, E2 and G12 have (3), then the numbers of each: its pieces, row by row."""
    curves = [curve_pieces(law, name) for name in ("E1", "E2", "G12")]
    numbers = np.concatenate([curve.ravel() for curve in curves])
    return (*(float(len(curve)) for curve in curves), *numbers.tolist())
