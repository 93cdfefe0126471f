"""Find the law that a deck holds: in tables of NLELAST, or by calling its subroutine HYPELA2.

The membrane solver takes piecewise cubics; a table is straight between its points. Each stretch of
points on ONE cubic (least squares, to `EXACT` of the largest) is found, with jumps between two. So
the stand-in's moduli are those of the law and not of its table, which differs by up to 2e-4 between
two of 121 points. Points on no such curve are refused.

Marc calls HYPELA2 at every point; here the moduli are found from its stresses. From zero the strain
goes up in steps of one component. The stresses of a step give D11 and D12 (or D22, G12) of it, and
with nu12 = D12/D22 at zero strain the means of E1, E2 and G12 over it.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from bubblefit.materials.forms.base import UNLIMITED
from bubblefit.materials.law import HypoelasticLaw, ThicknessChange
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from .deck import Array, Content, DeckError, Table

#: Relative, of the largest modulus: the deck has 13 digits.
EXACT = 1e-9
#: Strain over which a table's modulus jumps, at most.
JUMP = 1e-5
#: Points that a cubic is recognised by: one more than it has coefficients.
FEWEST = 5
#: Strains that HYPELA2 is asked for, and their steps.
REACH, STEPS = 0.6, 1200
#: From the places of a cubic's values to the powers there: of points, or means over steps.
Powers = Callable[[Array], Array]
#: What Marc has for a subroutine to end the job with.
QUIT = """
      subroutine quit(number)
      integer number, last
      common /asked/ last
      last = number
      end
"""


class NotCompiled(Exception):
    """The compiler's message."""


@dataclass(frozen=True)
class Piecewise:
    """The form of a law whose beta holds the coefficients of every piece of E1, E2 and G12.

    ends : the strains at which one piece of E1, E2, G12 gives way to the next.
    """

    ends: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]
    name = "piecewise"

    @property
    def size(self) -> int:
        return 4 * sum(len(ends) + 1 for ends in self.ends)

    @property
    def free(self) -> range:
        return range(self.size)

    def piece_map(self) -> Array:
        most = max(map(len, self.ends)) + 1
        whole, first = np.zeros((3, most, 4, self.size)), 0
        for component, ends in enumerate(self.ends):
            for piece in range(most):
                begin = first + 4 * min(piece, len(ends))
                whole[component, piece, :, begin : begin + 4] = np.eye(4)
            first += 4 * (len(ends) + 1)
        return whole

    def uppers(self) -> Array:
        most = max(map(len, self.ends)) + 1
        return np.array([[*ends, *[UNLIMITED] * (most - len(ends))] for ends in self.ends], float)

    def grid(self, component: int, end: float) -> Array:
        knots = [0.0, *(at for at in self.ends[component] if at < end), end]
        return np.unique(np.concatenate([np.linspace(a, b, 31) for a, b in pairwise(knots)]))


def piecewise_law(
    e1: ArrayLike, e2: ArrayLike, g12: ArrayLike, nu12: float = 0.24, thickness: str = "constant"
) -> HypoelasticLaw:
    """Return the law of three moduli (n, 5), MPa: upper end and coefficients of each piece."""
    curves = [np.asarray(curve, dtype=float) for curve in (e1, e2, g12)]
    form = Piecewise(tuple(tuple(curve[:-1, 0].tolist()) for curve in curves))  # type: ignore[arg-type]
    beta = np.concatenate([curve[:, 1:].ravel() for curve in curves])
    ends = np.array([curve[-1, 0] for curve in curves])
    return HypoelasticLaw(beta, nu12, ends, thickness, form)  # type: ignore[arg-type]


def law_of_tables(content: Content) -> HypoelasticLaw:
    """Return the law of a deck with NLELAST."""
    material = content.material
    if material.tables[2] != 0:
        raise DeckError("nlelast: nu12 with a table")
    curves = []
    for name, k in (("E1", 0), ("E2", 1), ("G12", 3)):
        factor, number = material.multipliers[k], material.tables[k]
        if number == 0:
            curves.append([[1.0, 0.0, 0.0, 0.0, factor]])
            continue
        curves.append(_of_table(content.tables[number], name, factor))
    return piecewise_law(*curves, material.multipliers[2])


def _of_table(table: Table, name: str, factor: float) -> Array:
    """Return pieces (n, 5) of the modulus for strains from zero up, after a look at those below."""
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
        return np.array([[x[-1], 0.0, 0.0, 0.0, y[0]]])
    if y[-1] == y[-2]:  # the point that holds the end
        x, y = x[:-1], y[:-1]
    rows, i = [], 0
    while i < len(x) - 1:
        last, cubic = _stretch(x, y, i, lambda at: np.vander(at, 4))
        if cubic is not None:
            rows.append([x[last], *cubic])
            # At a knot the next piece begins with this point, after a jump with the one beyond.
            i = last
        elif rows and x[i + 1] - x[i] < JUMP:
            i += 1
        else:
            raise DeckError(f"table {table.number} of {name} lies on no cubics, piece by piece")
    return np.array(rows)


def _stretch(x: Array, y: Array, first: int, powers: Powers) -> tuple[int, Array | None]:
    """Return the last point of the longest stretch from `first` on one cubic, and the cubic.

    Equal values are one from two on; other cubics from FEWEST on.
    """
    size, equal = EXACT * float(np.abs(y).max()), first
    while equal + 1 < len(y) and abs(y[equal + 1] - y[first]) <= size:
        equal += 1
    last, cubic = first, None
    if equal > first:
        last, cubic = equal, np.array([0.0, 0.0, 0.0, y[first : equal + 1].mean()])
    for n in range(max(equal + 1, first + FEWEST - 1), len(x)):
        through = _cubic(x[first : n + 1], y[first : n + 1], powers, size)
        if through is None:
            break
        last, cubic = n, through
    return last, cubic


def _cubic(x: Array, y: Array, powers: Powers, size: float) -> Array | None:
    """Return the one cubic (4,) through all points, to `size`; None where there is none."""
    scale = float(np.abs(x).max())
    weights = scale ** np.arange(3, -1, -1)
    rows = powers(x) / weights
    found = np.linalg.lstsq(rows, y, rcond=None)[0]
    if np.abs(rows @ found - y).max() > size:
        return None
    return np.asarray(found / weights)


def compiled(source: Path, folder: Path) -> ctypes.CDLL:
    """Return the subroutine as a library."""
    compiler = shutil.which("gfortran")
    if compiler is None:
        raise NotCompiled("gfortran: command not found")
    folder = folder.resolve()
    host, library = folder / "standin_quit.f", folder / "standin_hypela2.so"
    host.write_text(QUIT)
    command = [compiler, "-O1", "-fPIC", "-shared", "-ffixed-form", str(source), str(host)]
    done = subprocess.run([*command, "-o", str(library)], capture_output=True, text=True)
    if done.returncode:
        raise NotCompiled(done.stderr or f"gfortran ended with {done.returncode}")
    loaded = ctypes.CDLL(str(library))
    host.unlink()
    library.unlink()
    return loaded


class Point:
    """An integration point of a membrane: strain, stress and states as Marc keeps them."""

    def __init__(self, library: ctypes.CDLL, states: int) -> None:
        self.function = library.hypela2_
        self.asked = ctypes.c_int32.in_dll(library, "asked_")
        self.asked.value = 0
        self.strain, self.stress, self.states = np.zeros(3), np.zeros(3), np.zeros(states)

    def step(self, increment: Array) -> Array | None:
        """Return the stress after an increment of strain; None if the subroutine ends the job."""
        d, g, zero = np.zeros((3, 3), order="F"), np.zeros(3), np.zeros(99)
        e, de = self.strain.copy(), np.array(increment, dtype=float)
        s, t = self.stress.copy(), self.states.copy()
        whole = [np.array(v, dtype=np.int32) for v in (
            3, [1, 1], 1, [1, 1], [1, 1], 2, 1, 3, 3, 6, 2, 4, 139, [1, 1], 0, 0,
        )]  # fmt: skip
        # d g e de s t dt; ngens m nn kcus matus ndi nshear; disp ... eigvn1; ncrd itel ... ifu
        arrays = [d, g, e, de, s, t, zero, *whole[:7], *[zero] * 11, *whole[7:]]
        self.function(*(array.ctypes.data_as(ctypes.c_void_p) for array in arrays))
        if self.asked.value:
            return None
        self.strain, self.stress, self.states = self.strain + increment, s, t
        return s


def law_of_subroutine(library: ctypes.CDLL, states: int) -> HypoelasticLaw:
    """Return the law that the subroutine carries; DeckError: its moduli are no cubics."""
    thickness = _thickness(library, states)
    thin = 1.0 if thickness == "incompressible" else 0.0
    # A modulus below zero strain is that at zero, so that a step down gives it exactly.
    (d11, d12, _), (_, d22, _) = (_tangents(library, states, k, -1, thin, 1)[0] for k in (0, 1))
    nu12 = d12 / d22
    coupling = 1.0 - nu12**2 * d22 / d11
    k = nu12**2 * d22 * coupling
    a, c, g12 = (_tangents(library, states, k, 1, thin, STEPS)[:, k] for k in range(3))
    e1 = 0.5 * (a + np.sqrt(a * a - 4.0 * a * k))
    e2 = c / (1.0 + c * nu12**2 / (d11 * coupling))
    return piecewise_law(*(_pieces(y) for y in (e1, e2, g12)), float(nu12), thickness)


def _tangents(
    library: ctypes.CDLL, states: int, component: int, sign: int, thin: float, steps: int
) -> Array:
    """Return the change of Cauchy stress over that of the strain, step by step, (steps, 3)."""
    point, increment = Point(library, states), np.zeros(3)
    increment[component] = sign * REACH / STEPS
    stress = [np.zeros(3)]
    for _ in range(steps):
        found = point.step(increment)
        if found is None:
            break
        stress.append(found * np.exp(thin * (point.strain[0] + point.strain[1])))
    if len(stress) < 2:
        raise DeckError("hypela2 ended the job at its first call")
    return np.diff(stress, axis=0) / increment[component]


def _thickness(library: ctypes.CDLL, states: int) -> ThicknessChange:
    """Return "incompressible" if stress falls as the surface grows, by a shear stress over eps1."""
    point = Point(library, states)
    before = point.step(np.array([0.0, 0.0, 1e-3]))
    after = point.step(np.array([1e-3, 0.0, 0.0]))
    if before is None or after is None:
        raise DeckError("hypela2 ended the job at its first call")
    fall = -np.log(after[2] / before[2]) / 1e-3
    if abs(fall) < 1e-6:
        return "constant"
    if abs(fall - 1.0) < 1e-6:
        return "incompressible"
    raise DeckError(f"hypela2: shear stress changes with eps1 by {fall:g}")


def _pieces(y: Array) -> Array:
    """Return pieces (n, 5) of a modulus from its means over the steps; held beyond the last."""
    step = REACH / STEPS
    middle = step * (np.arange(len(y)) + 0.5)
    stretches, i = [], 0
    while i < len(y):
        last, cubic = _stretch(middle, y, i, _mean_powers)
        if cubic is not None:
            stretches.append((i, last, cubic))
        elif not stretches or stretches[-1][1] != i - 1:
            raise DeckError("hypela2: a modulus lies on no cubics, piece by piece")
        i = last + 1
    rows = []
    for (_, here, before), (there, _, after) in pairwise(stretches):
        # In the step between two stretches one piece gives way to the next.
        end = step * there if there == here + 1 else _place(y[here + 1], here + 1, before, after)
        rows.append([end, *before])
    rows.append([UNLIMITED, *stretches[-1][2]])
    return np.array(rows)


def _mean_powers(middle: Array) -> Array:
    """Return means of powers (n, 4), highest first, over the steps with these middles."""
    a, b = middle - 0.5 * REACH / STEPS, middle + 0.5 * REACH / STEPS
    columns = [(a + b) * (a * a + b * b) / 4, (a * a + a * b + b * b) / 3, (a + b) / 2, 1 + 0 * a]
    return np.stack(columns, axis=1)


def _place(mean: float, step: int, before: Array, after: Array) -> float:
    """Return the strain in a step where one cubic gives way to another, from the mean over the
    step."""
    start, end = REACH / STEPS * step, REACH / STEPS * (step + 1)

    def off(place: float) -> float:
        lower = np.polyval(np.polyint(before), place) - np.polyval(np.polyint(before), start)
        upper = np.polyval(np.polyint(after), end) - np.polyval(np.polyint(after), place)
        return float(lower + upper - mean * (end - start))

    if off(start) * off(end) > 0:  # both cubics are the same but for rounding
        return start if abs(off(start)) < abs(off(end)) else end
    return float(brentq(off, start, end, xtol=1e-16, rtol=1e-15))
