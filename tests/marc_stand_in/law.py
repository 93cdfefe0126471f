"""The law that a deck holds, from values of its moduli: tables of NLELAST, or HYPELA2 at work.

The membrane solver takes cubics or three constants of strain, and holds a modulus beyond the end
of its range; a table is straight between its points. What the points lie on is recognised: one
value, ONE cubic through all points of the range (least squares, to `EXACT` of the largest), or
steps. So the stand-in's moduli are those of the law and not of its table, which is lower or higher
by up to 2e-4 between two of 121 points. Anything else is refused.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from bubblefit.materials.law import UNLIMITED, HypoelasticLaw, ThicknessChange
from numpy.typing import NDArray

from .content import Content, Table
from .fields import DeckError

Array = NDArray[np.float64]

#: Relative, of the largest modulus: the deck has 13 digits.
EXACT = 1e-9
#: Strain over which a table's modulus jumps, at most.
JUMP = 1e-5


@dataclass
class Modulus:
    """Coefficients of a cubic (highest power first) up to `end`; or steps = (moduli, breaks)."""

    cubic: Array | None
    end: float = UNLIMITED
    steps: tuple[list[float], list[float]] | None = None


def law_of(
    e1: Modulus, e2: Modulus, g12: Modulus, nu12: float, thickness: ThicknessChange = "constant"
) -> HypoelasticLaw:
    """The law of three moduli (MPa): cubics, unless one has steps."""
    ends = np.array([e1.end, e2.end, g12.end])
    moduli = (g12, e2, e1)
    if all(m.cubic is not None for m in moduli):
        beta = np.concatenate([m.cubic for m in moduli])  # type: ignore[misc]
        return HypoelasticLaw(beta, nu12, ends, thickness)
    values, breaks = zip(*(_three(m) for m in (e1, e2, g12)), strict=True)
    return HypoelasticLaw.trilinear(*values, breaks, nu12, ends, thickness)


def _three(modulus: Modulus) -> tuple[list[float], list[float]]:
    """Three constants and two breaks, the last of which may be out of reach."""
    if modulus.steps is None:
        if modulus.cubic is None or modulus.cubic[:3].any():
            raise DeckError("a law of steps and cubics")
        modulus.steps = ([float(modulus.cubic[3])], [])
    values, breaks = modulus.steps
    if len(breaks) > 2:
        raise DeckError(f"a modulus of {len(values)} steps")
    away = [UNLIMITED / 4, UNLIMITED / 2]
    return (values + [values[-1]] * 2)[:3], (breaks + away[len(breaks) :])[:2]


def law_of_tables(content: Content) -> HypoelasticLaw:
    """The law of a deck with NLELAST."""
    material = content.material
    assert material is not None and material.kind == "nlelast"
    if material.tables[2] != 0:
        raise DeckError("nlelast: nu12 with a table")
    found = []
    for name, k in (("E1", 0), ("E2", 1), ("G12", 3)):
        factor, number = material.multipliers[k], material.tables[k]
        if number == 0:
            found.append(Modulus(np.array([0.0, 0.0, 0.0, factor])))
            continue
        found.append(_of_table(content.tables[number], name, factor))
    return law_of(*found, material.multipliers[2])


def _of_table(table: Table, name: str, factor: float) -> Modulus:
    """The modulus for strains from zero up, after a look at those below."""
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
        return Modulus(np.array([0.0, 0.0, 0.0, y[0]]))
    if y[-1] == y[-2]:  # the point that holds the end
        x, y = x[:-1], y[:-1]
    cubic = cubic_through(x, y)
    if cubic is not None:
        return Modulus(cubic, float(x[-1]))
    jumps = np.flatnonzero(np.diff(y) != 0.0)
    if (np.diff(x)[jumps] > JUMP).any() or len(jumps) > 2:
        raise DeckError(f"table {table.number} of {name} is neither a cubic nor of three steps")
    values = [float(v) for v in y[[0, *(jumps + 1)]]]
    return Modulus(None, float(x[-1]), (values, x[jumps].tolist()))


def cubic_through(x: Array, y: Array) -> Array | None:
    """(4,) of the one cubic through all points; None where there is none."""
    if len(x) < 5:
        return None
    size = float(np.abs(x).max())
    rows = np.vander(x / size, 4)
    found = np.linalg.lstsq(rows, y, rcond=None)[0]
    if np.abs(rows @ found - y).max() > EXACT * np.abs(y).max():
        return None
    return np.asarray(found / size ** np.arange(3, -1, -1))
