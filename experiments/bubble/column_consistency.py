"""Checks that the columns of places (x, y, z) and of displacements (dx, dy, dz) belong together.

They use what all inflated disks have in common, without a law. The sheet rises as a dome along z,
dx grows with x and dy with y about the centre, and the strain fits the rise h: a fibre from rim to
rim becomes an arc, so both principal strains of the centre are near 2/3 (h/R)^2 (R: radius of the
rim). Computed bubbles with E1/E2 from 1 to 50 have 1.0 to 2.0 times this strain, measured as here;
slack sheets have 0.2 times this at first, and 0.7 times between two of their frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from ...meshes.disk import Outline
from ...readers.fields import DisplacementField
from ...solvers.base import Array

#: Sign and column (0 or 1) of the data that is the true dx, then those of the true dy.
Assignment = tuple[tuple[int, int], tuple[int, int]]


@dataclass(frozen=True)
class ConsistencyLimits:
    """Limits beyond which columns do not belong together."""

    min_points: int = 12  # fewest points on the disk; four terms are fitted
    dome_share: float = 0.2  # dz is not the rise if its dome is below this share of another's
    visible_dome: float = 0.004  # share of the radius: a lower dome is not seen
    errors: float = 4.0  # strain expected from the rise must exceed so many standard errors
    low_frame: float = 0.7  # first frame is subtracted if it rises by less than this share
    impossible: tuple[float, float] = (0.15, 6.0)  # strain over expected: impossible outside
    doubtful: tuple[float, float] = (0.4, 3.0)  # strain over expected: doubtful outside
    height_slope: float = 0.5  # slope of dz over z that is doubted; -1 where bumps are pulled flat
    height_share: float = 0.003  # share of the radius: least RMS of bumps that can be judged


@dataclass(frozen=True, eq=False)
class CentreMotion:
    """Displacements at the centre by a fit of terms that vanish at the rim, and a constant.

    Attributes
    ----------
    dome : (3,) array, mm
        Displacements dx, dy, dz of the centre relative to the rim.
    gradient : (3, 2) array
        Derivatives of dx, dy, dz by x and y at the centre.
    error : float
        Standard error of an in-plane element of the gradient.
    """

    dome: Array
    gradient: Array
    error: float

    @property
    def strain(self) -> Array:
        """Return the Green-Lagrange strain (2, 2) of the centre."""
        in_plane = self.gradient[:2]
        return 0.5 * (in_plane + in_plane.T + self.gradient.T @ self.gradient)

    def due_strains(self, outline: Outline) -> tuple[float, float]:
        """Return the strains 2/3 (h/R)^2 expected from the rise, along long and short semi-axis."""
        rise = abs(float(self.dome[2]))
        long = max(outline.major, outline.minor)
        short = min(outline.major, outline.minor)
        return 2.0 / 3.0 * (rise / long) ** 2, 2.0 / 3.0 * (rise / short) ** 2


def centre_motion(
    field: DisplacementField, outline: Outline, limits: ConsistencyLimits
) -> CentreMotion | None:
    """Fit the motion about the centre of a field by least squares.

    Return None where too few points lie on the disk, or they do not determine it.
    """
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
    """Measured strains of the centre compared with those expected from its rise.

    Attributes
    ----------
    principal_strains : (2,) array
        Measured principal strains, the smaller first.
    expected : (float, float)
        Expected strains along the long and along the short semi-axis.
    gradient : (2, 2) array
        Derivatives of dx and dy by x and y.
    rise : (float, float), mm
        Rise of the highest frame, and of the frame that is subtracted (0 without one).
    is_comparable : bool
        Whether the expected strain is so much larger than its error that they can be compared.
    """

    principal_strains: Array
    expected: tuple[float, float]
    gradient: Array
    rise: tuple[float, float]
    is_comparable: bool

    @property
    def ratios(self) -> tuple[float, float]:
        """Return the ratios of measured to expected strain.

        They are the smaller principal strain over that along the long semi-axis, and the larger
        over that along the short one.
        """
        smaller, larger = self.principal_strains
        long, short = self.expected
        return smaller / long, larger / short

    def is_outside(self, limits: tuple[float, float]) -> bool:
        """Return whether a ratio of measured to expected strain lies outside of the limits."""
        return not (limits[0] <= self.ratios[0] and self.ratios[1] <= limits[1])

    @property
    def assignment(self) -> Assignment:
        """Return the signs and columns of dx and dy with which dx grows most with x, dy with y."""
        candidates: list[Assignment] = [
            ((x_sign, x_column), (y_sign, y_column))
            for x_column, y_column in permutations((0, 1))
            for x_sign, y_sign in product((1, -1), repeat=2)
        ]
        return max(candidates, key=self._growth)

    def _growth(self, assignment: Assignment) -> float:
        """Return the sum of d(dx)/dx and d(dy)/dy with the signs and columns of an assignment."""
        (x_sign, x_column), (y_sign, y_column) = assignment
        return float(x_sign * self.gradient[x_column, 0] + y_sign * self.gradient[y_column, 1])


def strain_of_rise(
    low: CentreMotion | None,
    high: CentreMotion,
    outline: Outline,
    limits: ConsistencyLimits,
) -> StrainOfRise:
    """Compare the strain of the centre with that expected from its rise, between two frames.

    The low frame is not subtracted where it is None or rises nearly as much as the high one.
    """
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
        principal_strains=np.asarray(np.linalg.eigvalsh(strain), dtype=float),
        expected=(float(due[0]), float(due[1])),
        gradient=gradient,
        rise=(float(high.dome[2]), lower_rise),
        is_comparable=bool(due[0] > limits.errors * error),
    )


def slope_of_rise_over_bumps(
    field: DisplacementField, outline: Outline, limits: ConsistencyLimits
) -> float | None:
    """Return the slope of dz over the heights z of the sheet before the test.

    It is -1 where pressure pulls bumps of the sheet flat. Planes and terms symmetric about the
    centre, such as the dome of the bubble, are removed from both first. None where there are no
    heights, too few points, or bumps too small to be judged.
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
    """Return how far points spread: standard deviations of x, y, z (3,), mm, and a least one.

    The last is the smallest standard deviation in any direction of the x-y plane. They are those
    of the first field with heights; all are infinite where none has heights.
    """
    for field in fields:
        if field.z is not None and len(field.points) > 2:
            places = np.column_stack([field.points, field.z])
            within = np.linalg.eigvalsh(np.cov(field.points.T))[0]
            return places.std(axis=0), float(np.sqrt(max(within, 0.0)))
    return np.full(3, np.inf), np.inf
