"""The sheet of a bubble: its first shape and its rim in the model, and the inflated sheet."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.polynomial import legendre
from numpy.typing import NDArray

from ...errors import InputError
from ...inference.nuisance import Nuisance
from ...meshes.bubble_model import SLACK, BubbleModel
from ...meshes.disk_modes import disk_modes, metric_modes
from ...meshes.outline import Outline
from ...readers.fields import DisplacementField
from .section import SheetSettings

Array = NDArray[np.float64]
#: Bounds of a mode and of slack, in standard deviations of their priors.
MAX_SIGMAS = 6.0


@dataclass(frozen=True)
class HeightLimits:
    """What measured heights must be to be taken for the surface of a sheet. Lengths in radii."""

    min_reach: float = 0.85  # of the outermost point: beyond it the polynomial is a guess
    reach_in_metres: float = 0.01  # places that go out to less are in metres, as a rule
    max_height: float = 0.5  # a surface of more is not that of a clamped sheet


HEIGHTS = HeightLimits()


@dataclass(frozen=True, eq=False)
class DiskPolynomial:
    """A polynomial of x and y of several values.

    Attributes
    ----------
    radius : float, mm
        Of the disk.
    degree : int
        In x and y together.
    coefficients : (terms, values) array
        Of products of Legendre polynomials.
    rms : (values,) array
        Root of the mean square that is left at the points it was fitted to.
    """

    radius: float
    degree: int
    coefficients: Array
    rms: Array

    def at(self, points: Array) -> Array:
        """Return values (n, values) at points (n, 2) mm."""
        return np.asarray(_terms(points / self.radius, self.degree) @ self.coefficients)


def fit_disk_polynomial(points: Array, values: Array, radius: float, degree: int) -> DiskPolynomial:
    """Fit a polynomial by least squares.

    Parameters
    ----------
    points : (n, 2) array, mm
    values : (n, k) array
    radius : float, mm
        Of the disk.
    degree : int

    Raises
    ------
    InputError
        The points do not determine it.
    """
    terms = _terms(points / radius, degree)
    count = terms.shape[1]
    min_points = 2 * count
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
    return DiskPolynomial(radius, degree, coefficients, rms)


def _terms(places: Array, degree: int) -> Array:
    """Return (n, terms) at places (n, 2) in radii."""
    x, y = (legendre.legvander(places[:, axis], degree) for axis in (0, 1))
    columns = [
        x[:, power] * y[:, total - power]
        for total in range(degree + 1)
        for power in range(total + 1)
    ]
    return np.column_stack(columns)


@dataclass(frozen=True, eq=False)
class MeasuredSheet:
    """What was measured of a sheet and its rim.

    Attributes
    ----------
    surface : DiskPolynomial or None
        Through the heights of the reference picture.
    rim : tuple of DiskPolynomial
        Through the displacements at each pressure.
    """

    surface: DiskPolynomial | None = None
    rim: tuple[DiskPolynomial, ...] = ()


FLAT = MeasuredSheet()


def measured_sheet(
    sheet: SheetSettings, outline: Outline, fields: Sequence[DisplacementField]
) -> MeasuredSheet:
    """Fit polynomials to the measurement; InputError for missing, narrow or large heights."""
    surface = _surface(sheet, outline, fields) if sheet.measured else None
    rim = []
    for field in fields if sheet.moving_rim else ():
        is_on_disk = _on_disk(field, outline, "rim")
        points = field.points[is_on_disk]
        displacement = field.displacement[is_on_disk]
        rim.append(fit_disk_polynomial(points, displacement, outline.major, sheet.degree))
    return MeasuredSheet(surface, tuple(rim))


def _surface(
    sheet: SheetSettings, outline: Outline, fields: Sequence[DisplacementField]
) -> DiskPolynomial:
    """Return the polynomial through the heights of the field with the most points."""
    with_heights = [field for field in fields if field.z is not None]
    if not with_heights:
        problem = "the files hold no height z of the reference picture"
        raise InputError(None, "sheet.surface", f"{problem}: name its column, or use modes")
    # The reference is the same in all frames; the one with the most points tells most.
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
    return fit_disk_polynomial(points, heights[:, None], outline.major, sheet.degree)


def _on_disk(field: DisplacementField, outline: Outline, key: str) -> NDArray[np.bool_]:
    """Return which points lie on the disk; InputError names a key if they do not reach its rim."""
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


def with_sheet(
    model: BubbleModel, sheet: SheetSettings, outline: Outline, measured: MeasuredSheet
) -> BubbleModel:
    """Return the model of a flat disk as that of the sheet as it was.

    Parameters
    ----------
    model : BubbleModel
        Of the flat disk.
    sheet : SheetSettings
    outline : Outline, mm
    measured : MeasuredSheet
    """
    places = model.mesh.points[:, :2]
    rim = model.mesh.node_sets["rim"]
    if measured.surface is not None:
        heights = measured.surface.at(places)[:, 0]
        heights -= heights[rim].mean()
        points = np.column_stack([places, heights])
        model = replace(model, mesh=replace(model.mesh, points=points))
    if measured.rim:
        motion = np.array([polynomial.at(places[rim]) for polynomial in measured.rim])
        levels = np.array([0.0, *model.pressures])
        columns = motion.reshape(len(motion), -1)
        columns = np.concatenate([np.zeros((1, columns.shape[1])), columns])
        interpolated = [np.interp(model.increments, levels, column) for column in columns.T]
        shape = (len(model.increments), len(rim), 3)
        model = replace(model, rim_motion=np.array(interpolated).T.reshape(shape))
    unit_places = outline.unit(places)
    modes = disk_modes(unit_places, 1.0, sheet.modes)
    strains = metric_modes(unit_places, 1.0, sheet.metric)
    return replace(model, modes=modes, strains=strains)


def prior_weight(misfit: float, scale: Array, *, correlated: int = 20) -> float:
    """Return the residual of an unknown one prior away.

    Parameters
    ----------
    misfit : float, mm
        RMS of a good model.
    scale : (m,) array, mm
        Of one unit of each residual.
    correlated : int
        Points whose misfits go together: so many fewer say something.
    """
    return float(misfit * np.sqrt(correlated) / np.median(scale))


def sheet_nuisance(sheet: SheetSettings, model: BubbleModel, scale: Array) -> list[Nuisance]:
    """Return unknowns of the sheet; scale (m,) : mm in one unit of each residual."""
    weight = prior_weight(sheet.misfit, scale)
    unknowns = [(name, "mm", 1.0, sheet.prior) for name in model.modes]
    unknowns += [(name, "%", 1e-2, sheet.slack_prior) for name in SLACK if sheet.slack]
    unknowns += [(name, "%", 1e-2, sheet.metric_prior) for name in model.strains]
    return [
        Nuisance(name, -MAX_SIGMAS * prior, MAX_SIGMAS * prior, unit, name, factor, prior, weight)
        for name, unit, factor, prior in unknowns
    ]


#: States of a quad by its principal stresses, as the files have them.
TAUT = 0
WRINKLED = 1
SLACK_STATE = 2


def states(stress: Array, *, negligible: float = 1e-6) -> NDArray[np.intp]:
    """Return states of the quads of a sheet.

    Parameters
    ----------
    stress : (n, 3) array
    negligible : float
        Stress over the largest of the sheet that is taken as none.

    Returns
    -------
    (n,) array of int
        0 taut, 1 wrinkled, 2 slack.
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
    nodes: Array, places: Array, values: Array, *, max_spacings: float = 2.0
) -> Array:
    """Interpolate measured values at the nodes of a model.

    Parameters
    ----------
    nodes : (nodes, 2) array, mm
    places : (n, 2) array, mm
    values : (n, 3) array
    max_spacings : float
        Distances between neighbouring places: farther from all of them nothing is measured.

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
