"""Virtual work on measured shapes: moduli of a membrane without a solution of its equilibrium.

Measured displacements are smoothed by fields that vanish on the rim, (1 - r^2) times polynomials;
the same fields are the virtual displacements. The internal less the external virtual work over the
stiffness of the measured shape is how far that shape is from equilibrium, in mm and to first order
(`MeasuredShape`). Least squares of it over the measured points weigh the virtual work by the
inverse of the covariance that it has by noise; unweighted, moduli are thirty times less certain.

F. Pierron, M. Grediac, The Virtual Fields Method (Springer 2012); fields by sensitivity: A. Marek,
F. M. Davis, F. Pierron, Comput. Mech. 60 (2017) 409; equilibrium gap: D. Claire, F. Hild, S. Roux,
Int. J. Numer. Methods Eng. 61 (2004) 189.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.polynomial.legendre import legvander

from ..errors import InputError
from ..materials.forms.base import Array
from ..meshes.bubble_model import MeasuredShape
from ..solvers.base import History
from .objective import Objective

DEGREE = 6  # of the polynomials; with 8 moduli are as certain
LEAST_POINTS = 2  # measured points a field, at least


def disk_fields(unit: Array, degree: int = DEGREE) -> list[Array]:
    """Return (n, k) fields of dx, dy, dz at places (n, 2) of the unit disk, as symmetric as it.
    An orthotropic sheet moves so: dx is odd in x, dy odd in y, all else even."""
    x, y = (legvander(one, degree + 1) for one in unit.T)
    dome = np.maximum(1.0 - (unit**2).sum(axis=1), 0.0)[:, None]
    found = []
    for odd in ((1, 0), (0, 1), (0, 0)):
        most = degree + sum(odd)
        powers = [(a, b) for a in range(odd[0], most + 1, 2) for b in range(odd[1], most + 1, 2)]
        some = [x[:, a] * y[:, b] for a, b in powers if a + b <= most]
        found.append(dome * np.stack(some, axis=1))
    return found


def smoothed(
    model: Any, targets: Sequence[Any], unit: Array, base: Array, shifted: bool
) -> tuple[MeasuredShape, Array]:
    """Return a bubble's model with measured fields smoothed, and their roots (frames, k, k):
    |root @ amounts| is the norm, at the measured points, of such a sum of the k fields. targets :
    with `displacement` (n, 3) mm, and `at` from nodal values to their places. unit : (nodes, 2) of
    the unit disk. base : (frames, nodes, 3) mm that is not smoothed, the motion of the rim. shifted
    : less a rigid displacement. InputError : too few points, or on one side only."""
    free = np.ones(unit.shape[0] * 3)
    free[model.fixed] = 0.0
    held = free.reshape(-1, 3)
    own = [np.linalg.qr(held[:, [axis]] * f)[0] for axis, f in enumerate(disk_fields(unit))]
    ends = np.cumsum([0, *(shape.shape[1] for shape in own)])
    fields = np.zeros((len(unit), 3, ends[-1]))
    for axis, shape in enumerate(own):
        fields[:, axis, ends[axis] : ends[axis + 1]] = shape
    amounts = np.zeros((len(targets), ends[-1]))
    roots = np.zeros((len(targets), ends[-1], ends[-1]))
    for k, target in enumerate(targets):
        left = target.displacement - target.at(base[k])
        for axis, shape in enumerate(own):
            here = slice(*ends[axis : axis + 2])
            seen = left[:, axis]
            columns = target.at(shape)
            if len(seen) < LEAST_POINTS * columns.shape[1]:
                said = f"{len(seen)} are too few for {columns.shape[1]} fields of virtual work"
                raise InputError(None, "points", said)
            if shifted:
                columns = columns - columns.mean(axis=0)
                seen = seen - seen.mean()
            unitary, root = np.linalg.qr(columns)
            if not np.abs(np.diag(root)).min() > 1e-6 * np.abs(root).max():
                raise InputError(None, "points", "lie on a part of the disk only")
            roots[k, here, here], amounts[k, here] = root, np.linalg.solve(root, unitary.T @ seen)
    moved = base + (fields @ amounts.T).transpose(2, 0, 1)
    return MeasuredShape.of(model, moved, fields.reshape(-1, ends[-1])), roots


class GapObjective(Objective):
    """The distance of a measured shape from equilibrium: one block of rows with independent noise.
    like : the objective of a fit to the same data."""

    unit = "mm"

    def __init__(self, shape: MeasuredShape, roots: Array, like: Objective) -> None:
        self.shape = shape
        self.roots = roots
        self.least_noise = like.least_noise
        self.noise_is = like.noise_is
        self.sizes = (roots[..., 0].size,)
        self.scale = np.ones(roots[..., 0].size)

    @property
    def data(self) -> tuple[Array, ...]:
        return (self.shape.moved,)

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        return self.jacobian(history, history.displacement[..., None])[:, 0]

    def jacobian(self, history: History, slope: Array) -> Array:
        flat = slope.reshape(len(self.roots), -1, slope.shape[-1])
        return np.asarray((self.roots @ (self.shape.fields.T @ flat)).reshape(-1, flat.shape[-1]))

    def nuisance_columns(self, names: Sequence[str], nuisance: Mapping[str, float]) -> Array:
        """Return (m, names) zeros: rigid displacements are smoothed away."""
        return np.zeros((self.sizes[0], len(names)))

    def shifted(self, external: History, surrogate: History) -> GapObjective:
        raise NotImplementedError("virtual work is led by no surrogate")
