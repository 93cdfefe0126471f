"""The sheet of a bubble: its measured shape before the test, its rim, and states when inflated."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.polynomial import legendre
from numpy.typing import NDArray

from ...errors import InputError
from ...inference.nuisance import Nuisance, prior_weight
from ...meshes.bubble_model import SLACK, TENSION, BubbleModel
from ...meshes.disk import Outline, disk_modes, metric_modes
from ...readers.fields import DisplacementField
from .section import SheetSettings

Array = NDArray[np.float64]
#: Bounds of the unknowns of the sheet, in standard deviations of their priors.
MAX_SIGMAS = 6.0


@dataclass(frozen=True)
class HeightLimits:
    """Limits of measured heights that are taken for the surface of a sheet; lengths in radii."""

    min_reach: float = 0.85  # least distance of the outermost point from the centre
    reach_in_metres: float = 0.01  # points that all lie nearer are probably given in metres
    max_height: float = 0.5  # largest range of the heights of a clamped sheet


HEIGHTS = HeightLimits()


@dataclass(frozen=True, eq=False)
class DiskPolynomial:
    """A polynomial of x and y for each of several quantities on a disk.

    Attributes
    ----------
    radius : float, mm
        Radius of the disk; the variables are x / radius and y / radius.
    degree : int
        Total degree in x and y.
    coefficients : (terms, values) array
        Coefficients of products of Legendre polynomials, a column for each quantity.
    rms : (values,) array
        RMS of the residuals of each quantity at the fitted points.
    spread : (terms, terms) array
        A root of the covariance of the coefficients, for points with a standard deviation of one.
    """

    radius: float
    degree: int
    coefficients: Array
    rms: Array
    spread: Array

    def values_at(self, points: Array) -> Array:
        """Return the quantities (n, values) at points (n, 2), mm."""
        return _terms(points / self.radius, self.degree) @ self.coefficients

    def errors_at(self, points: Array) -> Array:
        """Return errors (n, terms) of the quantities at points (n, 2), mm.

        They are those by independent errors of the fitted values with a deviation of one; the
        errors of a quantity are these times its `rms`.
        """
        return _terms(points / self.radius, self.degree) @ self.spread


def fit_disk_polynomial(
    points: Array,
    values: Array,
    radius: float,
    degree: int,
) -> DiskPolynomial:
    """Fit a polynomial to quantities at points of a disk by least squares.

    Parameters
    ----------
    points : (n, 2) array, mm
        Positions with the centre of the disk as origin.
    values : (n, k) array
        k quantities at the points.
    radius : float, mm
        Radius of the disk.
    degree : int
        Total degree in x and y.

    Raises
    ------
    InputError
        The points do not determine the polynomial.
    """
    terms = _terms(points / radius, degree)
    count = terms.shape[1]
    min_points = 2 * count  # with fewer, the polynomial follows the noise of its points
    if len(points) < min_points:
        problem = f"{len(points)} points are too few for degree {degree}"
        raise InputError(None, "degree", f"{problem}: expected {min_points} or more")
    solution = np.linalg.lstsq(terms, values, rcond=1e-10)
    coefficients = np.asarray(solution[0], dtype=np.float64)
    rank = int(solution[2])
    if rank < count:
        problem = f"the points do not determine a polynomial of degree {degree}; take a lower one"
        raise InputError(None, "degree", problem)
    rms = np.sqrt(np.mean((values - terms @ coefficients) ** 2, axis=0))
    spread = np.linalg.inv(np.linalg.qr(terms, mode="r"))
    return DiskPolynomial(radius, degree, coefficients, rms, spread)


def _terms(places: Array, degree: int) -> Array:
    """Return products of Legendre polynomials, (n, terms), at places (n, 2) given in radii."""
    x, y = (legendre.legvander(places[:, axis], degree) for axis in (0, 1))
    columns = [
        x[:, power] * y[:, total - power]
        for total in range(degree + 1)
        for power in range(total + 1)
    ]
    return np.column_stack(columns)


@dataclass(frozen=True, eq=False)
class MeasuredSheet:
    """Hold what was measured of a sheet: its surface before the test, and the motion of its rim.

    Attributes
    ----------
    surface : DiskPolynomial or None
        Polynomial fitted to the heights in the reference picture; None where the sheet is taken for
        flat.
    rim : tuple of DiskPolynomial
        Polynomials fitted to the displacements at each pressure, evaluated at the rim; empty where
        the rim is fixed.
    """

    surface: DiskPolynomial | None = None
    rim: tuple[DiskPolynomial, ...] = ()


FLAT = MeasuredSheet()


def measured_sheet(
    sheet: SheetSettings, outline: Outline, fields: Sequence[DisplacementField]
) -> MeasuredSheet:
    """Fit polynomials to the measured surface and rim of a sheet, where the settings ask for them.

    Raise InputError where heights are missing or too large, or points do not reach the rim.
    """
    surface = _surface(sheet, outline, fields) if sheet.measured else None
    rim = []
    for field in fields if sheet.moving_rim else ():
        is_on_disk = _on_disk(field, outline, "rim")
        points = field.points[is_on_disk]
        displacement = field.displacement[is_on_disk]
        rim.append(
            fit_disk_polynomial(points, displacement, outline.major, _degree(sheet, len(points)))
        )
    return MeasuredSheet(surface, tuple(rim))


def _surface(
    sheet: SheetSettings, outline: Outline, fields: Sequence[DisplacementField]
) -> DiskPolynomial:
    """Return the polynomial fitted to the heights of the field with the most points."""
    with_heights = [field for field in fields if field.z is not None]
    if not with_heights:
        problem = "the files hold no height z of the reference picture"
        raise InputError(None, "sheet.surface", f"{problem}: name its column, or use modes")
    # Heights are those of the reference state in all frames: that with the most points is taken.
    field = max(with_heights, key=lambda f: len(f.points))
    assert field.z is not None
    is_on_disk = _on_disk(field, outline, "surface")
    heights = field.z[is_on_disk] - np.median(field.z[is_on_disk])
    if np.ptp(heights) > HEIGHTS.max_height * outline.radius:
        problem = (
            f"heights z of the reference picture differ by {np.ptp(heights):.3g} mm: expected a "
            "clamped sheet that is nearly flat; is it the reference, and the unit of z right?"
        )
        raise InputError(None, "sheet.surface", problem)
    points = field.points[is_on_disk]
    return fit_disk_polynomial(points, heights[:, None], outline.major, _degree(sheet, len(points)))


def _on_disk(field: DisplacementField, outline: Outline, key: str) -> NDArray[np.bool_]:
    """Return which points (n,) of a field lie on the disk.

    Raise InputError, which names the key of the sheet's section, if they do not reach the rim.
    """
    share = outline.share(field.points)
    is_on_disk = share <= 1.0
    if field.z is not None and key == "surface":
        is_on_disk &= np.isfinite(field.z)
    reach = float(share[is_on_disk].max()) if is_on_disk.any() else 0.0
    if reach < HEIGHTS.min_reach:
        needed = 100 * HEIGHTS.min_reach
        problem = (
            f"points go out to {100 * reach:.0f} % of the radius; at least {needed:.0f} % are "
            "needed to know the rim"
        )
        if reach < HEIGHTS.reach_in_metres:
            problem += '; places in metres need length_unit = "m"'
        raise InputError(None, f"sheet.{key}", problem)
    return is_on_disk


def _degree(sheet: SheetSettings, point_count: int) -> int:
    """Return the degree of the polynomials through measured heights and motions of the rim.

    One of 8 follows a moving rim so badly that G12 is 12 % too small; one of 10 is taken where each
    of its terms has four points.
    """
    if sheet.degree is not None:
        return sheet.degree
    degree = 10 if sheet.moving_rim else 8
    while degree > 8 and 2 * (degree + 1) * (degree + 2) > point_count:
        degree -= 1
    return degree


def with_sheet(
    model: BubbleModel,
    sheet: SheetSettings,
    outline: Outline,
    measured: MeasuredSheet,
) -> BubbleModel:
    """Return the model of a flat disk changed into that of the measured sheet.

    It gets the measured surface and motion of the rim, and the modes of the unknown shape and
    strain, all at zero.

    Parameters
    ----------
    model : BubbleModel
        The model of the flat disk.
    sheet : SheetSettings
    outline : Outline, mm
        The rim.
    measured : MeasuredSheet
    """
    places = model.mesh.points[:, :2]
    rim = model.mesh.node_sets["rim"]
    if measured.surface is not None:
        heights = measured.surface.values_at(places)[:, 0]
        heights -= heights[rim].mean()
        points = np.column_stack([places, heights])
        model = replace(model, mesh=replace(model.mesh, points=points))
    if measured.rim:
        motion = np.array([polynomial.values_at(places[rim]) for polynomial in measured.rim])
        levels = np.array([0.0, *model.pressures])
        columns = motion.reshape(len(motion), -1)
        columns = np.concatenate([np.zeros((1, columns.shape[1])), columns])
        interpolated = [np.interp(model.increments, levels, column) for column in columns.T]
        shape = (len(model.increments), len(rim), 3)
        model = replace(model, rim_motion=np.array(interpolated).T.reshape(shape))
    unit_places = outline.unit(places)
    modes = disk_modes(unit_places, sheet.modes)
    strains = metric_modes(unit_places, sheet.metric)
    return replace(model, modes=modes, strains=strains)


def sheet_nuisance(sheet: SheetSettings, model: BubbleModel, scale: Array) -> list[Nuisance]:
    """Return the unknowns of the sheet: tension, modes of its shape, slack, and strains.

    Parameters
    ----------
    scale : (m,) array
        mm in one unit of each residual.
    """
    weight = prior_weight(sheet.misfit, scale)
    unknowns = [(name, "mm", 1.0, sheet.prior) for name in model.modes]
    unknowns += [(name, "%", 1e-2, sheet.slack_prior) for name in SLACK if sheet.slack]
    unknowns += [(name, "%", 1e-2, sheet.metric_prior) for name in model.strains]
    tension = [] if sheet.tension_prior is None else _tension(sheet, sheet.tension_prior, weight)
    return tension + [
        Nuisance(
            name,
            -MAX_SIGMAS * prior,
            MAX_SIGMAS * prior,
            unit,
            model_parameter=name,
            scale=scale_of_unit,
            prior=prior,
            weight=weight,
        )
        for name, unit, scale_of_unit, prior in unknowns
    ]


def _tension(sheet: SheetSettings, prior: float, weight: float) -> list[Nuisance]:
    """Return the unknown tensions, N/mm, at least zero: a sheet that is not taut has slack."""
    return [
        Nuisance(
            name,
            max(0.0, mean - MAX_SIGMAS * prior),
            mean + MAX_SIGMAS * prior,
            "N/mm",
            model_parameter=name,
            prior=prior,
            weight=weight,
            start=mean,
        )
        for name, mean in zip(TENSION, sheet.tension, strict=True)
    ]


#: States of a quad by its principal stresses, as numbered in the files of results.
TAUT = 0
WRINKLED = 1
SLACK_STATE = 2


def states(stress: Array, *, negligible: float = 1e-6) -> NDArray[np.intp]:
    """Return the states of the quads of a sheet: taut, wrinkled or slack.

    Parameters
    ----------
    stress : (n, 3) array
        Stresses (normal in two perpendicular directions, then shear) of each quad.
    negligible : float
        Principal stresses below this share of the largest of the sheet count as zero.

    Returns
    -------
    (n,) array of int
        0 taut (both principal stresses positive), 1 wrinkled (one), 2 slack (none).
    """
    mean = 0.5 * (stress[:, 0] + stress[:, 1])
    half = 0.5 * (stress[:, 0] - stress[:, 1])
    radius = np.hypot(half, stress[:, 2])
    threshold = negligible * float(np.abs(mean).max() + radius.max())
    larger = mean + radius
    smaller = mean - radius
    tension_field = np.where(smaller <= threshold, WRINKLED, TAUT)
    return np.where(larger <= threshold, SLACK_STATE, tension_field)


def interpolated_at_nodes(
    nodes: Array,
    places: Array,
    values: Array,
    *,
    max_spacings: float = 2.0,
) -> Array:
    """Interpolate measured values to the nodes of a model.

    Parameters
    ----------
    nodes : (nodes, 2) array, mm
        Positions of the nodes.
    places : (n, 2) array, mm
        Positions of the measured values.
    values : (n, 3) array
    max_spacings : float
        A node that is further from all places than this many distances between neighbouring places
        counts as not measured.

    Returns
    -------
    (nodes, 3) array
        NaN where nothing is measured.
    """
    if len(places) == len(nodes) and np.allclose(places, nodes):
        return values
    interpolated = np.full((len(nodes), 3), np.nan)
    if len(places) < 4:
        return interpolated
    tree = scipy.spatial.cKDTree(places)
    distances, _ = tree.query(places, k=2)
    spacing = float(np.median(distances[:, 1]))
    is_measured = tree.query(nodes)[0] <= max_spacings * spacing
    if is_measured.any():
        with suppress(scipy.spatial.QhullError):  # nothing lies between places on one line
            interpolator = scipy.interpolate.LinearNDInterpolator(places, values)
            interpolated[is_measured] = interpolator(nodes[is_measured])
    return interpolated
