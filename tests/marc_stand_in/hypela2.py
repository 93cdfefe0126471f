"""The law of a user subroutine HYPELA2: compiled, called as Marc calls it, and asked for stresses.

Marc would call it at every point; here the moduli are found from what it answers. From zero the
strain goes up in steps of one component. The stresses of a step give D11 and D12 (or D22, G12) of
that step, and with nu12 = D12/D22 at zero strain the means of E1, E2 and G12 over it.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
from bubblefit.materials.forms.base import UNLIMITED
from bubblefit.materials.law import HypoelasticLaw, ThicknessChange
from numpy.typing import NDArray

from .endings import NotCompiled
from .fields import DeckError
from .law import longest_stretch
from .piecewise import piecewise_law

Array = NDArray[np.float64]

#: Strains that are asked for, and their steps.
REACH, STEPS = 0.6, 1200
#: What Marc has for a subroutine to end the job with.
QUIT = """
      subroutine quit(number)
      integer number, last
      common /asked/ last
      last = number
      end
"""


def compiled(source: Path, folder: Path) -> ctypes.CDLL:
    """The subroutine as a library."""
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
        """Stress after an increment of strain; None where the subroutine ends the job."""
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
    """The law that the subroutine carries.

    Raises
    ------
    DeckError : its moduli are no cubics, piece by piece.
    """
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
    """(steps, 3) change of Cauchy stress over that of the strain, step by step."""
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
    """Whether a stress falls as the surface grows: shear stress does not know of eps1 otherwise."""
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
    """Pieces (n, 5) of a modulus from its means over the steps; held beyond the last."""
    step = REACH / STEPS
    middle = step * (np.arange(len(y)) + 0.5)
    stretches, i = [], 0
    while i < len(y):
        last, cubic = longest_stretch(middle, y, i, _mean_powers)
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
    """(n, 4) means of powers, highest first, over the steps with these middles."""
    a, b = middle - 0.5 * REACH / STEPS, middle + 0.5 * REACH / STEPS
    columns = [(a + b) * (a * a + b * b) / 4, (a * a + a * b + b * b) / 3, (a + b) / 2, 1 + 0 * a]
    return np.stack(columns, axis=1)


def _place(mean: float, step: int, before: Array, after: Array) -> float:
    """Where in a step one cubic gives way to another, when this is its mean over the step."""
    start, end = REACH / STEPS * step, REACH / STEPS * (step + 1)

    def off(place: float) -> float:
        lower = np.polyval(np.polyint(before), place) - np.polyval(np.polyint(before), start)
        upper = np.polyval(np.polyint(after), end) - np.polyval(np.polyint(after), place)
        return float(lower + upper - mean * (end - start))

    low, high = start, end
    if off(low) * off(high) > 0:  # both cubics are the same but for rounding
        return low if abs(off(low)) < abs(off(high)) else high
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if off(low) * off(middle) > 0 else (low, middle)
    return 0.5 * (low + high)
