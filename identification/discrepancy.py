"""Whether what a fit leaves can be noise: noise is not smooth over the whole sheet.

Neighbouring values of a camera err as one over a facet. Over distances that are long beside that,
such noise has as much power in one shape as in another: in the few smoothest polynomials over the
sheet as in those of the next degrees. What a law or a model of the wrong form leaves is smooth over
the whole sheet and lies in the former. Their ratio, each per shape, has the distribution F of
Fisher and Snedecor if nothing but noise is left, whatever the noise's size and its facet are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import legval
from numpy.typing import NDArray
from scipy.stats import f as fisher

from ..notes import Note, NoteKind
from .correlation import alike
from .problem import FitProblem

Array = NDArray[np.float64]

#: Degree of the polynomials that are smooth over the whole sheet, and of the next ones.
SMOOTH, NEXT = 4, 8
#: Of so many fits in which nothing but noise is left, one is said to leave more.
FALSE_ALARMS = 0.01
#: Values of a block for every shape that is looked at, at least.
LEAST_VALUES = 2
#: A facet is not small beside the next shapes. If A of n values err as one, noise that is alike
#: over a Gaussian has exp(2.6 to 3.5 sqrt(A / n)) times their power in the smooth ones (computed on
#: a square, n / A from 40 to 400; white noise has as much).
STEEPER = 3.5
#: Blocks that are asked how many values err as one.
FEW = 3


@dataclass(frozen=True)
class Discrepancy:
    """What of a comparison's residual is smooth over its whole sheet.

    ratio : of the power in a smooth shape to that in one of the next; largest : of those that noise
    alone exceeds in one of a hundred fits. rms : of what is smooth beyond the noise's share of it,
    in `unit`s. least : of that, what the noise to reckon with leaves open of a mean of all values:
    less is no matter beside the bands (what rounding leaves of computed data is smooth, too).
    specimens : of strips, how many were compared instead: `ratio` is then that of Hotelling's test,
    `rms` what all of them have in common (`specimens.alike_in_all`).
    """

    ratio: float
    largest: float
    rms: float
    unit: str
    least: float = 0.0
    specimens: int = 0

    @property
    def told(self) -> bool:
        """Whether it cannot be noise, and is more than what the noise leaves open anyway."""
        return self.ratio > self.largest and self.rms > self.least


def discrepancies(
    problem: FitProblem, residual: Array, doubt: Array | None = None
) -> dict[str, Discrepancy]:
    """Of every comparison that knows where on a sheet its values lie, from the residual (m,).

    doubt : (m,) what of the residual the mesh may be answerable for.
    """
    found = {}
    doubt = np.zeros_like(residual) if doubt is None else doubt
    for k, comparison in enumerate(problem.comparisons):
        objective = comparison.objective
        places = getattr(objective, "places", ())
        if not places or places[0].shape[1] != 2:
            continue
        rows = problem.rows(k)
        ends = np.cumsum(objective.sizes)[:-1]
        blocks, of_mesh = (
            np.split(whole[rows] * problem.scale[rows], ends) for whole in (residual, doubt)
        )
        one = discrepancy(blocks, of_mesh, places, problem.unknowns.count, objective.unit)
        if one is not None:
            least = objective.least_noise / float(np.sqrt(len(residual[rows])))
            found[comparison.name] = replace(one, least=least)
    return found


def discrepancy(
    blocks: Sequence[Array],
    doubts: Sequence[Array],
    places: Sequence[Array],
    unknowns: int,
    unit: str,
) -> Discrepancy | None:
    """Of blocks (n,) at places (n, 2) mm; None where there are too few values to tell.

    Blocks count alike, whatever their size. What of a block the model may be answerable for (its
    doubt) is taken off its power in the smooth shapes. `unknowns` of the fit have taken as many
    smooth shapes out of what is left.
    """
    usable = [
        (block, doubt, at)
        for block, doubt, at in zip(blocks, doubts, places, strict=True)
        if len(block) >= LEAST_VALUES * _shapes(NEXT) and block.any()
    ]
    if not usable:
        return None
    # Power in units of each block's own, and shapes.
    smooth, following, count = np.zeros(2), np.zeros(2), _shapes(SMOOTH)
    before, shapes, rest = np.zeros((0, 2)), np.zeros((0, 0)), []
    left, of_next, values = 0.0, 0.0, 0
    for block, doubt, at in usable:
        if at is not before and not np.array_equal(at, before):
            shapes, before = smooth_shapes(at), at
        amplitude, own = shapes.T @ block, float(np.mean(block**2))
        share, beyond = amplitude**2, -((shapes[:, :count].T @ doubt) ** 2).sum()
        beyond += share[:count].sum()
        smooth += beyond / own, count
        following += share[count:].sum() / own, shapes.shape[1] - count
        left, of_next = left + beyond, of_next + count * share[count:].mean()
        values += len(block)
        rest.append(block - shapes @ amplitude)
    step = -(-len(rest) // FEW)
    together = alike(rest[::step], [at for _, _, at in usable][::step])
    independent = values / len(usable) / together
    free = smooth[1] - unknowns
    if free < 1 or not following[0] > 0:
        return None
    steeper = float(np.exp(STEEPER * np.sqrt((1.0 - 1.0 / together) / independent)))
    ratio = (smooth[0] / free) / (following[0] / following[1])
    largest = float(fisher.isf(FALSE_ALARMS, free, following[1])) * steeper
    rms = np.sqrt(max(left - steeper * of_next, 0.0) / values)
    return Discrepancy(float(ratio), largest, float(rms), unit)


def smooth_shapes(places: Array) -> Array:
    """(n, shapes) orthonormal over the places, polynomials of ever higher degree."""
    low, high = places.min(axis=0), places.max(axis=0)
    unit = 2 * (places - low) / np.where(high > low, high - low, 1.0) - 1.0
    powers = [(i, total - i) for total in range(NEXT + 1) for i in range(total, -1, -1)]
    x, y = (
        np.stack([legval(one, np.eye(NEXT + 1)[i]) for i in range(NEXT + 1)], axis=1)
        for one in unit.T
    )
    columns = np.stack([x[:, i] * y[:, j] for i, j in powers], axis=1)
    return np.asarray(np.linalg.qr(columns)[0])


def _shapes(degree: int) -> int:
    return (degree + 1) * (degree + 2) // 2


def notes_of_discrepancies(found: Mapping[str, Discrepancy]) -> list[Note]:
    """Where more is left than noise can be."""
    return [
        Note(NoteKind.DISCREPANCY, _words(one), name) for name, one in found.items() if one.told
    ]


def _words(one: Discrepancy) -> str:
    if one.specimens:
        return (
            f"{one.rms:.2g} {one.unit} of what the fit leaves is alike in all {one.specimens} "
            f"specimens (Hotelling's F is {one.ratio:.3g}; chance gives {one.largest:.3g} in one "
            "of a hundred): the form of the law or the model is wrong (moduli that depend on more "
            "than their own strain, gauge lengths, a preload), and the moduli are off by more "
            "than their bands say"
        )
    return (
        f"{one.rms:.2g} {one.unit} of what the fit leaves is smooth over the whole sheet "
        f"({one.ratio:.3g} times the power that noise has in such shapes; chance gives "
        f"{one.largest:.3g} in one of a hundred): the form of the law or the model is wrong "
        "(thickness option, axes, pressures, a sheet taken for flat), and the moduli are off "
        "by more than their bands say"
    )
