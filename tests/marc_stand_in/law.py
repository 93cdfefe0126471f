"""The law that a deck holds, from values of its moduli: tables of NLELAST, or HYPELA2 at work.

The membrane solver takes piecewise cubics; a table is straight between its points. What the points
lie on is recognised, piece by piece: ONE cubic through all points of a stretch (least squares, to
`EXACT` of the largest), with jumps between two stretches. So the stand-in's moduli are those of
the law and not of its table, which is lower or higher by up to 2e-4 between two of 121 points.
Points on no such curve are refused.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from numpy.typing import NDArray

from .content import Content, Table
from .fields import DeckError
from .piecewise import piecewise_law

Array = NDArray[np.float64]

#: Relative, of the largest modulus: the deck has 13 digits.
EXACT = 1e-9
#: Strain over which a table's modulus jumps, at most.
JUMP = 1e-5
#: Points that a cubic is recognised by: one more than it has coefficients.
FEWEST = 5
#: From the places of a cubic's values to the powers there: of points, or means over steps.
Powers = Callable[[Array], Array]


def law_of_tables(content: Content) -> HypoelasticLaw:
    """The law of a deck with NLELAST."""
    material = content.material
    assert material is not None and material.kind == "nlelast"
    if material.tables[2] != 0:
        raise DeckError("nlelast: nu12 with a table")
    curves = []
    for name, k in (("E1", 0), ("E2", 1), ("G12", 3)):
        factor, number = material.multipliers[k], material.tables[k]
        if number == 0:
            curves.append(held(factor))
            continue
        curves.append(_of_table(content.tables[number], name, factor))
    return piecewise_law(*curves, material.multipliers[2])


def held(value: float, end: float = 1.0) -> Array:
    """(1, 5) one piece of a constant modulus; it is held beyond `end`."""
    return np.array([[end, 0.0, 0.0, 0.0, value]])


def _of_table(table: Table, name: str, factor: float) -> Array:
    """Pieces (n, 5) of the modulus for strains from zero up, after a look at those below."""
    x, y = table.x, factor * table.y
    if not (y > 0).all():
        raise DeckError(f"table {table.number} of {name}: a modulus is not above 0")
    mirror = y[::-1] if name == "G12" else np.full(int((x <= 0).sum()), np.interp(0.0, x, y))
    if name == "G12" and not np.allclose(x, -x[::-1], rtol=0, atol=1e-12):
        raise DeckError(f"table {table.number} of {name} is not of both signs alike")
    if np.abs(y[: len(mirror)] - mirror).max() > EXACT * y.max():
        raise DeckError(f"table {table.number} of {name}: wrong below zero")
    x, y = x[x >= 0], y[x >= 0]
    if x[0] != 0.0:
        raise DeckError(f"table {table.number} of {name} has no point at zero")
    if np.ptp(y) <= EXACT * y.max():
        return held(float(y[0]), float(x[-1]))
    if y[-1] == y[-2]:  # the point that holds the end
        x, y = x[:-1], y[:-1]
    rows, i = [], 0
    while i < len(x) - 1:
        last, cubic = longest_stretch(x, y, i, powers_at)
        if cubic is not None:
            rows.append([x[last], *cubic])
            # At a knot the next piece begins with this point, after a jump with the one beyond.
            i = last
        elif rows and x[i + 1] - x[i] < JUMP:
            i += 1
        else:
            raise DeckError(f"table {table.number} of {name} lies on no cubics, piece by piece")
    return np.array(rows)


def powers_at(x: Array) -> Array:
    """(n, 4) powers of strains, highest first."""
    return np.vander(x, 4)


def longest_stretch(x: Array, y: Array, first: int, powers: Powers) -> tuple[int, Array | None]:
    """Last point of the longest stretch from `first` on that lies on one cubic, and the cubic.

    Equal values are one from two on; other cubics from FEWEST on.
    """
    size, equal = EXACT * float(np.abs(y).max()), first
    while equal + 1 < len(y) and abs(y[equal + 1] - y[first]) <= size:
        equal += 1
    last, cubic = first, None
    if equal > first:
        last, cubic = equal, np.array([0.0, 0.0, 0.0, y[first : equal + 1].mean()])
    for n in range(max(equal + 1, first + FEWEST - 1), len(x)):
        through = cubic_through(x[first : n + 1], y[first : n + 1], powers, size)
        if through is None:
            break
        last, cubic = n, through
    return last, cubic


def cubic_through(x: Array, y: Array, powers: Powers, size: float) -> Array | None:
    """(4,) of the one cubic through all points, to `size`; None where there is none."""
    scale = float(np.abs(x).max())
    weights = scale ** np.arange(3, -1, -1)
    rows = powers(x) / weights
    found = np.linalg.lstsq(rows, y, rcond=None)[0]
    if np.abs(rows @ found - y).max() > size:
        return None
    return np.asarray(found / weights)
