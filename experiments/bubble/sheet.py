"""The sheet of a bubble: its first shape and its rim in the model, and the inflated sheet."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.polynomial import legendre
from numpy.typing import NDArray

from ...errors import InputError
from ...inference.comparison import Nuisance
from ...meshes.bubble_model import SLACK, BubbleModel
from ...meshes.disk import Outline, disk_modes, metric_modes
from ...readers.fields import DisplacementField
from .section import SheetSettings

Array = NDArray[np.float64]
#: Points a coefficient needs at least.
LEAST_POINTS = 2


@dataclass(frozen=True, eq=False)
class DiskPolynomial:
    """A polynomial of x and y of several values: coefficients (terms, values) of Legendre products.
    radius : mm, of the disk; degree : in x and y together. rms : (values,) left at its points."""

    radius: float
    degree: int
    coefficients: Array
    rms: Array

    def at(self, points: Array) -> Array:
        """Return values (n, values) at points (n, 2) mm."""
        return np.asarray(_terms(points / self.radius, self.degree) @ self.coefficients)


def fit_disk_polynomial(points: Array, values: Array, radius: float, degree: int) -> DiskPolynomial:
    """Fit values (n, k) at points (n, 2) mm; raises InputError if they do not determine it."""
    terms = _terms(points / radius, degree)
    count = terms.shape[1]
    if len(points) < LEAST_POINTS * count:
        problem = f"{len(points)} points are too few for degree {degree}"
        raise InputError(None, "degree", f"{problem}: expected {LEAST_POINTS * count} or more")
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
    return np.column_stack([x[:, a] * y[:, d - a] for d in range(degree + 1) for a in range(d + 1)])


#: How far out measured heights must go, in radii: beyond them the polynomial is a guess.
LEAST_REACH = 0.85
#: Places that go out to less are in metres, as a rule.
METRES = 0.01
#: Height over the radius beyond which a surface is not that of a clamped sheet.
MOST_HEIGHT = 0.5
#: Points whose misfits go together: so many fewer say something.
TOGETHER = 20
#: Bounds of a mode and of slack, in standard deviations of their priors.
MOST_SIGMAS = 6.0


@dataclass(frozen=True, eq=False)
class MeasuredSheet:
    """Polynomials through the heights of the reference picture, and the motion at each pressure."""

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
        on = _on_disk(field, outline, "rim")
        moved = field.displacement[on]
        rim.append(fit_disk_polynomial(field.points[on], moved, outline.major, sheet.degree))
    return MeasuredSheet(surface, tuple(rim))


def _surface(
    sheet: SheetSettings, outline: Outline, fields: Sequence[DisplacementField]
) -> DiskPolynomial:
    having = [f for f in fields if f.z is not None]
    if not having:
        problem = "the files hold no height z of the reference picture"
        raise InputError(None, "sheet.surface", f"{problem}: name its column, or use modes")
    # The reference is the same in all frames; the one with the most points tells most.
    field = max(having, key=lambda f: len(f.points))
    assert field.z is not None
    on = _on_disk(field, outline, "surface")
    heights = field.z[on] - np.median(field.z[on])
    if np.ptp(heights) > MOST_HEIGHT * outline.radius:
        problem = (
            f"heights z of the reference picture differ by {np.ptp(heights):.3g} mm: expected a "
            "clamped sheet that is nearly flat; is it the reference, and the unit of z right?"
        )
        raise InputError(None, "sheet.surface", problem)
    return fit_disk_polynomial(field.points[on], heights[:, None], outline.major, sheet.degree)


def _on_disk(field: DisplacementField, outline: Outline, key: str) -> NDArray[np.bool_]:
    share = outline.share(field.points)
    on = share <= 1.0
    if field.z is not None and key == "surface":
        on &= np.isfinite(field.z)
    reach = float(share[on].max()) if on.any() else 0.0
    if reach < LEAST_REACH:
        problem = (
            f"points go out to {100 * reach:.0f} % of the radius; at least {100 * LEAST_REACH:.0f} "
            "% are needed to know the rim"
        )
        if reach < METRES:
            problem += '; places in metres need length_unit = "m"'
        raise InputError(None, f"sheet.{key}", problem)
    return on


def with_sheet(
    model: BubbleModel, sheet: SheetSettings, outline: Outline, of: MeasuredSheet
) -> BubbleModel:
    """Return the model of a flat disk as that of the sheet as it was."""
    places = model.mesh.points[:, :2]
    rim = model.mesh.node_sets["rim"]
    if of.surface is not None:
        heights = of.surface.at(places)[:, 0]
        heights -= heights[rim].mean()
        points = np.column_stack([places, heights])
        model = replace(model, mesh=replace(model.mesh, points=points))
    if of.rim:
        measured = np.array([p.at(places[rim]) for p in of.rim])
        levels = np.array([0.0, *model.pressures])
        flat = np.concatenate([np.zeros((1, measured[0].size)), measured.reshape(len(of.rim), -1)])
        motion = [np.interp(model.increments, levels, column) for column in flat.T]
        shape = (len(model.increments), len(rim), 3)
        model = replace(model, rim_motion=np.array(motion).T.reshape(shape))
    at = outline.unit(places)
    modes = disk_modes(at, 1.0, sheet.modes)
    strains = metric_modes(at, 1.0, sheet.metric)
    return replace(model, modes=modes, strains=strains)


def prior_weight(misfit: float, scale: Array) -> float:
    """Return the residual of an unknown one prior away; misfit : mm; scale (m,) : mm in one."""
    return float(misfit * np.sqrt(TOGETHER) / np.median(scale))


def sheet_nuisance(sheet: SheetSettings, model: BubbleModel, scale: Array) -> list[Nuisance]:
    """Return unknowns of the sheet; scale (m,) : mm in one unit of each residual."""
    weight = prior_weight(sheet.misfit, scale)
    most = MOST_SIGMAS
    every = [(name, "mm", 1.0, sheet.prior) for name in model.modes]
    every += [(name, "%", 1e-2, sheet.slack_prior) for name in SLACK if sheet.slack]
    every += [(name, "%", 1e-2, sheet.metric_prior) for name in model.strains]
    return [
        Nuisance(name, -most * prior, most * prior, unit, name, size, prior, weight)
        for name, unit, size, prior in every
    ]


#: States of a quad by its principal stresses, as the files have them.
TAUT, WRINKLED, LOOSE = 0, 1, 2
#: Stress over the largest of the sheet that is taken as none.
NONE = 1e-6
#: Distances between neighbouring measured places: farther from all of them nothing is measured.
FAR = 2.0


def states(stress: Array) -> NDArray[np.intp]:
    """Return (n,) states of stresses (n, 3) of one sheet."""
    mean = 0.5 * (stress[:, 0] + stress[:, 1])
    half = 0.5 * (stress[:, 0] - stress[:, 1])
    size = np.hypot(half, stress[:, 2])
    none = NONE * float(np.abs(mean).max() + size.max())
    largest = mean + size
    least = mean - size
    return np.where(largest <= none, LOOSE, np.where(least <= none, WRINKLED, TAUT))


def at_nodes(nodes: Array, places: Array, values: Array) -> Array:
    """Interpolate values (n, 3) at places (n, 2) at nodes (nodes, 2); NaN where none is near."""
    if len(places) == len(nodes) and np.allclose(places, nodes):
        return values
    found = np.full((len(nodes), 3), np.nan)
    if len(places) < 4:
        return found
    tree = scipy.spatial.cKDTree(places)
    apart = float(np.median(tree.query(places, k=2)[0][:, 1]))
    near = tree.query(nodes)[0] <= FAR * apart
    if near.any():
        with suppress(scipy.spatial.QhullError):  # nothing lies between places on one line
            found[near] = scipy.interpolate.LinearNDInterpolator(places, values)(nodes[near])
    return found
