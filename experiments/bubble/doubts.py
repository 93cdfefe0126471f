"""Traps that the data of a bubble test can have fallen into; one module a group of them.

Each check is told what was measured (`view.View`) and gives doubts, none where all is well. A check
of its own is one function in `CHECKS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.disk import Outline
from ...readers.fields import DisplacementField
from ..kinds import Doubt, Expected
from .placement import POWERS, apex_shape, in_all_quarters, line_angle
from .registration import Axes, Rim, rim_of_motion, symmetry_axes

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class View:
    """Measured fields by rising pressure, in the test's coordinates.

    outline : of the clamped edge. thickness : mm. registered : whether a registration brought
    them there.
    """

    fields: tuple[DisplacementField, ...]
    outline: Outline
    thickness: float
    registered: bool

    @property
    def radius(self) -> float:
        """mm, mean of the semi-axes where the edge is an ellipse."""
        return self.outline.radius

    @property
    def last(self) -> DisplacementField:
        """At the highest pressure."""
        return self.fields[-1]

    @cached_property
    def rises(self) -> Array:
        """(fields,) mm: median rise of the points within a quarter of the radius, or of all."""
        return np.array([self._rise(field) for field in self.fields])

    def _rise(self, field: DisplacementField) -> float:
        near = self.outline.share(field.points) < 0.25
        rise = field.displacement[near, 2] if near.any() else field.displacement[:, 2]
        return float(np.median(rise))

    @cached_property
    def apexes(self) -> tuple[Apex, ...]:
        """Of every field; none where there are too few points."""
        try:
            return tuple(apex_of(field, self.outline.minor) for field in self.fields)
        except (InputError, np.linalg.LinAlgError):
            return ()

    @cached_property
    def rim(self) -> Rim | None:
        """Where the sheet does not rise; None where points do not reach it all around.

        The turn of an ellipse is found, too.
        """
        high = [f for f, r in zip(self.fields, self.rises, strict=True) if r > 0.5 * self.rises[-1]]
        surfaces = [(f.points, f.displacement[:, 2]) for f in high]
        try:
            return rim_of_motion(surfaces, (self.outline.major, self.outline.minor))
        except InputError:
            return None

    @cached_property
    def axes(self) -> Axes | None:
        """About which the fields are symmetric; None where points lie on one side only.

        None, too, where the edge is an ellipse: its turn says more, and across the yarns there
        are no axes.
        """
        if not self.outline.round or not in_all_quarters(self.last.points):
            return None
        return symmetry_axes([field.frame for field in self.fields], self.radius)

    def inner(self, field: DisplacementField, share: float = 0.9) -> NDArray[np.bool_]:
        """Points well within the rim."""
        return np.asarray(self.outline.share(field.points) < share)


#: Of the highest rise: a centre that sinks by more while the pressure rises is no noise.
SINKS = 0.02
#: Of the displacements: how much of them the reference places follow, when they are deformed ones.
FOLLOWS, LIKE = 0.5, 0.9
#: Of the larger strain at the apex: the other one is not as negative as this under pressure.
NEGATIVE = -0.25
#: Shares of a rise.
HALF = 0.5


def upside_down(view: View, expected: Expected) -> list[Doubt]:
    """z flipped: the bubble goes down as the pressure goes up."""
    rise = float(view.rises[-1])
    if rise >= 0:
        return []
    text = (
        f"the centre moves by {rise:.3g} mm along z at {1e3 * view.last.pressure:.4g} kPa: z is "
        "flipped; turn the axes, or let a registration find them"
    )
    return [Doubt("z-flipped", True, text)]


def order(view: View, expected: Expected) -> list[Doubt]:
    """Frames that are not in the order of their pressures."""
    rises, steps = view.rises, []
    for k, (a, b) in enumerate(pairwise(rises)):
        if b < a - SINKS * rises.max():
            low, high = (1e3 * view.fields[i].pressure for i in (k, k + 1))
            steps.append(f"from {a:.3g} to {b:.3g} mm between {low:.4g} and {high:.4g} kPa")
    if not steps:
        return []
    text = f"the centre sinks {steps[0]}: the frames are not in the order of the pressures"
    return [Doubt("frame-order", True, text)]


def repeated(view: View, expected: Expected) -> list[Doubt]:
    """The same frame for two pressures."""
    pairs = []
    for first, second in pairwise(view.fields):
        same = first.displacement.shape == second.displacement.shape and np.array_equal(
            first.displacement, second.displacement
        )
        if same and np.abs(first.displacement).max() > 0:
            pairs.append(f"{1e3 * first.pressure:.4g} and {1e3 * second.pressure:.4g} kPa")
    if not pairs:
        return []
    more = f" (and in {len(pairs) - 1} more pairs)" if pairs[1:] else ""
    text = (
        f"the displacements at {pairs[0]} are the same to the last digit{more}: one frame is given "
        "twice"
    )
    return [Doubt("repeated-frame", True, text)]


def rejected_at_zero(view: View, expected: Expected) -> list[Doubt]:
    """Points without correlation that were written as zeros."""
    inner = view.inner(view.last)
    moved = view.last.displacement[inner]
    still = int((moved == 0).all(axis=1).sum())
    twice = int((view.last.points == 0).all(axis=1).sum())
    if still == 0 and twice < 2:
        return []
    found = [f"{still} of {len(moved)} points well within the rim do not move at all"] * (still > 0)
    found += [f"{twice} points lie at exactly x = y = 0"] * (twice > 1)
    text = (
        f"{' and '.join(found)} at {1e3 * view.last.pressure:.4g} kPa: points without correlation "
        "seem to be written as zeros; name the column that marks them (flag_column)"
    )
    return [Doubt("zero-points", True, text)]


def deformed_coordinates(view: View, expected: Expected) -> list[Doubt]:
    """Places after the motion where those before it are meant."""
    last = view.last
    if last.z is not None and not view.registered:
        # A reference surface that has the bubble's own shape.
        alike = _follows(last.z[:, None], last.displacement[:, 2:])
        if alike is not None and alike > FOLLOWS:
            return [_deformed(f"the height z follows dz by {alike:.0%}")]
    for other in view.fields[:-1]:
        if len(other.points) != len(last.points):
            continue
        place = last.points - other.points
        moved = (last.displacement - other.displacement)[:, :2]
        alike = _follows(place, moved)
        if alike is not None and alike > FOLLOWS:
            return [_deformed(f"x and y change from frame to frame by {alike:.0%} of dx and dy")]
    return []


def _follows(place: np.ndarray, moved: np.ndarray) -> float | None:
    """By how much places follow displacements, where the two are alike; None where they are not."""
    a, b = place - place.mean(axis=0), moved - moved.mean(axis=0)
    size = float(np.sqrt((a**2).sum() * (b**2).sum()))
    if not size > 0 or float((a * b).sum()) < LIKE * size:
        return None
    return float((a * b).sum() / (b**2).sum())


def _deformed(seen: str) -> Doubt:
    text = (
        f"{seen}: the coordinates are those of the deformed sheet; export the reference coordinates"
    )
    return Doubt("deformed-coordinates", True, text)


def mirrored(view: View, expected: Expected) -> list[Doubt]:
    """x or y flipped in places or in displacements, not in both."""
    if not view.apexes:
        return []
    strain = np.array(view.apexes[-1].strain)
    if not strain.max() > 0:
        text = f"the sheet shrinks at its centre (strains {strain[0]:.3g}, {strain[1]:.3g})"
        return [Doubt("axis-flipped", True, f"{text}: x, y, dx and dy do not go together")]
    negative = [n for n, s in zip("xy", strain, strict=True) if s < NEGATIVE * strain.max()]
    return [
        Doubt(
            "axis-flipped",
            True,
            f"the centre is strained by {strain[0]:.3g} along x and {strain[1]:.3g} along y: "
            f"{name} and d{name} have opposite senses; flip one of them",
        )
        for name in negative
    ]


ADVICE = "let a registration find the frame ([bubble.data.points.registration])"
#: Of the radius: a centre, or a sheet's height, further off is no small thing.
OFF, FAR_OFF, HIGH = 0.035, 0.15, 0.1
#: Degrees.
TILT, STEEP = 1.2, 8.0
TURN = 5.0
#: Standard errors that a place or an angle must be off by.
SURE = 4.0
#: How clear axes must be, and how much more the warp must be strained than the fill.
CLEAR, MORE = 0.6, 1.1


def camera_height(view: View, expected: Expected) -> list[Doubt]:
    """Heights counted from somewhere else than the rim."""
    if view.last.z is None:
        return []
    height = float(np.median(view.last.z))
    if abs(height) < HIGH * view.radius:
        return []
    text = f"the reference heights lie about z = {height:.4g} mm, not about the rim: {ADVICE}"
    return [Doubt("camera-frame", False, text)]


def off_centre(view: View, expected: Expected) -> list[Doubt]:
    """The rim's centre is not the origin."""
    if view.rim is None:
        return []
    off = float(np.hypot(view.rim.x, view.rim.y))
    if off < max(OFF * view.radius, SURE * view.rim.error):
        return []
    text = (
        f"the sheet rises about x = {view.rim.x:.3g}, y = {view.rim.y:.3g} mm (+- "
        f"{view.rim.error:.2g}), not about the origin: {ADVICE}"
    )
    return [Doubt("off-centre", off > FAR_OFF * view.radius, text)]


def tilted(view: View, expected: Expected) -> list[Doubt]:
    """The rise is not along z: on average the sheet moves sideways."""
    last = view.last
    inner = view.inner(last)
    if not inner.any():
        return []
    x, y, z = last.displacement[inner].mean(axis=0) - view.fields[0].displacement[
        view.inner(view.fields[0])
    ].mean(axis=0) * (len(view.fields) > 1)
    tilt = float(np.degrees(np.arctan2(np.hypot(x, y), abs(z)))) if z else 0.0
    if tilt < TILT:
        return []
    text = (
        f"the sheet moves along a line {tilt:.2g} degrees from z: its frame is tilted, or the "
        f"clamp moved; {ADVICE}"
    )
    return [Doubt("tilted", tilt > STEEP, text)]


def turned(view: View, expected: Expected) -> list[Doubt]:
    """Warp and fill are not along x and y."""
    if not view.outline.round:
        return _turned_rim(view)
    if view.axes is None or view.axes.clear < CLEAR or view.rim is None:
        return []
    if abs(view.axes.off) < max(TURN, SURE * view.axes.error):
        return []
    text = (
        f"the fields are symmetric about axes {view.axes.off:.3g} degrees from x and y (+- "
        f"{view.axes.error:.2g}): warp and fill lie there; {ADVICE}"
    )
    return [Doubt("turned", False, text)]


def _turned_rim(view: View) -> list[Doubt]:
    """An elliptic rim does not lie where it is said to."""
    if view.rim is None:
        return []
    said = view.outline.angle
    off = line_angle(view.rim.angle - said)
    if abs(off) < max(TURN, SURE * view.rim.turn_error):
        return []
    text = (
        f"the sheet rises within an ellipse whose major axis lies {said + off:.3g} degrees from x "
        f"(+- {view.rim.turn_error:.2g}), not {said:.3g}: is its angle right, and {ADVICE}"
    )
    return [Doubt("turned", False, text)]


def swapped(view: View, expected: Expected) -> list[Doubt]:
    """Warp and fill for one another, by the bounds of the moduli.

    An ellipse is strained more along its minor axis, whatever the law.
    """
    if not view.outline.round:
        return []
    if not view.apexes or not expected.moduli or not expected.warp_is_stiffer:
        return []
    warp, fill = view.apexes[-1].strain
    if len(view.apexes) > 1:
        # What the sheet's first shape adds to both frames cancels.
        warp, fill = warp - view.apexes[0].strain[0], fill - view.apexes[0].strain[1]
    if not warp > MORE * fill > 0:
        return []
    text = (
        f"the centre is strained by {warp:.3g} along the warp and {fill:.3g} along the fill, and "
        "the bounds have the warp stiffer: warp and fill seem to be swapped"
    )
    return [Doubt("swapped", False, text)]


#: Of the radius: the rise of a bubble at its highest pressure is somewhere between.
LEAST_RISE, MOST_RISE = 0.004, 1.5
#: Of the radius: how far from the centre the outermost point is.
LEAST_REACH, MOST_REACH = 0.1, 20.0
#: Of a biaxial stress and strain: Poisson's ratio is not known yet, and matters little here.
RATIO = 0.25
#: Below this mean strain the first shape of the sheet decides what looks like strain.
TELLING = 0.002


def length_unit(view: View, expected: Expected) -> list[Doubt]:
    """mm beside m, in places or in displacements."""
    reach = float(view.outline.share(view.last.points).max())
    rise = abs(float(view.rises[-1])) / view.radius
    found = []
    if not LEAST_REACH < reach < MOST_REACH:
        found.append(
            f"the outermost point is {reach:.3g} radii from the centre: are x and y in the length "
            "unit that is said, and is the radius right?"
        )
    if not LEAST_RISE < rise < MOST_RISE:
        found.append(
            f"the centre rises by {rise:.3g} radii at {_kilo(view)} kPa: are the displacements in "
            "the length unit that is said (mm beside m)?"
        )
    return [Doubt("length-unit", True, text) for text in found]


def pressure_unit(view: View, expected: Expected) -> list[Doubt]:
    """bar beside kPa, or a wrong thickness: n1 k1 + n2 k2 = p gives the force without a model."""
    if not view.apexes or not expected.moduli:
        return []
    top = view.apexes[-1]
    mean = 0.5 * sum(top.strain)
    if not np.isfinite(top.force) or mean < TELLING:
        return []
    modulus = top.stiffness * (1 - RATIO) / view.thickness
    far = expected.outside(modulus, ("E1", "E2"))
    if not far:
        return []
    text = (
        f"equilibrium of the apex at {_kilo(view)} kPa gives {top.force:.3g} N/mm at a strain of "
        f"{mean:.3g}, a modulus of about {far}: is the pressure in the unit that is said (bar "
        "beside kPa), and are thickness and lengths right?"
    )
    return [Doubt("pressure-unit", True, text)]


def _kilo(view: View) -> str:
    return f"{1e3 * view.last.pressure:.4g}"


#: Later checks reckon with what earlier ones make sure of: a sure doubt ends the list.
CHECKS = (
    length_unit,
    rejected_at_zero,
    repeated,
    upside_down,
    order,
    deformed_coordinates,
    mirrored,
    pressure_unit,
    camera_height,
    off_centre,
    tilted,
    turned,
    swapped,
)


def doubts_of(view: View, expected: Expected) -> Sequence[Doubt]:
    """What is doubtful, in the order of the checks."""
    found: list[Doubt] = []
    for check in CHECKS:
        found += check(view, expected)
        if any(doubt.sure for doubt in found):
            break
    return found


__all__ = ["CHECKS", "View", "doubts_of"]


@dataclass(frozen=True)
class Apex:
    """What the shape says at the centre of one field.

    Parameters
    ----------
    pressure : MPa. height : mm, rise of the centre.
    curvature : 1/mm, k1 + k2 of the inflated surface; positive where it is a dome.
    force : N/mm, the membrane force p / (k1 + k2), the same in all directions if the two are equal.
    error : N/mm, standard error of the force from the scatter of the points about a smooth surface.
    strain : logarithmic, along x and along y.
    """

    pressure: float
    height: float
    curvature: float
    force: float
    error: float
    strain: tuple[float, float]

    @property
    def stiffness(self) -> float:
        """Force over the mean of the two strains, N/mm; infinite where nothing is strained."""
        mean = 0.5 * (self.strain[0] + self.strain[1])
        return self.force / mean if mean > 0 else float("inf")


def apex_of(field: DisplacementField, radius: float) -> Apex:
    """The apex of a field about the rim's centre; radius of the rim in mm.

    Raises
    ------
    InputError : too few points about the centre.
    """
    before = field.frame.points
    after = before + field.displacement
    try:
        shape = apex_shape(field.points, np.hstack([after, before]), radius)
    except InputError as error:
        raise InputError(field.path, error.field, error.problem) from None
    left = after[shape.near, 2] - shape.terms @ shape.coefficients[:, 2]
    tangents = np.stack([shape.at_centre(1, 0), shape.at_centre(0, 1)])
    metric = tangents[:, :3] @ tangents[:, :3].T
    first = tangents[:, 3:] @ tangents[:, 3:].T
    normal = np.cross(tangents[0, :3], tangents[1, :3])
    normal /= np.linalg.norm(normal)
    second = np.array(
        [
            [shape.at_centre(2, 0)[:3] @ normal, shape.at_centre(1, 1)[:3] @ normal],
            [shape.at_centre(1, 1)[:3] @ normal, shape.at_centre(0, 2)[:3] @ normal],
        ]
    )
    curvature = -float(np.trace(np.linalg.solve(metric, second)))
    variance = float(left @ left) / (len(left) - len(POWERS))
    inverse = np.linalg.pinv(shape.terms.T @ shape.terms)
    both = [POWERS.index((2, 0)), POWERS.index((0, 2))]
    spread = float(np.sqrt(variance * inverse[np.ix_(both, both)].sum())) * 2 / radius**2
    stretch = np.sqrt(np.diag(metric) / np.diag(first))
    strain = float(np.log(stretch[0])), float(np.log(stretch[1]))
    centre = shape.at_centre()
    height = float(centre[2] - centre[5])
    force = doubt = float("inf")
    if curvature > 0:
        force = field.pressure / curvature
        doubt = force * spread / curvature
    return Apex(field.pressure, height, curvature, force, doubt, strain)
