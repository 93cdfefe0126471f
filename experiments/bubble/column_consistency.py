"""Check that the columns of places and of displacements belong together.

What all inflated disks share needs no law. The sheet rises as a dome along z, dx grows with x and
dy with y about the centre, and strain fits the rise h: a fibre from rim to rim becomes an arc, so
both principal strains of the centre are near 2/3 (h/R)^2. Computed bubbles, E1/E2 from 1 to 50,
have 1.0 to 2.0 times this as it is measured here; slack sheets have 0.2 times at first, and 0.7
times between two of their frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from ...meshes.outline import Outline
from ...readers.fields import DisplacementField
from ...solvers.base import Array

#: Sign and column of dx, then of dy.
Assignment = tuple[tuple[int, int], tuple[int, int]]


@dataclass(frozen=True)
class ConsistencyLimits:
    """Limits of what belongs together; strains are over those that the rise calls for."""

    min_points: int = 12  # four terms are fitted
    dome_share: float = 0.2  # dz has less than this of another component's dome: not the rise
    visible_dome: float = 0.004  # of the radius: a dome at all
    errors: float = 4.0  # standard errors of the strain that the rise must call for
    low_frame: float = 0.7  # of the highest rise: a frame below is subtracted, with its slack
    sure: tuple[float, float] = (0.15, 6.0)  # principal strains outside are impossible
    unusual: tuple[float, float] = (0.4, 3.0)
    height_slope: float = 0.5  # of dz over z, where a first shape is pulled flat: -1
    height_share: float = 0.003  # of the radius: rms of a first shape that can be judged


@dataclass(frozen=True, eq=False)
class CentreMotion:
    """Motion about the centre: terms that vanish at the rim, beside a shift of the whole sheet.

    Attributes
    ----------
    dome : (3,) array, mm
        Of dx, dy, dz at the centre.
    gradient : (3, 2) array
        Of dx, dy, dz along x and y there.
    error : float
        Standard error of an element of the gradient.
    """

    dome: Array
    gradient: Array
    error: float

    @property
    def strain(self) -> Array:
        """Return the (2, 2) Green-Lagrange strain of the centre, slopes of dz included."""
        in_plane = self.gradient[:2]
        return np.asarray(0.5 * (in_plane + in_plane.T + self.gradient.T @ self.gradient))

    def due_strains(self, outline: Outline) -> tuple[float, float]:
        """Return the strains that the rise calls for, along the long and the short semi-axis."""
        rise = abs(float(self.dome[2]))
        long = max(outline.major, outline.minor)
        short = min(outline.major, outline.minor)
        return 2.0 / 3.0 * (rise / long) ** 2, 2.0 / 3.0 * (rise / short) ** 2


def centre_motion(
    field: DisplacementField, outline: Outline, limits: ConsistencyLimits
) -> CentreMotion | None:
    """Return the motion about the centre by least squares; None with too few points on the disk."""
    share = outline.share(field.points)
    is_on_disk = share < 1.0
    points = field.points[is_on_disk]
    displacement = field.displacement[is_on_disk]
    if len(points) < limits.min_points:
        return None
    size = 0.5 * (outline.major + outline.minor)
    clamped = (1.0 - share[is_on_disk] ** 2)[:, None]
    terms = np.hstack([clamped, clamped * points / size, np.ones_like(clamped)])
    solution, _, rank, _ = np.linalg.lstsq(terms, displacement, rcond=1e-9)
    if rank < terms.shape[1]:
        return None
    residual = displacement[:, :2] - terms @ solution[:, :2]
    degrees_of_freedom = 2 * (len(points) - terms.shape[1])
    variance = float((residual**2).sum()) / degrees_of_freedom
    inverse = np.linalg.inv(terms.T @ terms)
    spread = inverse[1:3, 1:3].trace() / 2
    error = float(np.sqrt(variance * spread)) / size
    return CentreMotion(solution[0], np.asarray(solution[1:3].T / size), error)


@dataclass(frozen=True, eq=False)
class StrainOfRise:
    """Principal strains of the centre beside those that its rise calls for, in one or two frames.

    Attributes
    ----------
    principal : (2,) array
        Rising.
    due : (float, float)
        Along the long and the short semi-axis.
    gradient : (2, 2) array
        Of dx and dy.
    rise : (float, float), mm
        Of the highest frame, and of the one that is subtracted, 0 if none is.
    judged : bool
        Whether the strain that the rise calls for is far larger than its error.
    """

    principal: Array
    due: tuple[float, float]
    gradient: Array
    rise: tuple[float, float]
    judged: bool

    @property
    def ratios(self) -> tuple[float, float]:
        """Return the smaller strain over that along the long axis, the larger over the other."""
        smaller, larger = self.principal
        long, short = self.due
        return smaller / long, larger / short

    def is_outside(self, limits: tuple[float, float]) -> bool:
        """Return whether a principal strain lies outside these multiples of what is called for."""
        return not (limits[0] <= self.ratios[0] and self.ratios[1] <= limits[1])

    @property
    def assignment(self) -> Assignment:
        """Return (sign, column) of dx and dy for which dx grows with x and dy with y the most."""
        candidates: list[Assignment] = [
            ((x_sign, x_column), (y_sign, y_column))
            for x_column, y_column in permutations((0, 1))
            for x_sign, y_sign in product((1, -1), repeat=2)
        ]
        return max(candidates, key=self._growth)

    def _growth(self, assignment: Assignment) -> float:
        """Return how much dx grows with x and dy with y."""
        (x_sign, x_column), (y_sign, y_column) = assignment
        return float(x_sign * self.gradient[x_column, 0] + y_sign * self.gradient[y_column, 1])


def strain_of_rise(
    low: CentreMotion | None, high: CentreMotion, outline: Outline, limits: ConsistencyLimits
) -> StrainOfRise:
    """Compare strains with the rise between two frames; of the high one alone if low is None."""
    strain = high.strain
    due = np.array(high.due_strains(outline))
    gradient = high.gradient[:2]
    error = high.error
    lower_rise = 0.0
    if low is not None and abs(low.dome[2]) < limits.low_frame * abs(high.dome[2]):
        strain = strain - low.strain
        due = due - low.due_strains(outline)
        gradient = gradient - low.gradient[:2]
        error = float(np.hypot(error, low.error))
        lower_rise = float(low.dome[2])
    return StrainOfRise(
        principal=np.asarray(np.linalg.eigvalsh(strain), dtype=float),
        due=(float(due[0]), float(due[1])),
        gradient=gradient,
        rise=(float(high.dome[2]), lower_rise),
        judged=bool(due[0] > limits.errors * error),
    )


def flattened_share(
    field: DisplacementField, outline: Outline, limits: ConsistencyLimits
) -> float | None:
    """Return the slope of dz over the heights of a first shape: -1 where it is pulled flat.

    Of both, what is symmetric about the centre and what is plane does not count. None where the
    first shape is too small to tell, or dz does not follow it.
    """
    is_on_disk = outline.share(field.points) < 1.0
    if field.z is None or is_on_disk.sum() < limits.min_points:
        return None
    x, y = field.points[is_on_disk].T / outline.radius
    planar = ((0, 0), (1, 0), (0, 1))
    symmetric = ((2, 0), (1, 1), (0, 2), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4))
    smooth = np.stack([x**i * y**j for i, j in (*planar, *symmetric)], axis=1)
    z = field.z[is_on_disk]
    dz = field.displacement[is_on_disk, 2]
    z_and_dz = np.stack([z, dz], axis=1)
    if len(z_and_dz) < 2 * smooth.shape[1]:
        return None
    solution, *_ = np.linalg.lstsq(smooth, z_and_dz, rcond=None)
    heights, rises = (z_and_dz - smooth @ solution).T
    if np.sqrt(np.mean(heights**2)) < limits.height_share * outline.radius:
        return None
    return float(heights @ rises / (heights @ heights))


def spreads(fields: Sequence[DisplacementField]) -> tuple[Array, float]:
    """Return standard deviations (3,) mm of x, y, z in a frame with heights; least one within x, y.

    Of frames without heights all are infinite.
    """
    for field in fields:
        if field.z is not None and len(field.points) > 2:
            places = np.column_stack([field.points, field.z])
            within = np.linalg.eigvalsh(np.cov(field.points.T))[0]
            return places.std(axis=0), float(np.sqrt(max(within, 0.0)))
    return np.full(3, np.inf), np.inf
