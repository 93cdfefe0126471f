"""Fit moduli to measured shapes of a membrane by the principle of virtual work.

No equilibrium has to be solved for. Measured displacements are smoothed by fields that vanish on
the rim of a disk of radius 1, (1 - r^2) times polynomials; the same fields are the virtual
displacements. Internal less external virtual work, divided by the stiffness of the measured shape,
is the distance of that shape from equilibrium, in mm and to first order (`MeasuredShape`). Least
squares of this distance over the measured points weight the virtual work by the inverse of its
covariance by noise; without these weights moduli are thirty times less certain.

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

DEGREE = 6  # of the polynomials; with degree 8, moduli are no more certain
MIN_POINTS_PER_FIELD = 2  # least number of measured points for each field


def disk_fields(unit: Array, degree: int = DEGREE) -> list[Array]:
    """Return displacement fields on a disk with the symmetry of an orthotropic sheet.

    Under pressure dx is odd in x and dy odd in y; all else is even.

    Parameters
    ----------
    unit : (n, 2) array
        Points of the unit disk.
    degree : int
        Highest degree of the polynomials.

    Returns
    -------
    list of three (n, k) arrays
        Fields of dx, dy and dz, zero on the rim.
    """
    x, y = (legvander(coordinate, degree + 1) for coordinate in unit.T)
    dome = np.maximum(1.0 - (unit**2).sum(axis=1), 0.0)[:, None]
    fields = []
    for first_x, first_y in ((1, 0), (0, 1), (0, 0)):
        largest = degree + first_x + first_y
        products = [
            x[:, a] * y[:, b]
            for a in range(first_x, largest + 1, 2)
            for b in range(first_y, largest + 1, 2)
            if a + b <= largest
        ]
        fields.append(dome * np.stack(products, axis=1))
    return fields


def smoothed(
    model: Any,
    targets: Sequence[Any],
    disk_positions: Array,
    rim_motion: Array,
    has_shift: bool,
) -> tuple[MeasuredShape, Array]:
    """Return the smoothed measured shape of a bubble, and the norms of its k smooth fields.

    Parameters
    ----------
    model : BubbleModel
    targets : sequence of FieldTarget
        Measured frames: `displacement` (n, 3) mm, and `at`, which interpolates nodal values to the
        measured points.
    disk_positions : (nodes, 2) array
        Position of each node in the unit disk.
    rim_motion : (frames, nodes, 3) array, mm
        Displacement that is not smoothed, the motion of the rim.
    has_shift : bool
        Whether frames have an unknown rigid displacement, which is taken off.

    Returns
    -------
    MeasuredShape
    (frames, k, k) array
        Matrix roots: |root @ amounts| is the norm over the measured points of the sum of the fields
        with these amounts.

    Raises
    ------
    InputError
        There are too few points, or on one side only.
    """
    axis_fields = _free_fields(model, disk_positions)
    ends = np.cumsum([0, *(fields.shape[1] for fields in axis_fields)])
    count = int(ends[-1])
    all_fields = np.zeros((len(disk_positions), 3, count))
    amounts = np.zeros((len(targets), count))
    roots = np.zeros((len(targets), count, count))
    columns = [slice(*ends[axis : axis + 2]) for axis in range(3)]
    for axis, fields in enumerate(axis_fields):
        all_fields[:, axis, columns[axis]] = fields
    for k, target in enumerate(targets):
        measured = target.displacement - target.at_places(rim_motion[k])
        for axis, fields in enumerate(axis_fields):
            root, amount = _fit_fields(target.at_places(fields), measured[:, axis], has_shift)
            roots[k, columns[axis], columns[axis]] = root
            amounts[k, columns[axis]] = amount
    displacement = rim_motion + (all_fields @ amounts.T).transpose(2, 0, 1)
    return MeasuredShape.of(model, displacement, all_fields.reshape(-1, count)), roots


def _free_fields(model: Any, disk_positions: Array) -> list[Array]:
    """Return orthonormal fields (nodes, k) of dx, dy and dz that keep what the model fixes.

    Parameters
    ----------
    disk_positions : (nodes, 2) array
        Nodes on the unit disk.
    """
    is_free = np.ones(disk_positions.shape[0] * 3)
    is_free[model.fixed] = 0.0
    is_free = is_free.reshape(-1, 3)
    return [
        np.linalg.qr(is_free[:, [axis]] * fields)[0]
        for axis, fields in enumerate(disk_fields(disk_positions))
    ]


def _fit_fields(columns: Array, measured: Array, has_shift: bool) -> tuple[Array, Array]:
    """Return root (k, k) and amounts (k,) of fields fitted to measured values.

    Parameters
    ----------
    columns : (n, k) array
        Fields at the measured points.
    measured : (n,) array, mm
        Measured displacements.
    has_shift : bool
        Whether the measured displacements have an unknown shift, which is taken out.
    """
    if len(measured) < MIN_POINTS_PER_FIELD * columns.shape[1]:
        problem = f"{len(measured)} are too few for {columns.shape[1]} fields of virtual work"
        raise InputError(None, "points", problem)
    if has_shift:
        columns = columns - columns.mean(axis=0)
        measured = measured - measured.mean()
    unitary, root = np.linalg.qr(columns)
    if not np.abs(np.diag(root)).min() > 1e-6 * np.abs(root).max():
        raise InputError(None, "points", "lie on a part of the disk only")
    return root, np.linalg.solve(root, unitary.T @ measured)


class GapObjective(Objective):
    """The distance of a measured shape from equilibrium, as one block of independent residuals.

    Parameters
    ----------
    shape : MeasuredShape
    roots : (frames, k, k) array
        As `smoothed` returns them.
    like : Objective
        Objective of a usual fit to the same data, whose noise is taken.
    """

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
        return (self.shape.displacements,)

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        return self.jacobian(history, history.displacement[..., None])[:, 0]

    def jacobian(self, history: History, slope: Array) -> Array:
        flat = slope.reshape(len(self.roots), -1, slope.shape[-1])
        return (self.roots @ (self.shape.fields.T @ flat)).reshape(-1, flat.shape[-1])

    def nuisance_columns(
        self, names: Sequence[str], nuisance: Mapping[str, float], history: History
    ) -> Array:
        """Return (m, names) zeros: rigid displacements are smoothed away."""
        return np.zeros((self.sizes[0], len(names)))

    def shifted(self, external: History, surrogate: History) -> GapObjective:
        raise NotImplementedError("virtual work is led by no surrogate")
