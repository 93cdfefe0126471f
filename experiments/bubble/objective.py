"""Residuals of a bubble test (Eqs 4.5-4.8).

A block is one displacement direction at one pressure: (model - measured) / (largest measured
|value| * sqrt(n)). Its norm is e_x/max(P_x) of Eq. 4.8, e is the sum of the norms. With plain
millimetres the scale is one and e is a sum of RMS errors in mm."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
import scipy
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from ...errors import InputError
from ...inference.comparison import NoiseIs
from ...meshes.mesh import FacetReading, Mesh, SmoothReading
from ...readers.fields import DisplacementField, DisplacementSurface
from ...solvers.base import Array, History
from .test import BubbleTest

Unknowns = Mapping[str, float]
#: Nuisance of a measured field: a rigid displacement, mm.
OFFSETS = ("offset_x", "offset_y", "offset_z")
#: What a registration leaves open: a tilt of the plane about x and y (degrees), and how far the
#: true places lie along x and y from those that are given (mm).
PLACED = ("tilt_x", "tilt_y", "shift_x", "shift_y")
#: mm, noise of a displacement by a good image correlation.
CORRELATION = 0.05


def amounts_of(names: Sequence[str], nuisance: Unknowns | None) -> Array:
    """Return the amounts of `OFFSETS` or `PLACED`; zero where one is no unknown."""
    return np.array([(nuisance or {}).get(name, 0.0) for name in names])


@dataclass(frozen=True, eq=False)
class FieldTarget:
    """The displacement field that was measured at one pressure.
    displacement (n, 3) mm; `sample` (n, nodes) takes model nodes to the places (None: the nodes).
    places : (n,) numbers, equal for a place in all targets, for a constant field. frame : of the
    model's history, the target's number unless given; since : the frame from which displacements
    are counted, None: the reference state. at_rest : (n, 2) mm before the test."""

    pressure: float
    displacement: Array
    sample: scipy.sparse.csr_matrix | None = None
    places: NDArray[np.intp] | None = None
    frame: int | None = None
    since: int | None = None
    at_rest: Array | None = None

    def at(self, nodal: Array) -> Array:
        """Return the model's displacement (nodes, ...) at the places, (n, ...)."""
        if self.sample is None:
            return nodal
        return np.asarray(self.sample @ nodal.reshape(len(nodal), -1)).reshape(-1, *nodal.shape[1:])

    def only(self, which: NDArray[Any]) -> FieldTarget:
        """Return the target of some of its places."""
        columns = self.sample, self.places, self.at_rest
        sample, places, rest = (None if own is None else own[which] for own in columns)
        moved = self.displacement[which]
        return replace(self, displacement=moved, sample=sample, places=places, at_rest=rest)

    def of(self, frames: Array, number: int) -> Array:
        """Return that of frames (frames, nodes, ...), as target `number` of its objective."""
        here = frames[number if self.frame is None else self.frame]
        return self.at(here if self.since is None else here - frames[self.since])


class FieldObjective:
    """Residual blocks for displacement fields at several pressures, x, y, z at each.
    targets : one a reported pressure, in the order of the model's frames. weight : of every block
    in e. noise : mm of one displacement, at least. constant : directions (0 to 2) in which at every
    place the weighted mean over the pressures of model less measured is projected out. Raises
    InputError for a direction without any displacement to normalise by."""

    unit, columns = "mm", 3

    def __init__(
        self,
        targets: Sequence[FieldTarget],
        normalise: Literal["e", "mm"] = "e",
        weight: float = 1.0,
        noise: float | None = None,
        constant: Sequence[int] = (),
    ) -> None:
        self.least_noise = CORRELATION if noise is None else noise
        self.noise_is: NoiseIs = "assumed" if noise is None else "given"
        self.targets, self.constant = tuple(targets), tuple(constant)
        self.scales = []
        for target in self.targets:
            largest = np.abs(target.displacement).max(axis=0)
            if normalise == "e" and not (largest > 0).all():
                zero = f"d{'xyz'[int(np.argmin(largest))]} is zero everywhere"
                problem = f"{zero}: nothing to match (is a column mapped wrongly?)"
                raise InputError(None, f"data at {target.pressure * 1e3:g} kPa", problem)
            count = np.sqrt(len(target.displacement))
            self.scales.append(count / weight * (largest if normalise == "e" else np.ones(3)))
        self.sizes = tuple(len(t.displacement) for t in self.targets for _ in "xyz")
        self.scale = np.repeat(np.concatenate(self.scales), self.sizes)

    @property
    def data(self) -> tuple[Array, ...]:
        places = [t.sample.data for t in self.targets if t.sample is not None]
        return (*(t.displacement for t in self.targets), *places)

    @property
    def measured(self) -> Array:
        """Return the measured displacements as the residuals are arranged, (m,) mm."""
        return np.concatenate([target.displacement.T.reshape(-1) for target in self.targets])

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return (n, 2) mm at rest of every block's values; empty where they are not known."""
        known = [target.at_rest for target in self.targets if target.at_rest is not None]
        return tuple(p for p in known for _ in "xyz") if len(known) == len(self.targets) else ()

    def of_points(self, values: Array) -> Array:
        """Return (m,) for each residual, of values for each place, frame by frame."""
        ends = np.cumsum([len(target.displacement) for target in self.targets])[:-1]
        return np.concatenate([np.tile(own, 3) for own in np.split(values, ends)])

    def shifted(self, external: History, surrogate: History) -> FieldObjective:
        objective = copy.copy(self)
        by = external.displacement - surrogate.displacement
        objective.targets = tuple(
            replace(target, displacement=target.displacement - target.of(by, k))
            for k, target in enumerate(self.targets)
        )
        return objective

    def residual(self, history: History, nuisance: Unknowns | None = None) -> Array:
        """Return the blocks laid end to end, (m,); the model is moved by the offsets."""
        every = zip(self.differences(history.displacement, nuisance), self.scales, strict=True)
        return np.concatenate([(part / scale).T.reshape(-1) for part, scale in every])

    def modelled(self, displacement: Array, nuisance: Unknowns | None = None) -> list[Array]:
        """Return (n, 3) mm of each target from the model's (frames, nodes, 3), offset included."""
        shift = amounts_of(OFFSETS, nuisance)
        moved = [target.of(displacement, k) + shift for k, target in enumerate(self.targets)]
        amounts = amounts_of(PLACED, nuisance)
        if not amounts.any():
            return moved
        return [m + placed for m, placed in zip(moved, self._placed(amounts), strict=True)]

    def _placed(self, amounts: Array) -> list[Array]:
        """Return (n, 3) mm of each target that amounts (4,) of `PLACED` add to model less measured.
        The measured field is turned into the model's frame. Where the model is read at a given
        place it moves less than at the true one by what the measured field grows up to there."""
        turned = _tilted(amounts[:2])[0]
        found = []
        for target, grown in zip(self.targets, self._grown(amounts[2:]), strict=True):
            found.append((grown - target.displacement) @ turned + target.displacement)
        return found

    def _grown(self, shift: Array) -> list[Array]:
        """Return (n, 3) mm, what each smooth measured field changes by over a shift (2,) mm."""
        return [
            (_shapes(rest / size, len(amplitude)) - _shapes((rest - shift) / size, len(amplitude)))
            @ amplitude
            for rest, size, amplitude in self._smooth
        ]

    def _placed_by(self, amounts: Array) -> list[Array]:
        """Return derivatives (n, 3, 4) mm of `_placed` by the amounts."""
        turned, by_tilts = _tilted(amounts[:2])
        found = []
        every = zip(self.targets, self._smooth, self._grown(amounts[2:]), strict=True)
        for target, (rest, size, amplitude), grown in every:
            columns = [(grown - target.displacement) @ by for by in by_tilts]
            slopes = _slopes_of(rest - amounts[2:], size, amplitude)
            found.append(np.stack([*columns, *(one @ turned for one in slopes)], axis=-1))
        return found

    @cached_property
    def _smooth(self) -> list[tuple[Array, float, Array]]:
        """Return places (n, 2) mm, their size, amplitudes of `_shapes`, of each measured field."""
        known = [(t.at_rest, t.displacement) for t in self.targets if t.at_rest is not None]
        return [(rest, *_smoothed(rest, moved)) for rest, moved in known]

    def differences(self, displacement: Array, nuisance: Unknowns | None = None) -> list[Array]:
        """Return model less measured (n, 3) mm of each target, without a constant field."""
        return self._varying(self._off(displacement, nuisance))

    def constant_field(self, displacement: Array, nuisance: Unknowns | None = None) -> Array:
        """Return (places, 3) mm, measured less model as far as it is the same at all pressures."""
        return -self._mean(self._off(displacement, nuisance))

    def _off(self, displacement: Array, nuisance: Unknowns | None) -> list[Array]:
        modelled = self.modelled(displacement, nuisance)
        return [m - t.displacement for m, t in zip(modelled, self.targets, strict=True)]

    def _varying(self, parts: list[Array]) -> list[Array]:
        """Return values (n, 3, ...) of each target less their mean over the pressures by place."""
        if not self.constant:
            return parts
        mean = self._mean(parts)
        return [part - mean[t.places] for part, t in zip(parts, self.targets, strict=True)]

    def _mean(self, parts: list[Array]) -> Array:
        """Return (places, 3, ...), weighted as the squared residuals; zero if not constant."""
        numbers = [t.places for t in self.targets if t.places is not None]
        count = 1 + max(int(own.max()) for own in numbers)
        total = np.zeros((count, *parts[0].shape[1:]))
        weights = np.zeros((count, 3))
        for own, part, scale in zip(numbers, parts, self.scales, strict=True):
            weight = scale**-2.0
            # Unbuffered: a file may have a place twice.
            np.add.at(total, own, part * weight.reshape(3, *[1] * (part.ndim - 2)))
            np.add.at(weights, own, weight)
        weights[weights == 0] = 1.0
        mean = total / weights.reshape(*weights.shape, *[1] * (total.ndim - 2))
        mean[:, sorted(set(range(3)) - set(self.constant))] = 0.0
        return np.asarray(mean)

    def jacobian(self, history: History, slope: Array) -> Array:
        return self._columns([target.of(slope, k) for k, target in enumerate(self.targets)])

    def _columns(self, parts: list[Array]) -> Array:
        """Return (m, k) of changes (n, 3, k) of the model's displacement of each target."""
        every = zip(self._varying(parts), self.scales, strict=True)
        return np.concatenate(
            [(p / s[:, None]).swapaxes(0, 1).reshape(-1, p.shape[-1]) for p, s in every]
        )

    def causes(self, history: History) -> dict[str, Array]:
        """Return (m, k) a cause, by its words, slopes of the residual by its amounts.
        Of the model's own field u(x) at pressure p: a place is off by d where u is read at x + d; a
        larger disk has R u(x / R, R p); turned axes turn places and u, a tilted plane u alone."""
        pressures = [0.0, *(target.pressure for target in self.targets)]
        if not self.positions or len(pressures) < 3 or not (np.diff(pressures) > 0).all():
            return {}
        moved = history.displacement
        frames = [k if t.frame is None else t.frame for k, t in enumerate(self.targets)]
        # By the logarithm of the pressure: a flat sheet rises with a power of it.
        logs = np.log(pressures[1:])
        by_pressure = np.zeros_like(moved)
        order: Literal[1, 2] = 2 if len(logs) > 2 else 1
        by_pressure[frames] = np.gradient(moved[frames], logs, axis=0, edge_order=order)
        parts: dict[str, list[Array]] = {}
        for k, target in enumerate(self.targets):
            assert target.at_rest is not None
            x, y = target.at_rest.T
            u = target.of(moved, k)
            by_p = target.of(by_pressure, k) / target.pressure
            by_x, by_y = _slopes_of(target.at_rest, *_smoothed(target.at_rest, u))
            (dx, dy, dz), none = u.T, np.zeros(len(u))
            degree = np.pi / 180
            p = target.pressure
            turned = np.stack([-dy, dx, none], axis=1) + y[:, None] * by_x - x[:, None] * by_y
            larger = u - x[:, None] * by_x - y[:, None] * by_y + p * by_p
            tilts = np.stack([none, -dz, dy], axis=1), np.stack([dz, none, -dx], axis=1)
            for words, columns in {
                "a true radius {:+.1%} away (compare it with the clamp)": [larger],
                "a centre at {:+.2g}, {:+.2g} mm (registration.centre)": [-by_x, -by_y],
                "a tilt of {:+.2g}, {:+.2g} degrees (registration.plane)": [
                    degree * one for one in tilts
                ],
                "axes turned by {:+.2g} degrees (registration.warp)": [degree * turned],
                "pressures off by {:+.2g} kPa (nuisance.pressure_offset)": [-1e-3 * by_p],
            }.items():
                parts.setdefault(words, []).append(np.stack(columns, axis=-1))
        return {words: self._columns(own) for words, own in parts.items()}

    def nuisance_columns(self, names: Sequence[str], nuisance: Unknowns) -> Array:
        """Return (m, names), the slope of the residual by `OFFSETS` (mm) and `PLACED`."""
        every = (*OFFSETS, *PLACED)
        parts = [np.tile(np.eye(3), (len(t.displacement), 1, 1)) for t in self.targets]
        if any(name in PLACED for name in names):
            placed = self._placed_by(amounts_of(PLACED, nuisance))
            parts = [np.concatenate(both, -1) for both in zip(parts, placed, strict=True)]
        return self._columns(parts)[:, [every.index(name) for name in names]]

    def mean_absolute(self, displacement: Array, nuisance: Unknowns | None = None) -> float:
        """Return the mean of |dx| + |dy| + |dz| differences over all places and pressures, mm."""
        parts = self.differences(displacement, nuisance)
        return float(np.concatenate([np.abs(d).sum(axis=1) for d in parts]).mean())


#: Largest degree of the polynomials in x and y whose slopes are those of a field, points that each
#: of their terms needs, and a small step.
DEGREE, EACH, SMALL = 8, 3, 1e-4


def _shapes(at: Array, terms: int) -> Array:
    x, y = (legvander(one, math.isqrt(terms) - 1) for one in at.T)
    return np.asarray((x[:, :, None] * y[:, None]).reshape(len(at), -1))


def _smoothed(places: Array, values: Array) -> tuple[float, Array]:
    """Return the size (mm) of the places and the amplitudes of `_shapes` through the values."""
    size = float(np.abs(places).max())
    degree = min(DEGREE, math.isqrt(len(places) // EACH) - 1)
    shapes = _shapes(places / size, (max(degree, 1) + 1) ** 2)
    return size, np.asarray(np.linalg.lstsq(shapes, values, rcond=1e-6)[0])


def _slopes_of(places: Array, size: float, amplitude: Array) -> tuple[Array, Array]:
    """Return slopes (n, 3) at places (n, 2) mm by x and by y, of what `_smoothed` returns."""
    at = places / size
    by_x, by_y = (
        (_shapes(at + one, len(amplitude)) - _shapes(at - one, len(amplitude)))
        @ amplitude
        / (2 * SMALL * size)
        for one in SMALL * np.eye(2)
    )
    return by_x, by_y


def _tilted(degrees: Array) -> tuple[Array, tuple[Array, Array]]:
    """Return the rotation (3, 3) about y, then x, and its derivatives by (x, y), per degree."""
    (c, b), (s, a) = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    about_y = np.array([[b, 0, a], [0, 1, 0], [-a, 0, b]])
    by_x = np.array([[0, 0, 0], [0, -s, -c], [0, c, -s]])
    by_y = np.array([[-a, 0, b], [0, 0, 0], [-b, 0, -a]])
    degree = np.pi / 180
    return about_x @ about_y, (degree * by_x @ about_y, degree * about_x @ by_y)


#: Of the points on the disk, and of its radius covered: less is taken for a wrong unit.
LEAST_SHARE = 0.1


def folded(field: DisplacementField) -> DisplacementField:
    """Fold a full field onto the quarter x, y >= 0."""
    sign = np.where(field.points < 0, -1.0, 1.0)
    moved = field.displacement.copy()
    moved[:, :2] *= sign
    return replace(field, points=np.abs(field.points), displacement=moved)


def mirrored(field: DisplacementField) -> DisplacementField:
    """Mirror a quarter's field to the full disk."""
    if (field.points < -1e-9).any():
        return field
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    xy = np.concatenate([field.points * (sx, sy) for sx, sy in signs])
    u = np.concatenate([field.displacement * (sx, sy, 1) for sx, sy in signs])
    _, once = np.unique(np.round(xy, 6), axis=0, return_index=True)
    z, sigma = (None if own is None else np.tile(own, 4)[once] for own in (field.z, field.sigma))
    return replace(field, points=xy[once], displacement=u[once], z=z, sigma=sigma)


def at_nodes(
    sources: Sequence[DisplacementField | DisplacementSurface], mesh: Mesh
) -> list[FieldTarget]:
    """Return targets on the model's nodes, from computed fields or polynomial surfaces."""
    nodes = mesh.points[:, :2]
    targets = []
    for source in sources:
        if isinstance(source, DisplacementSurface):
            moved = source.evaluate(nodes)
        else:
            moved = _interpolated(source, mesh)
        targets.append(FieldTarget(source.pressure, moved, at_rest=nodes))
    return targets


def _interpolated(field: DisplacementField, mesh: Mesh) -> Array:
    """Return computed displacements at the model's nodes; exact when the meshes are the same."""
    nodes = mesh.points[:, :2]
    if nodes.shape == field.points.shape and np.allclose(nodes, field.points, atol=1e-9):
        return field.displacement
    # C1 interpolation: the data mesh is curved between its nodes, linear would cut corners.
    whole = mirrored(field)
    between = scipy.interpolate.CloughTocher2DInterpolator(whole.points, whole.displacement)(nodes)
    # Chords of the data's rim can leave a rim node of ours outside: it does not move anyway.
    outside = ~np.isfinite(between).all(axis=1)
    between[outside] = 0.0
    between[mesh.node_sets["rim"]] = 0.0
    return np.asarray(between)


def reading_of(test: BubbleTest, mesh: Mesh) -> SmoothReading | FacetReading:
    """Return how displacements are read at points: as the camera does, if that is known."""
    reading = SmoothReading.of(mesh)
    return reading if test.facet is None else FacetReading(reading, test.facet)


def at_points(
    test: BubbleTest, fields: Sequence[DisplacementField], mesh: Mesh
) -> tuple[list[FieldTarget], int]:
    """Return targets at points on the disk, and how many lie beyond; raises InputError."""
    targets = []
    outside = 0
    reading = reading_of(test, mesh)
    before = None
    for field in fields:
        # Frames of one camera mostly have the same places.
        if before is None or not np.array_equal(before, field.points):
            sample, inside = reading.matrix(field.points)
            before = field.points
        outside += int((~inside).sum())
        rest = field.points[inside]
        moved = field.displacement[inside]
        targets.append(FieldTarget(field.pressure, moved, sample, at_rest=rest))
        reach = float(np.abs(field.points).max())
        if inside.mean() < LEAST_SHARE:
            where = f"{int(inside.sum())} of {len(inside)} points lie on the disk of"
        elif reach < LEAST_SHARE * test.outline.major:
            where = f"all points lie within {reach:.3g} mm of the centre of a disk of"
        else:
            continue
        at = f"{test.place.at}, data at {field.pressure * 1e3:g} kPa"
        problem = (
            f"{where} {test.outline.words}: are the length unit and the columns x and y right?"
        )
        raise InputError(test.place.path, at, problem)
    return targets, outside


#: Decimals of a mm to which two frames give the same reference place.
DECIMALS = 3
#: Of a frame's places, that the frame it is counted from has to have, too.
LEAST_SHARE_RELATIVE = 0.5
#: In-plane displacements of an inflated sheet go with the square of its height, and this with the
#: cube root of the pressure.
POWER = 2.0 / 3.0


def at_rest(fields: Sequence[DisplacementField], since: int) -> list[DisplacementField]:
    """Return fields with places in the sheet without load, where they are those of frame `since`.
    Nothing moves in a frame that the others are counted from. The next one shows how far its places
    have moved already: in-plane displacements grow with p^(2/3). Other fields stay as they are."""
    first = fields[since]
    if first.displacement.any():
        return list(fields)
    other = fields[since + 1 if since + 1 < len(fields) else since - 1]
    powers = [field.pressure**POWER for field in (first, other)]
    moved = other.displacement[:, :2] * (powers[0] / (powers[1] - powers[0]))
    tree = scipy.spatial.cKDTree(other.points)
    return [replace(f, points=f.points - moved[tree.query(f.points)[1]]) for f in fields]


def with_places(targets: Sequence[FieldTarget], nodes: Array) -> list[FieldTarget]:
    """Number the places, equal for the same place in all targets; nodes (nodes, 2) mm."""
    places = [np.round(target.at(nodes), DECIMALS) + 0.0 for target in targets]
    _, numbers = np.unique(np.concatenate(places), axis=0, return_inverse=True)
    ends = np.cumsum([len(p) for p in places])[:-1]
    return [
        replace(target, places=own)
        for target, own in zip(targets, np.split(numbers.reshape(-1), ends), strict=True)
    ]


def counted_from(targets: Sequence[FieldTarget], since: int) -> list[FieldTarget]:
    """Return targets, with places, less that of frame `since`; InputError for too few in common."""
    origin = targets[since]
    relative = []
    for k, target in enumerate(targets):
        if k == since:
            continue
        assert target.places is not None and origin.places is not None
        _, mine, its = np.intersect1d(target.places, origin.places, return_indices=True)
        if len(mine) < LEAST_SHARE_RELATIVE * len(target.places):
            problem = (
                f"the frames at {1e3 * target.pressure:g} and {1e3 * origin.pressure:g} kPa share "
                f"{len(mine)} of {len(target.places)} points; expected the same points in all"
            )
            raise InputError(None, "sheet.from_pressure", problem)
        moved = target.displacement[mine] - origin.displacement[its]
        relative.append(replace(target.only(mine), displacement=moved, frame=k, since=since))
    return relative
