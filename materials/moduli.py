"""What a tangent modulus depends on: which strain and which coefficients, in either form."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError

Array = NDArray[np.float64]
Form = Literal["polynomial", "trilinear"]

#: First coefficient of each modulus in beta, and the strain component it depends on.
MODULI: dict[str, tuple[int, int]] = {"E1": (8, 0), "E2": (4, 1), "G12": (0, 2)}
#: The coefficients that a tri-linear law has no use for.
UNUSED = tuple(first for first, _ in MODULI.values())
#: A strain that is never reached.
UNLIMITED = 1e9


def strain_breaks(breaks: ArrayLike) -> Array:
    """The breaks of a tri-linear law, (3, 2): two strains for each of (eps1, eps2, gamma12).

    Raises
    ------
    InputError : not three pairs of finite, positive, increasing strains.
    """
    try:
        pairs = np.array(breaks, dtype=float)
    except (TypeError, ValueError):
        pairs = np.empty(0)
    good = pairs.shape == (3, 2) and np.isfinite(pairs).all()
    if not good or not (pairs[:, 0] > 0).all() or not (np.diff(pairs) > 0).all():
        raise InputError(
            None,
            "breaks",
            "expected two positive, increasing strains for each of (eps1, eps2, gamma12), "
            f"got {' '.join(str(breaks).split())}",
        )
    return pairs


def held_strain(name: str, strain: ArrayLike, end: float) -> Array:
    """The strain at which the modulus 'E1', 'E2' or 'G12' (of |gamma12|) is taken: in [0, end]."""
    x = np.asarray(strain, dtype=float)
    return np.clip(np.abs(x) if name == "G12" else x, 0.0, end)


def coefficient_rows(held: Array, breaks: Array | None = None) -> Array:
    """d modulus / d (its four coefficients) at held strains (n,), (n, 4).

    Without breaks the powers x^3, x^2, x, 1; with two (2,), whether the strain is in none
    (always 0), beyond the second, between them, up to the first. A break belongs to the region
    below it.
    """
    if breaks is None:
        return np.vander(held, 4)
    region = np.searchsorted(breaks, held)
    return np.eye(4)[3 - region]
