"""Find the law that a deck holds: in tables of NLELAST, or by calling its subroutine HYPELA2.

Each stretch of points on ONE cubic (least squares, to `EXACT` of the largest) is found, with jumps
between two; points on no such curve are refused. Those of a subroutine are the moduli in its
stiffness, and its stress after one increment has to agree with them.
"""

import ctypes
import shutil
import subprocess
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from bubblefit.materials.forms.base import UNLIMITED
from bubblefit.materials.law import HypoelasticLaw

from .deck import DeckError

#: Relative, of the largest modulus: the deck has 13 digits. Strain over which a table's modulus
#: jumps, at most; points that a cubic is recognised by.
EXACT, JUMP, FEWEST = 1e-9, 1e-5, 5
#: Strains at which HYPELA2 is asked for its moduli.
ASKED = np.linspace(0.0, 0.6, 1201)
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

    ends : the strains at which pieces of E1, E2, G12 end, equally many of each.
    """

    ends: tuple[tuple[float, ...], ...]
    size: int
    name = "piecewise"

    @property
    def free(self):
        return range(self.size)

    def piece_map(self):
        return np.eye(self.size).reshape(3, -1, 4, self.size)

    def uppers(self):
        return np.array(self.ends)

    def grid(self, component, end):
        knots = [0.0, *(at for at in self.ends[component] if at < end), end]
        return np.unique(np.concatenate([np.linspace(a, b, 31) for a, b in pairwise(knots)]))


def piecewise_law(e1, e2, g12, nu12=0.24, thickness="constant"):
    """Return the law of three moduli (n, 5), MPa: upper end and coefficients of each piece."""
    curves, most = [np.array(curve, float) for curve in (e1, e2, g12)], max(map(len, (e1, e2, g12)))
    ends = np.array([curve[-1, 0] for curve in curves])
    for curve in curves:
        curve[-1, 0] = UNLIMITED
    # The last piece again, where another modulus has more.
    pieces = np.array([np.pad(c, ((0, most - len(c)), (0, 0)), "edge") for c in curves])
    form = Piecewise(tuple(map(tuple, pieces[..., 0].tolist())), 12 * most)
    return HypoelasticLaw(pieces[..., 1:].ravel(), nu12, ends, thickness, form)


def law_of_tables(content):
    if content.moduli[2] != 0:
        raise DeckError("nlelast: nu12 with a table")
    curves = []
    for name, k in (("E1", 0), ("E2", 1), ("G12", 3)):
        factor, number = content.multipliers[k], content.moduli[k]
        if number == 0:
            curves.append([[1.0, 0.0, 0.0, 0.0, factor]])
            continue
        what, x = f"table {number} of {name}", content.tables[number].x
        y = factor * content.tables[number].y
        if not (y > 0).all():
            raise DeckError(f"{what}: a modulus is not above 0")
        mirror = y[::-1] if name == "G12" else np.full(int((x <= 0).sum()), np.interp(0.0, x, y))
        if name == "G12" and not np.allclose(x, -x[::-1], rtol=0, atol=1e-12):
            raise DeckError(f"{what} is not of both signs alike")
        if np.abs(y[: len(mirror)] - mirror).max() > EXACT * y.max() or 0.0 not in x:
            raise DeckError(f"{what}: wrong below zero, or without a point there")
        x, y = x[x >= 0], y[x >= 0]
        # The last point holds the end.
        last = len(x) - int(np.ptp(y) > EXACT * y.max() and y[-1] == y[-2])
        curves.append(_pieces(x[:last], y[:last], what))
    return piecewise_law(*curves, content.multipliers[2])


def _pieces(x, y, what, modulus=None):
    """Return pieces (n, 5) of the modulus through points from zero strain up.

    modulus : finds it anywhere; without it one piece gives way to the next in a point.
    """
    rows, i, size = [], 0, EXACT * float(np.abs(y).max())
    while i < len(x) - 1:
        last, cubic = _stretch(x[i:], y[i:], size)
        last += i
        if cubic is None:
            if not rows or modulus or x[i + 1] - x[i] > JUMP:
                raise DeckError(f"{what}: the modulus lies on no cubics, piece by piece")
            last = i + 1
        else:
            end = x[last]
            if modulus and last + 1 < len(x):
                beyond = x[last + 1]
                for _ in range(50):
                    middle = 0.5 * (end + beyond)
                    if abs(np.polyval(cubic, middle) - modulus(middle)) <= size:
                        end = middle
                    else:
                        beyond = middle
                last += 1
            rows.append([end, *cubic])
        i = last
    return np.array(rows)


def _stretch(x, y, size):
    """Return the last of the first points that are on one cubic to `size`, and the cubic.

    Equal values are one from two on; other cubics from FEWEST on.
    """
    last = int(np.argmax(np.append(np.abs(y - y[0]) > size, True))) - 1
    cubic = np.array([0.0, 0.0, 0.0, y[: last + 1].mean()]) if last else None
    low, beyond = max(last, FEWEST - 2), len(x)
    while low + 1 < beyond:
        n = (low + beyond) // 2
        if (through := _cubic(x[: n + 1], y[: n + 1], size)) is None:
            beyond = n
        else:
            low, last, cubic = n, n, through
    return last, cubic


def _cubic(x, y, size):
    """Return the one cubic (4,) through all points, to `size`; None where there is none."""
    weights = float(np.abs(x).max()) ** np.arange(3, -1, -1)
    rows = np.vander(x, 4) / weights
    found = np.linalg.lstsq(rows, y, rcond=None)[0]
    return None if np.abs(rows @ found - y).max() > size else found / weights


def compiled(source, folder):
    compiler = shutil.which("gfortran")
    if compiler is None or not source.exists():
        raise NotCompiled(f"gfortran: command not found, or no such file: {source.name}")
    host, library = folder / "standin_quit.f", folder / "standin_hypela2.so"
    host.write_text(QUIT)
    command = [compiler, "-O1", "-fPIC", "-shared", "-ffixed-form", str(source), str(host)]
    done = subprocess.run([*command, "-o", str(library)], capture_output=True, text=True)
    if done.returncode:
        raise NotCompiled(done.stderr or f"gfortran ended with {done.returncode}")
    return ctypes.CDLL(str(library.resolve()))


def law_of_subroutine(library, states):
    """Return the law that the subroutine carries; DeckError: its moduli are no cubics."""
    asked = ctypes.c_int32.in_dll(library, "asked_")

    def called(k, strain, more=0.0, thin=0):
        """Return Cauchy stress and stiffness (3, 3) of component k; NaN: it ended the job."""
        d, g, s, zero = np.zeros((3, 3), order="F"), np.zeros(3), np.zeros(3), np.zeros(99)
        e, de, t = np.zeros(3), np.zeros(3), np.zeros(states)
        e[k], t[1 + k], de[k], asked.value = strain, strain, more, 0
        whole = [np.array(v, dtype=np.int32) for v in (
            3, [1, 1], 1, [1, 1], [1, 1], 2, 1, 3, 3, 6, 2, 4, 139, [1, 1], 0, 0,
        )]  # fmt: skip
        # d g e de s t dt; ngens m nn kcus matus ndi nshear; disp ... eigvn1; ncrd itel ... ifu
        arrays = [d, g, e, de, s, t, zero, *whole[:7], *[zero] * 11, *whole[7:]]
        library.hypela2_(*(array.ctypes.data_as(ctypes.c_void_p) for array in arrays))
        grown = np.exp(thin * (strain + more) * (k < 2)) if not asked.value else np.nan
        return grown * s[k], grown * d

    d = called(0, 0.0)[1]
    thin = -np.log(called(0, 1e-3)[1][2, 2] / d[2, 2]) / 1e-3
    if not min(abs(thin), abs(thin - 1.0)) < 1e-6:
        raise DeckError(f"hypela2 ended the job, or its stress falls with eps1 by {thin:g}")
    nu12, thin = d[0, 1] / d[1, 1], round(thin)
    coupling = 1.0 - nu12**2 * d[1, 1] / d[0, 0]
    curves = []
    for k in range(3):

        def modulus(own, k=k):
            if k == 0:
                return 0.5 * (own + np.sqrt(own * own - 4.0 * own * nu12**2 * d[1, 1] * coupling))
            return own / (1.0 + own * nu12**2 / (d[0, 0] * coupling)) if k == 1 else own

        def at(strain, k=k, modulus=modulus):
            return modulus(called(k, strain, 0.0, thin)[1][k, k])

        y = np.array([at(strain) for strain in ASKED])
        end = float(ASKED[np.isfinite(y)][-1])
        rows = _pieces(ASKED[np.isfinite(y)], y[np.isfinite(y)], "hypela2", at)
        ends = np.array([0.0, *rows[:-1, 0], end])
        rows[-1, 0] = UNLIMITED
        whole = [np.polyval(np.polyint(row[1:]), ends[i : i + 2]) for i, row in enumerate(rows)]
        mean = np.diff(whole).sum() / end
        if not abs(modulus(called(k, 0.0, end, thin)[0] / end) / mean - 1.0) < 1e-8:
            raise DeckError("hypela2: its stress does not follow its stiffness")
        curves.append(rows)
    return piecewise_law(*curves, float(nu12), "incompressible" if thin else "constant")
