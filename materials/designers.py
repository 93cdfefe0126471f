"""Linear orthotropic constants per width, in the forms that programs ask for.

Inverse form, strains of loads per width n (kN/m), nu_w the warp's contraction by the fill (nu_xy),
nu_f the other (nu12), reciprocal where nu_w / E_f = nu_f / E_w:

    eps_w = n_w / E_w - nu_w n_f / E_f,    eps_f = n_f / E_f - nu_f n_w / E_w.

Direct: n_w = A_w eps_w + A_wf eps_f, n_f = A_fw eps_w + A_f eps_f. Paths are replaced by their
regression lines over the larger load; constants have the least squares of strains or loads.
"""

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from .biaxial_patch import biaxial_response
from .forms.base import Array
from .law import HypoelasticLaw

#: Relative: constants whose cross terms differ by less are reciprocal.
RECIPROCITY_TOLERANCE = 1e-9


@dataclass(frozen=True)
class DesignersConstants:
    """Stiffnesses per width and Poisson's ratios.

    Attributes
    ----------
    warp, fill : float, kN/m
    nu_warp, nu_fill : float
        Poisson's ratios as in the description of the module.
    shear : float or None, kN/m
        G, None where unknown.
    """

    warp: float
    fill: float
    nu_warp: float
    nu_fill: float
    shear: float | None = None

    @classmethod
    def of_compliance(cls, compliance: ArrayLike) -> Self:
        """Return the constants of eps = C n, C (2, 2) per kN/m; InputError for a bad diagonal."""
        c = np.asarray(compliance, dtype=float)
        if not (np.isfinite(c).all() and c[0, 0] > 0 and c[1, 1] > 0):
            problem = "a fabric would get shorter when it is pulled: these paths have no constants"
            raise InputError(None, "constants", problem)
        warp = 1 / c[0, 0]
        fill = 1 / c[1, 1]
        nu_warp = -c[0, 1] * fill
        nu_fill = -c[1, 0] * warp
        return cls(float(warp), float(fill), float(nu_warp), float(nu_fill))

    @classmethod
    def of_stiffness(cls, stiffness: ArrayLike) -> Self:
        """Return the constants of n = A eps, A (2, 2) kN/m; raise InputError without an inverse."""
        a = np.asarray(stiffness, dtype=float)
        det = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
        if not det > 0:
            problem = "the direct form has no inverse: these paths have no constants"
            raise InputError(None, "constants", problem)
        adjugate = [[a[1, 1], -a[0, 1]], [-a[1, 0], a[0, 0]]]
        inverse = np.array(adjugate) / det
        return cls.of_compliance(inverse)

    @property
    def compliance(self) -> Array:
        """Return C (2, 2) of eps = C n, per kN/m."""
        across = -self.nu_warp / self.fill, -self.nu_fill / self.warp
        return np.array([[1 / self.warp, across[0]], [across[1], 1 / self.fill]])

    @property
    def stiffness(self) -> Array:
        """Return A (2, 2) of n = A eps, kN/m; raise InputError unless nu_warp nu_fill < 1."""
        determinant = 1.0 - self.nu_warp * self.nu_fill
        if not determinant > 0:
            problem = f"nu_warp nu_fill is {1 - determinant:.3g}; expected below 1"
            raise InputError(None, "constants", problem)
        a = np.array([[self.warp, self.nu_warp * self.warp], [self.nu_fill * self.fill, self.fill]])
        return a / determinant

    @property
    def reciprocal(self) -> bool:
        """Return whether a strain energy belongs to them."""
        warp_by_fill = self.nu_warp / self.fill
        fill_by_warp = self.nu_fill / self.warp
        return abs(warp_by_fill - fill_by_warp) <= RECIPROCITY_TOLERANCE * max(
            abs(warp_by_fill), abs(fill_by_warp), 1e-300
        )

    @property
    def stable(self) -> bool:
        """Return whether every stretch takes work: nu_warp nu_fill < 1 if reciprocal."""
        c = self.compliance
        coupling = 0.5 * (c[0, 1] + c[1, 0])
        return bool(c[0, 0] * c[1, 1] > coupling**2)

    def strain(self, loads: ArrayLike) -> Array:
        """Return (n, 2) of loads (n, 2) kN/m."""
        return np.asarray(loads, dtype=float) @ self.compliance.T


Minimise = Literal["strain", "load"]
#: Points of a line whose squares are added, and their shares of it.
POINTS = 10
SHARES = np.arange(1, POINTS + 1) / POINTS
#: Of the larger load's change: a yarn whose load changes by less is unloaded.
UNLOADED = 0.1


@dataclass(frozen=True, eq=False)
class LinearPath:
    """A ratio's lines: load (2,) kN/m and strain (2,) to the end, RMS residual (2,) of strain."""

    ratio: str
    load: Array
    strain: Array
    residual: Array

    @property
    def unloaded(self) -> tuple[bool, bool]:
        """Return for warp and fill whether a yarn has hardly any load along the path."""
        threshold = UNLOADED * np.abs(self.load).max()
        warp, fill = np.abs(self.load) < threshold
        return bool(warp), bool(fill)


def line_of(ratio: str, load: ArrayLike, strain: ArrayLike) -> LinearPath:
    """Return the lines through the beginning of a path: loads (n, 2) kN/m, strains (n, 2)."""
    n = np.asarray(load, dtype=float)
    eps = np.asarray(strain, dtype=float)
    larger = n.max(axis=1)
    s = larger - larger[0]
    if not s @ s > 0:
        raise InputError(None, f"ratio {ratio}", "the loads do not change along this path")
    # With an offset of their own, as the first reading is no better than the others.
    about = s - s.mean()
    slopes = about @ np.column_stack([n, eps]) / (about @ about)
    changes = slopes * s.max()
    off = (eps - eps.mean(axis=0)) - np.outer(about, slopes[2:])
    return LinearPath(ratio, changes[:2], changes[2:], np.sqrt(np.mean(off**2, axis=0)))


@dataclass(frozen=True)
class Options:
    """Choices of an evaluation: unloaded yarns, reciprocity, whose squares, which ratios."""

    unloaded: bool = False
    reciprocal: bool = True
    minimise: Minimise = "strain"
    ratios: tuple[str, ...] = ()

    def counts(self, path: LinearPath) -> tuple[bool, bool]:
        """Return for warp and fill whether the strains of a path count with these options."""
        if self.ratios and path.ratio not in self.ratios:
            return False, False
        warp, fill = path.unloaded
        return (self.unloaded or not warp), (self.unloaded or not fill)


@dataclass(frozen=True, eq=False)
class ConstantsEvaluation:
    """Constants of some options, and how far off they are.

    Attributes
    ----------
    options : Options
    constants : DesignersConstants
    paths : int
        Number of paths.
    squares : float
        Sum of squares of strain, %^2.
    rms : mapping of str to float
        Root mean square of strain by ratio, %.
    """

    options: Options
    constants: DesignersConstants
    paths: int
    squares: float
    rms: Mapping[str, float]


#: The usual choice.
USUAL = Options()


def evaluate(paths: Sequence[LinearPath], options: Options = USUAL) -> ConstantsEvaluation:
    """Return the constants with the least squares; raise InputError if paths do not settle them."""
    matrix, right = _rows(paths, options)
    # Columns: C_ww, C_ff, C_wf, C_fw (or A), the last two one where they are reciprocal.
    if options.reciprocal:
        matrix = np.column_stack([matrix[:, :2], matrix[:, 2] + matrix[:, 3]])
    if not len(matrix) or np.linalg.matrix_rank(matrix) < matrix.shape[1]:
        problem = "these ratios do not settle the constants: two that differ are needed at least"
        raise InputError(None, "ratios", problem)
    c, *_ = np.linalg.lstsq(matrix, right, rcond=None)
    matrix_of_form = np.array([[c[0], c[2]], [c[-1], c[1]]])
    if options.minimise == "load":
        constants = DesignersConstants.of_stiffness(matrix_of_form)
    else:
        constants = DesignersConstants.of_compliance(matrix_of_form)
    squares = 0.0
    rms = {}
    count = 0
    for path in paths:
        off = 100.0 * np.outer(SHARES, path.strain - constants.strain(path.load))
        counted = np.array(options.counts(path))
        squares += (off[:, counted] ** 2).sum()
        count += int(counted.sum())
        rms[path.ratio] = np.sqrt(np.mean(off**2))
    return ConstantsEvaluation(options, constants, count, squares, rms)


def evaluate_others(paths: Sequence[LinearPath], options: Options) -> list[ConstantsEvaluation]:
    """Return the evaluations by all other options that the paths settle."""
    evaluations = []
    for choice in every_option(paths):
        with suppress(InputError):
            evaluations += [evaluate(paths, choice)] if choice != options else []
    return evaluations


def every_option(paths: Sequence[LinearPath]) -> list[Options]:
    """Return the choices of laboratories, and ratios about 1:1 alone where there are others."""
    kinds: tuple[Minimise, ...] = ("strain", "load")
    choices = [
        Options(unloaded, reciprocal, minimise)
        for minimise, unloaded, reciprocal in product(kinds, (False, True), (True, False))
    ]
    measured = {path.ratio for path in paths}
    for subset in (("1:1", "1:2"), ("1:1", "2:1"), ("1:1", "2:1", "1:2")):
        if set(subset) < measured:
            choices.append(Options(False, True, "strain", subset))
    if not any(any(path.unloaded) for path in paths):
        choices = [o for o in choices if not o.unloaded]  # they would be the same
    return choices


def _rows(paths: Collection[LinearPath], options: Options) -> tuple[Array, Array]:
    """Return rows (n, 4) and right sides (n,) of the least squares for the constants.

    The unknowns are C_ww, C_ff, C_wf and C_fw, factors of strain by the load along the same yarn,
    then along the other; load and strain are exchanged if squares of loads are minimised.
    """
    rows = []
    right = []
    # All points of a straight line say the same: its end stands for all of them.
    for path in paths:
        source = path.load
        target = path.strain
        if options.minimise == "load":
            source, target = target, source
        for yarn, counts in enumerate(options.counts(path)):
            if counts:
                row = np.zeros(4)
                row[yarn] = source[yarn]
                row[2 + yarn] = source[1 - yarn]
                rows.append(row)
                right.append(target[yarn])
    return np.array(rows).reshape(-1, 4), np.array(right)


#: The five of which designers' constants are made.
RATIOS = ("1:1", "2:1", "1:2", "1:0", "0:1")
_RATIO = re.compile(r"^\s*(\d+(?:[.,]\d+)?)\s*[:/]\s*(\d+(?:[.,]\d+)?)\s*$")


def shares(ratio: str) -> tuple[float, float]:
    """Return loads along warp and fill where the larger is 1; raise InputError for no such ratio.

    >>> shares("1:2"), shares("2/1")
    ((0.5, 1.0), (1.0, 0.5))
    """
    match = _RATIO.match(ratio)
    pair = [float(text.replace(",", ".")) for text in match.groups()] if match else [0.0]
    if not 0 < max(pair) < math.inf:
        problem = f"expected a load ratio such as 2:1 (warp to fill), got {ratio[:40]!r}"
        raise InputError(None, "ratio", problem)
    return pair[0] / max(pair), pair[1] / max(pair)


#: Increments of the law along a path.
STEPS = 60
#: Strains of a shear at which G is averaged.
SHEARS = 61


@dataclass(frozen=True, eq=False)
class LawConstants:
    """A law as designers' constants, and those of other options.

    Attributes
    ----------
    evaluation : ConstantsEvaluation
    alternatives : tuple of ConstantsEvaluation
        Those of the other options.
    misfit, largest : mapping of str to float, %
        By ratio, RMS difference from the law's strains, and its largest strain.
    shear : (float, float), kN/m
        Least and largest G.
    """

    evaluation: ConstantsEvaluation
    alternatives: tuple[ConstantsEvaluation, ...]
    misfit: Mapping[str, float]
    largest: Mapping[str, float]
    shear: tuple[float, float]

    @property
    def constants(self) -> DesignersConstants:
        return self.evaluation.constants

    @property
    def rms(self) -> float:
        """Return the root mean square (%) of the differences of all ratios."""
        return float(np.sqrt(np.mean(np.square([*self.misfit.values()]))))


def constants_of_law(
    law: HypoelasticLaw,
    thickness: float,
    lowest: float,
    highest: float,
    shear_strain: float,
    options: Options = USUAL,
) -> LawConstants:
    """Evaluate a law by five ratios, of loads lowest to highest kN/m, G up to shear_strain."""
    if not 0 <= lowest < highest:
        problem = f"expected loads that increase from 0 kN/m or more, got {lowest:g} to {highest:g}"
        raise InputError(None, "loads", problem)
    curves = {name: _curve(law, thickness, name, lowest, highest) for name in RATIOS}
    lines = [line_of(name, *curve) for name, curve in curves.items()]
    gammas = np.linspace(0.0, shear_strain, SHEARS)
    shear = law.G12(gammas) * thickness
    mean = float(np.trapezoid(shear, gammas) / shear_strain)
    chosen = evaluate(lines, options)
    chosen = replace(chosen, constants=replace(chosen.constants, shear=mean))
    alternatives = tuple(evaluate_others(lines, options))
    misfit = {}
    largest = {}
    for name, (load, strain) in curves.items():
        off = (strain - strain[0]) - chosen.constants.strain(load - load[0])
        misfit[name] = 100 * np.sqrt(np.mean(off**2))
        largest[name] = 100 * np.abs(strain).max()
    ends = (shear.min(), shear.max())
    return LawConstants(chosen, alternatives, misfit, largest, shear=ends)


def _curve(
    law: HypoelasticLaw,
    thickness: float,
    ratio: str,
    lowest: float,
    highest: float,
) -> tuple[Array, Array]:
    """Return loads (n, 2) kN/m and strains (n, 2) of a law at one ratio of loads.

    The loads go from `lowest` to `highest` (kN/m, of the yarn with the larger load). InputError if
    the law does not carry them.
    """
    larger = np.concatenate(
        [
            np.linspace(0, lowest, STEPS)[1:-1] if lowest > 0 else [],
            np.linspace(lowest, highest, STEPS + 1),
        ]
    )
    loads = np.outer(larger, shares(ratio))
    response = biaxial_response(law, loads, thickness)
    if response.reached < len(larger):
        problem = (
            "the law carries no more than "
            f"{larger[max(response.reached - 1, 0)]:.3g} kN/m at ratio "
            f"{ratio}: choose a lower stress range"
        )
        raise InputError(None, "loads", problem)
    is_above = larger >= lowest
    return loads[is_above], response.elongation[is_above]


#: The constants of an evaluation with a spread.
CONSTANTS = ("warp", "fill", "nu_warp", "nu_fill")


def row_of(evaluation: ConstantsEvaluation) -> dict[str, Any]:
    """Return options and constants of both forms: E and A (direct form) in kN/m, squares in %^2."""
    c = evaluation.constants
    o = evaluation.options
    direct = c.stiffness if c.nu_warp * c.nu_fill < 1 else np.full((2, 2), np.nan)
    return {
        "minimise": o.minimise,
        "reciprocal": o.reciprocal,
        "unloaded_yarns": o.unloaded,
        "ratios": " ".join(o.ratios) or "all",
        "paths": evaluation.paths,
        "E_warp_kN_per_m": c.warp,
        "E_fill_kN_per_m": c.fill,
        "nu_warp": c.nu_warp,
        "nu_fill": c.nu_fill,
        "A_warp_kN_per_m": direct[0, 0],
        "A_fill_kN_per_m": direct[1, 1],
        "A_warp_fill_kN_per_m": direct[0, 1],
        "A_fill_warp_kN_per_m": direct[1, 0],
        "squares_percent2": evaluation.squares,
    }


def spread_of(evaluations: Iterable[ConstantsEvaluation]) -> dict[str, tuple[float, float]]:
    """Return least and largest of each of `CONSTANTS` over the evaluations."""
    constants = [evaluation.constants for evaluation in evaluations]
    return {
        name: (min(getattr(c, name) for c in constants), max(getattr(c, name) for c in constants))
        for name in CONSTANTS
    }
