"""Whether specimens are off a model in the same way: then it is no scatter of theirs.

Specimens differ, and each errs along its whole curve: smooth is no sign of a wrong form here. But
they scatter about what is true, so that what is alike in all of them is the model's. From each
curve one takes what no change of the law's unknowns could explain, in a few smooth shapes; over the
specimens the mean of these amplitudes is tested against their own scatter (Hotelling's T squared),
whatever that is correlated like along a curve, and however large.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial.legendre import legval
from numpy.typing import NDArray
from scipy.stats import f as fisher

from .discrepancy import FALSE_ALARMS, Discrepancy
from .problem import FitProblem

Array = NDArray[np.float64]

#: Shapes that are tested, at most, and degrees of polynomials among which they are found.
SHAPES, DEGREES = 2, 8
#: Of the whole curve, that a specimen must cover to count.
COVERED = 0.8
#: Of the largest singular value: below, a slope says nothing of its own; of a shape, likewise.
NOTHING = 1e-6
LEFT = 1e-3


def differences_of_all(
    problem: FitProblem, residual: Array, jacobian: Array | None
) -> dict[str, Discrepancy]:
    """Of every comparison that knows whose specimen its values are of, along a curve."""
    found: dict[str, Discrepancy] = {}
    if jacobian is None:
        return found
    for k, comparison in enumerate(problem.comparisons):
        objective = comparison.objective
        whose = getattr(objective, "specimens", None)
        if whose is None:
            continue
        rows, (at,) = problem.rows(k), objective.places  # type: ignore[attr-defined]
        scale = problem.scale[rows]
        off, slopes = residual[rows] * scale, jacobian[rows] * scale[:, None]
        some = [np.flatnonzero(whose == number) for number in np.unique(whose)]
        left, places, steep = ([v[own] for own in some] for v in (off, at[:, 0], slopes))
        one = alike_in_all(left, places, steep, objective.unit)
        if one is not None:
            found[comparison.name] = one
    return found


def alike_in_all(
    residuals: Sequence[Array], places: Sequence[Array], slopes: Sequence[Array], unit: str
) -> Discrepancy | None:
    """What specimens have in common beside the model, in the residuals' unit.

    Its RMS is that of what no change of the unknowns could follow.

    Parameters
    ----------
    residuals : (n,) of each specimen, model less measured. places : (n,) along its curve.
    slopes : (n, unknowns) of the residual by the unknowns, at its places.

    None where there are too few specimens, or points of them: three at least that cover most of the
    curve.
    """
    low, high = (end(end(own) for own in places) for end in (min, max))
    if not high > low:
        return None
    whole = np.concatenate(slopes)
    _, size, axes = np.linalg.svd(whole, full_matrices=False)
    kept = axes[size > NOTHING * size[0]] if size[0] > 0 else axes[:0]
    some = [
        k
        for k, own in enumerate(places)
        if np.ptp(own) >= COVERED * (high - low) and len(own) >= len(kept) + SHAPES + 1
    ]
    count = min(SHAPES, len(some) - 2)
    if count < 1:
        return None
    along = [2 * (own - low) / (high - low) - 1.0 for own in places]
    shapes = _beside(whole @ kept.T, np.concatenate(along), count)
    count = shapes.shape[1]
    if not count:
        return None  # the law can follow whatever is smooth
    amplitudes = []
    for k in some:
        columns = np.column_stack([slopes[k] @ kept.T, _values(along[k], shapes)])
        amplitudes.append(np.linalg.lstsq(columns, residuals[k], rcond=None)[0][-count:])
    each = np.array(amplitudes)
    mean, specimens = each.mean(axis=0), len(some)
    spread = np.atleast_2d(np.cov(each.T))
    common = _values(np.concatenate(along), shapes) @ mean
    followed = np.linalg.qr(whole @ kept.T)[0] if len(kept) else np.zeros((len(common), 0))
    rms = float(np.sqrt(np.mean((common - followed @ (followed.T @ common)) ** 2)))
    if not np.linalg.eigvalsh(spread).min() > 0:
        return None  # specimens that do not differ at all: nothing to test against
    square = specimens * float(mean @ np.linalg.solve(spread, mean))
    ratio = square * (specimens - count) / (count * (specimens - 1))
    largest = float(fisher.isf(FALSE_ALARMS, count, specimens - count))
    return Discrepancy(ratio, largest, rms, unit, specimens=specimens)


def _beside(slopes: Array, along: Array, count: int) -> Array:
    """(DEGREES + 1, count) Legendre coefficients of the smoothest shapes beside the slopes.

    A shape that they can follow, with those that were taken before it, says nothing of the form.
    """
    unit = np.linalg.qr(slopes)[0] if slopes.shape[1] else np.zeros((len(along), 0))
    shapes = []
    for row in np.eye(DEGREES + 1):
        every = legval(along, row)
        left = every - unit @ (unit.T @ every)
        left -= unit @ (unit.T @ left)
        size = float(np.linalg.norm(left))
        if size**2 > LEFT * float(every @ every):
            shapes.append(row)
            unit = np.column_stack([unit, left / size])
        if len(shapes) == count:
            break
    return np.array(shapes).reshape(-1, DEGREES + 1).T


def _values(along: Array, shapes: Array) -> Array:
    """(n, count) of shapes at places from -1 to 1."""
    return np.stack([legval(along, column) for column in shapes.T], axis=1)
