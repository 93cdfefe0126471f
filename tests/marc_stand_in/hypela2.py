"""The law of a user subroutine HYPELA2: compiled, called as Marc calls it, and asked for stresses.

Marc would call it at every point; here the moduli are found from what it answers. From zero the
strain goes up in steps of one component. The stresses of a step give D11 and D12 (or D22, G12) of
that step, and with nu12 = D12/D22 at zero strain E1, E2 and G12 at its middle.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
from bubblefit.materials.law import HypoelasticLaw, ThicknessChange
from numpy.typing import NDArray

from .endings import NotCompiled
from .fields import DeckError
from .law import EXACT, Modulus, cubic_through, law_of

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
    DeckError : its moduli are neither cubics nor constants in three regions.
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
    return law_of(*(_modulus(y) for y in (e1, e2, g12)), float(nu12), thickness)


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


def _modulus(y: Array) -> Modulus:
    """What the moduli of all steps lie on."""
    step = REACH / STEPS
    x, size = step * (np.arange(len(y)) + 0.5), EXACT * np.abs(y).max()
    tail = len(y) - 1
    while tail and abs(y[tail - 1] - y[-1]) < size:
        tail -= 1
    if tail == 0:
        return Modulus(np.array([0.0, 0.0, 0.0, y[-1]]))
    held = len(y) - tail > 1
    some = tail - 1 if held else len(y)
    whole = cubic_through(x[:some], y[:some])
    if whole is None:
        return _steps(y, step, size)
    if not held:
        return Modulus(whole)
    end = _end(whole, y[-1], step * tail, step)
    # One constant up to the first break of a tri-linear modulus is a cubic as well.
    return _steps(y, step, size) if end is None else Modulus(whole, end)


def _end(cubic: Array, value: float, guess: float, step: float) -> float | None:
    """Strain near `guess` where the cubic has the value that is held from there on."""
    roots = np.roots(cubic - np.array([0.0, 0.0, 0.0, value])).real
    near = roots[np.abs(roots - guess) < 2 * step]
    reached = near[np.abs(np.polyval(cubic, near) - value) < 1e-7 * abs(value)]
    return float(reached[np.argmin(np.abs(reached - guess))]) if len(reached) else None


def _steps(y: Array, step: float, size: float) -> Modulus:
    """Constants; a step of strain that goes over a break has the mean of both sides."""
    values, breaks, i = [float(y[0])], [], 1
    while i < len(y):
        if abs(y[i] - values[-1]) < size:
            i += 1
            continue
        after = y[min(i + 1, len(y) - 1)]
        share = (y[i] - after) / (values[-1] - after) if after != y[i] else 0.0
        if not 0 <= share < 1:
            raise DeckError("hypela2: a modulus is neither a cubic nor of steps")
        breaks.append(step * (i + share))
        values.append(float(after))
        i += 2 if share else 1
    return Modulus(None, steps=(values, breaks))
