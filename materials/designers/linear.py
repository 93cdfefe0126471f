"""Constants from biaxial paths by least squares, as the trade does it.

Of every path each yarn's strain is replaced by its regression line over the larger of the two
loads (through the beginning of the path), likewise the loads. Constants are then those with the
least sum of squares, at points evenly spread along these lines, of strains (inverse form) or of
loads (direct form). Two yarns of five ratios are ten strain paths; the eight without the unloaded
yarns of 1:0 and 0:1 are the usual choice.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError
from .constants import DesignersConstants

Array = NDArray[np.float64]
Minimise = Literal["strain", "load"]

#: Points of a line whose squares are added.
POINTS = 10
#: Of the larger load's change: a yarn whose load changes by less is unloaded.
UNLOADED = 0.1


@dataclass(frozen=True, eq=False)
class LinearPath:
    """The straight lines of one ratio, from its beginning.

    load : (2,) kN/m and strain : (2,) by which they change to the end. residual : (2,) RMS of the
    measured strains about their lines.
    """

    ratio: str
    load: Array
    strain: Array
    residual: Array

    @property
    def unloaded(self) -> tuple[bool, bool]:
        """Whether the load of the warp, of the fill hardly changes."""
        least = UNLOADED * float(np.abs(self.load).max())
        warp, fill = np.abs(self.load) < least
        return bool(warp), bool(fill)


def line_of(ratio: str, load: ArrayLike, strain: ArrayLike) -> LinearPath:
    """The lines through the beginning of a path: loads (n, 2) kN/m, strains (n, 2).

    Raises
    ------
    InputError : a load that does not change.
    """
    n, eps = np.asarray(load, dtype=float), np.asarray(strain, dtype=float)
    larger = n.max(axis=1)
    s = larger - larger[0]
    if not float(s @ s) > 0:
        raise InputError(None, f"ratio {ratio}", "the loads do not change along this path")
    # With an offset of their own, as the first reading is no better than the others.
    about = s - s.mean()
    slopes = about @ np.column_stack([n, eps]) / float(about @ about)
    whole = slopes * float(s.max())
    off = (eps - eps.mean(axis=0)) - np.outer(about, slopes[2:])
    return LinearPath(ratio, whole[:2], whole[2:], np.sqrt(np.mean(off**2, axis=0)))


@dataclass(frozen=True)
class Options:
    """What is evaluated, and how.

    unloaded : with the strains of unloaded yarns (ten paths of five ratios) or without (eight).
    reciprocal : nu_w / E_f = nu_f / E_w is asked for. minimise : squares of strains, or of loads.
    ratios : those that count, all where it is empty.
    """

    unloaded: bool = False
    reciprocal: bool = True
    minimise: Minimise = "strain"
    ratios: tuple[str, ...] = ()

    def counts(self, path: LinearPath) -> tuple[bool, bool]:
        """Which yarns of a path count."""
        if self.ratios and path.ratio not in self.ratios:
            return False, False
        warp, fill = path.unloaded
        return (self.unloaded or not warp), (self.unloaded or not fill)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Constants of some options.

    paths : how many strain paths count. squares : sum of the squares of strain over them, %^2, at
    `POINTS` of each. rms : by ratio, of the strains of both yarns, all ratios, in %.
    """

    options: Options
    constants: DesignersConstants
    paths: int
    squares: float
    rms: Mapping[str, float]


#: The usual choice.
USUAL = Options()


def evaluate(paths: Sequence[LinearPath], options: Options = USUAL) -> Evaluation:
    """The constants with the least squares.

    Raises
    ------
    InputError : paths that do not settle them.
    """
    matrix, right = _rows(paths, options)
    # Columns: C_ww, C_ff, C_wf, C_fw (or A), the last two one where they are reciprocal.
    if options.reciprocal:
        matrix = np.column_stack([matrix[:, :2], matrix[:, 2] + matrix[:, 3]])
    if not len(matrix) or np.linalg.matrix_rank(matrix) < matrix.shape[1]:
        problem = "these ratios do not settle the constants: two that differ are needed at least"
        raise InputError(None, "ratios", problem)
    c, *_ = np.linalg.lstsq(matrix, right, rcond=None)
    whole = np.array([[c[0], c[2]], [c[-1], c[1]]])
    if options.minimise == "load":
        constants = DesignersConstants.of_stiffness(whole)
    else:
        constants = DesignersConstants.of_compliance(whole)
    squares, rms, count = 0.0, {}, 0
    for path in paths:
        off = 100.0 * np.outer(_shares(), path.strain - constants.strain(path.load))
        which = np.array(options.counts(path))
        squares += float((off[:, which] ** 2).sum())
        count += int(which.sum())
        rms[path.ratio] = float(np.sqrt(np.mean(off**2)))
    return Evaluation(options, constants, count, squares, rms)


def evaluate_or_none(paths: Sequence[LinearPath], options: Options) -> Evaluation | None:
    """The constants; None where the paths do not settle them."""
    try:
        return evaluate(paths, options)
    except InputError:
        return None


def evaluate_others(paths: Sequence[LinearPath], options: Options) -> list[Evaluation]:
    """What every other choice gives; those that settle no constants are left out."""
    others = [other for other in every_option(paths) if other != options]
    found = [evaluate_or_none(paths, other) for other in others]
    return [one for one in found if one is not None]


def every_option(paths: Sequence[LinearPath]) -> list[Options]:
    """The choices that laboratories make: eight or ten paths, reciprocal or not, strains or loads,
    and the ratios about 1:1 alone where there are others."""
    kinds: tuple[Minimise, ...] = ("strain", "load")
    found = [
        Options(unloaded, reciprocal, minimise)
        for minimise, unloaded, reciprocal in product(kinds, (False, True), (True, False))
    ]
    there = {path.ratio for path in paths}
    for few in (("1:1", "1:2"), ("1:1", "2:1"), ("1:1", "2:1", "1:2")):
        if set(few) < there:
            found.append(Options(False, True, "strain", few))
    if not any(any(path.unloaded) for path in paths):
        found = [o for o in found if not o.unloaded]  # they would be the same
    return found


def _shares() -> Array:
    return np.arange(1, POINTS + 1) / POINTS


def _rows(paths: Collection[LinearPath], options: Options) -> tuple[Array, Array]:
    """Rows of the linear equations, and their right sides."""
    rows, right = [], []
    # All points of a straight line say the same: one row with the root of their squares' sum.
    weight = float(np.sqrt((_shares() ** 2).sum()))
    for path in paths:
        given, wanted = path.load, path.strain
        if options.minimise == "load":
            given, wanted = wanted, given
        for yarn, counts in enumerate(options.counts(path)):
            if counts:
                row = np.zeros(4)
                row[yarn], row[2 + yarn] = given[yarn], given[1 - yarn]
                rows.append(weight * row)
                right.append(weight * wanted[yarn])
    return np.array(rows).reshape(-1, 4), np.array(right)
