"""The displacement fields that the model of a bubble is to match, at the places of the data.

Also here: transfer of targets and of solutions from one mesh to another.

A "place" is a position of the data at which a displacement was measured. Frames are numbered from
0 in the order of the test's pressures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.bubble_model import BubbleModel
from ...meshes.mesh import Mesh
from ...meshes.sampling import FacetReading, SmoothReading
from ...readers.fields import DisplacementField, DisplacementSurface
from ...solvers.base import Array
from . import BubbleTest
from .field_shape import SmoothField, mirrored


@dataclass(frozen=True, eq=False)
class EstimatedPlaces:
    """Places at rest that were estimated from those in a reference picture under pressure.

    Attributes
    ----------
    motion : (n, 2) array, mm
        Motion up to the reference picture by which the places were estimated.
    slopes : (n, 3, 2) array
        Derivatives of the measured displacements by x and y.
    """

    motion: Array
    slopes: Array

    def subset(self, rows: NDArray[Any]) -> EstimatedPlaces:
        """Return some of the places only, by their rows (k,) or a mask (n,)."""
        return EstimatedPlaces(self.motion[rows], self.slopes[rows])

    def growth_by(self, motion: Array) -> Array:
        """Return the changes (n, 3, ...) of the displacements over in-plane motions.

        Parameters
        ----------
        motion : (n, 2, ...) array, mm
            How far each place moves.
        """
        return np.einsum("nij,nj...->ni...", self.slopes, motion)


@dataclass(frozen=True, eq=False)
class FieldTarget:
    """The displacement field at one pressure, measured or computed, that the model is to match.

    Attributes
    ----------
    pressure : float, MPa
    displacement : (n, 3) array, mm
        Displacements of the data at the n places.
    sample : (n, nodes) sparse matrix or None
        Interpolates values at the model's nodes to the places; None where the places are the nodes.
    place_numbers : (n,) array of int or None
        Numbers that are equal for the same place in all targets; needed for a constant field.
    frame : int or None
        Number of the frame of the model's history to compare with; None for the number of the
        target in its objective.
    reference_frame : int or None
        Number of the frame from which displacements are counted, None for the reference state.
    positions : (n, 2) array, mm, or None
        Positions of the places before the test, where known.
    estimated_places : EstimatedPlaces or None
        How positions were estimated; None where they were measured.
    """

    pressure: float
    displacement: Array
    sample: scipy.sparse.csr_matrix | None = None
    place_numbers: NDArray[np.intp] | None = None
    frame: int | None = None
    reference_frame: int | None = None
    positions: Array | None = None
    estimated_places: EstimatedPlaces | None = None

    def at_places(self, nodal: Array) -> Array:
        """Return values at the model's nodes, interpolated to the places (n, ...).

        Parameters
        ----------
        nodal : (nodes, ...) array
            Values of any unit.
        """
        if self.sample is None:
            return nodal
        columns = nodal.reshape(len(nodal), -1)
        sampled = self.sample @ columns
        return sampled.reshape(-1, *nodal.shape[1:])

    def subset(self, rows: NDArray[Any]) -> FieldTarget:
        """Return the target with some of its places only, by their rows (k,) or a mask (n,)."""
        places = self.estimated_places
        return replace(
            self,
            displacement=self.displacement[rows],
            sample=None if self.sample is None else self.sample[rows],
            place_numbers=None if self.place_numbers is None else self.place_numbers[rows],
            positions=None if self.positions is None else self.positions[rows],
            estimated_places=None if places is None else places.subset(rows),
        )

    def modelled_field(self, frames: Array, number: int) -> Array:
        """Return the model's displacements (n, 3), mm, at the places by the model's own motion.

        Parameters
        ----------
        frames : (frames, nodes, 3) array, mm
            The model's displacements at its nodes.
        number : int
            Number of the target, which is that of its frame unless it names one.
        """
        displacement = self.modelled_displacement(frames, number)
        places = self.estimated_places
        return displacement if places is None else displacement + places.growth_by(places.motion)

    def modelled_displacement(self, frames: Array, number: int) -> Array:
        """Return the model's displacements that belong to this target, at its places.

        It is linear in them: the motion by which places were estimated is left out, see
        `modelled_field`.

        Parameters
        ----------
        frames : (frames, nodes, ...) array
            Displacements of the model's history, or their derivatives.
        number : int
            Number of this target in its objective.

        Returns
        -------
        (n, ...) array
        """
        at_places = self.at_places(self.nodal_displacement(frames, number))
        if self.estimated_places is not None:
            motion = self.at_places(frames[self.reference_frame])[:, :2]
            at_places = at_places - self.estimated_places.growth_by(motion)
        return at_places

    def nodal_displacement(self, frames: Array, number: int) -> Array:
        """Return the displacements (nodes, ...) of the model's nodes, counted as the target's are.

        Arguments are those of `modelled_displacement`.
        """
        displacement = frames[number if self.frame is None else self.frame]
        if self.reference_frame is not None:
            displacement = displacement - frames[self.reference_frame]
        return displacement


def at_nodes(
    sources: Sequence[DisplacementField | DisplacementSurface], mesh: Mesh
) -> list[FieldTarget]:
    """Return targets whose places are the model's nodes, from computed fields or polynomials."""
    nodes = mesh.points[:, :2]
    targets = []
    for source in sources:
        if isinstance(source, DisplacementSurface):
            displacement = source.evaluate(nodes)
        else:
            displacement = _interpolated(source, mesh)
        targets.append(FieldTarget(source.pressure, displacement, positions=nodes))
    return targets


def _interpolated(field: DisplacementField, mesh: Mesh) -> Array:
    """Return computed displacements interpolated to the model's nodes, (nodes, 3) mm.

    They are exact where the meshes are the same.
    """
    nodes = mesh.points[:, :2]
    if nodes.shape == field.points.shape and np.allclose(nodes, field.points, atol=1e-9):
        return field.displacement
    # C1 interpolation: the data mesh is curved between its nodes, linear would cut corners.
    full = mirrored(field)
    interpolator = scipy.interpolate.CloughTocher2DInterpolator(full.points, full.displacement)
    displacement = interpolator(nodes)
    # Chords of the data's rim can leave a rim node of ours outside: it does not move anyway.
    displacement[~np.isfinite(displacement).all(axis=1)] = 0.0
    displacement[mesh.node_sets["rim"]] = 0.0
    return np.asarray(displacement)


def reading_of(test: BubbleTest, mesh: Mesh) -> SmoothReading | FacetReading:
    """Return the interpolation of the model's displacements to points.

    It filters displacements as the image correlation does, where its facet is known.
    """
    reading = SmoothReading.of(mesh)
    return reading if test.facet is None else FacetReading(reading, test.facet)


def at_points(
    test: BubbleTest, fields: Sequence[DisplacementField], mesh: Mesh
) -> tuple[list[FieldTarget], int]:
    """Return targets whose places are the measured points on the disk.

    Parameters
    ----------
    test : BubbleTest
    fields : sequence of DisplacementField
        Measured fields, one for each frame.
    mesh : Mesh
        Mesh of the model.

    Returns
    -------
    targets : list of FieldTarget
    points_beyond : int
        Number of points, of all fields together, that lie beyond the rim and are left out.

    Raises
    ------
    InputError
        Hardly any point lies on the disk, or all lie close to its centre, as in a wrong unit.
    """
    targets = []
    points_beyond = 0
    reading = reading_of(test, mesh)
    previous = None
    for field in fields:
        # Frames of one camera mostly have the same places.
        if previous is None or not np.array_equal(previous, field.points):
            sample, is_on_disk = reading.matrix(field.points)
            previous = field.points
        points_beyond += int((~is_on_disk).sum())
        positions = field.points[is_on_disk]
        displacement = field.displacement[is_on_disk]
        targets.append(FieldTarget(field.pressure, displacement, sample, positions=positions))
        _check_on_disk(test, field, is_on_disk)
    return targets, points_beyond


def _check_on_disk(
    test: BubbleTest,
    field: DisplacementField,
    is_on_disk: NDArray[np.bool_],
    min_share: float = 0.1,
) -> None:
    """Refuse a field that seems to be in a wrong unit of length.

    That is one with less than `min_share` of its points on the disk, or whose points all lie within
    `min_share` of the radius from the centre.

    Parameters
    ----------
    is_on_disk : (n,) array of bool
        Which points of the field lie on the disk.
    """
    reach = float(np.abs(field.points).max())
    if is_on_disk.mean() < min_share:
        location = f"{int(is_on_disk.sum())} of {len(is_on_disk)} points lie on the disk of"
    elif reach < min_share * test.outline.major:
        location = f"all points lie within {reach:.3g} mm of the centre of a disk of"
    else:
        return
    problem = f"{location} {test.outline.words}: are the length unit and the columns x and y right?"
    data = f"{test.place.at}, data at {field.pressure * 1e3:g} kPa"
    raise InputError(test.place.path, data, problem)


def with_unloaded_positions(
    fields: Sequence[DisplacementField], reference_frame: int
) -> list[DisplacementField]:
    """Return fields with estimated positions of the points in the unloaded sheet.

    Where the image correlation took the loaded frame `reference_frame` as its reference, positions
    are those at its pressure, and its displacements are zero. How far points had moved until then
    follows from the next frame (`motion_until`). Where the displacements of that frame are not
    zero, fields are returned as they are.

    Parameters
    ----------
    fields : sequence of DisplacementField
    reference_frame : int
        Number of the frame from which displacements are counted.
    """
    origin = fields[reference_frame]
    if origin.displacement.any():
        return list(fields)
    neighbour = fields[_neighbour_of(reference_frame, len(fields))]
    motion = motion_until(
        origin.pressure,
        neighbour.pressure,
        neighbour.points,
        neighbour.displacement,
    )
    tree = scipy.spatial.cKDTree(neighbour.points)
    return [
        replace(field, points=field.points - motion[tree.query(field.points)[1]])
        for field in fields
    ]


def _neighbour_of(frame: int, count: int) -> int:
    """Return the number of the next frame, or of the previous one of the last."""
    return frame - 1 if frame + 1 == count else frame + 1


def motion_until(
    pressure: float,
    neighbour_pressure: float,
    positions: Array,
    displacement: Array,
    *,
    exponent: float = 2.0 / 3.0,
) -> Array:
    """Estimate the smooth in-plane motion (n, 2), mm, of points up to a pressure.

    In-plane displacements of an inflated sheet grow with the square of its height, and this with
    the cube root of the pressure.

    Parameters
    ----------
    pressure, neighbour_pressure : float, MPa
        Pressures of the frame from which displacements are counted, and of a neighbouring one.
    positions : (n, 2) array, mm
        Positions of the points.
    displacement : (n, 3) array, mm
        Their displacements between the two frames.
    exponent : float
        In-plane displacements are taken to be proportional to pressure**exponent.
    """
    power = pressure**exponent
    share = power / (neighbour_pressure**exponent - power)
    return share * SmoothField.through(positions, displacement[:, :2]).values


def with_place_numbers(
    targets: Sequence[FieldTarget], nodes: Array, *, decimals: int = 3
) -> list[FieldTarget]:
    """Return targets whose places have numbers, equal for the same place in all of them.

    Parameters
    ----------
    targets : sequence of FieldTarget
    nodes : (nodes, 2) array, mm
        Positions of the model's nodes.
    decimals : int
        Places that are equal when rounded to so many decimals of a mm are the same.
    """
    places = [np.round(target.at_places(nodes), decimals) + 0.0 for target in targets]
    _, numbers = np.unique(np.concatenate(places), axis=0, return_inverse=True)
    ends = np.cumsum([len(places_of_target) for places_of_target in places])[:-1]
    return [
        replace(target, place_numbers=numbers_of_target)
        for target, numbers_of_target in zip(
            targets, np.split(numbers.reshape(-1), ends), strict=True
        )
    ]


def counted_from(
    targets: Sequence[FieldTarget], reference_frame: int, *, min_share: float = 0.5
) -> list[FieldTarget]:
    """Return targets whose displacements are counted from those of one frame, which is left out.

    Parameters
    ----------
    targets : sequence of FieldTarget
        Targets with place numbers.
    reference_frame : int
        Number of the frame from which displacements are counted.
    min_share : float
        Smallest share of the places of each frame that frame `reference_frame` must have, too.

    Raises
    ------
    InputError
        Too few places are in both frames.
    """
    origin = targets[reference_frame]
    relative = []
    for k, target in enumerate(targets):
        if k == reference_frame:
            continue
        assert target.place_numbers is not None and origin.place_numbers is not None
        _, rows, origin_rows = np.intersect1d(
            target.place_numbers, origin.place_numbers, return_indices=True
        )
        count = len(target.place_numbers)
        if len(rows) < min_share * count:
            problem = (
                f"the frames at {1e3 * target.pressure:g} and {1e3 * origin.pressure:g} kPa share "
                f"{len(rows)} of {count} points; expected the same points in all"
            )
            raise InputError(None, "sheet.from_pressure", problem)
        displacement = target.displacement[rows] - origin.displacement[origin_rows]
        subset = target.subset(rows)
        relative.append(
            replace(subset, displacement=displacement, frame=k, reference_frame=reference_frame)
        )
    if origin.displacement.any():
        return relative
    return _with_estimated_places(
        relative, origin.pressure, targets[_neighbour_of(reference_frame, len(targets))]
    )


def _with_estimated_places(
    targets: Sequence[FieldTarget], pressure: float, neighbour: FieldTarget
) -> list[FieldTarget]:
    """Return targets that know how `with_unloaded_positions` has estimated their places.

    Parameters
    ----------
    pressure : float, MPa
        Of the reference picture.
    neighbour : FieldTarget
        Target of the frame next to it.
    """
    if neighbour.positions is None:
        return list(targets)
    motion = motion_until(
        pressure,
        neighbour.pressure,
        neighbour.positions,
        neighbour.displacement,
    )
    tree = scipy.spatial.cKDTree(neighbour.positions)
    with_places = []
    for target in targets:
        assert target.positions is not None
        motion_of_target = motion[tree.query(target.positions)[1]]
        # Over the places in the picture: the places at rest are what the model corrects.
        in_picture = target.positions + motion_of_target
        slopes = SmoothField.through(in_picture, target.displacement).slopes()
        places = EstimatedPlaces(motion_of_target, np.stack(slopes, axis=-1))
        with_places.append(replace(target, estimated_places=places))
    return with_places


def resampled(
    targets: tuple[FieldTarget, ...], mesh: Mesh, reading: SmoothReading | FacetReading
) -> tuple[FieldTarget, ...]:
    """Return targets at the same places, whose samples read values at the nodes of another mesh.

    Parameters
    ----------
    targets : tuple of FieldTarget
    mesh : Mesh
        The mesh that the targets read.
    reading : SmoothReading or FacetReading
        Interpolation on the other mesh.

    Raises
    ------
    InputError
        Places lie outside of the other mesh.
    """
    resampled_targets = []
    previous = None
    sample = None
    for target in targets:
        positions = (
            target.at_places(mesh.points)[:, :2] if target.positions is None else target.positions
        )
        positions = np.ascontiguousarray(positions)
        # Frames of one camera mostly have the same places.
        if previous is None or not np.array_equal(previous, positions):
            previous = positions
            sample = sample_on_mesh(reading, positions)
        resampled_targets.append(replace(target, sample=sample))
    return tuple(resampled_targets)


def prolonged(model: BubbleModel, finer: BubbleModel, path: Array) -> Array:
    """Return initial displacements for each increment of a finer model from a coarser solution.

    Displacements are interpolated linearly in the cube root of the pressure, and extrapolated in
    the same way below the first pressure: a slack sheet has moved far there, and has folds that a
    finer mesh does not find when it starts from a higher pressure.

    Parameters
    ----------
    model, finer : BubbleModel
    path : (increments, nodes, 3) array, mm
        Displacements of the coarser model.

    Returns
    -------
    (increments, nodes, 3) array, mm
        Displacements of the finer model.
    """
    sample = sample_on_mesh(SmoothReading.of(model.mesh), finer.mesh.points[:, :2])
    levels = np.cbrt(np.array(model.increments))
    finer_levels = np.cbrt(np.array(finer.increments))
    if model.unloaded:  # pressures fall, too: along the length of the path of the cube roots
        levels = np.cumsum(np.abs(np.diff(levels, prepend=0.0)))
        finer_levels = np.cumsum(np.abs(np.diff(finer_levels, prepend=0.0)))
    order = np.argsort(levels)
    levels = levels[order]
    displacements = path[order]
    if len(levels) == 1:
        levels = np.append(0.0, levels)
        displacements = np.concatenate([0.0 * displacements, displacements])
    starts = np.empty((len(finer.increments), *finer.mesh.points.shape))
    for start, level in zip(starts, finer_levels, strict=True):
        upper = int(np.searchsorted(levels, level))
        upper = min(max(upper, 1), len(levels) - 1)
        share = (level - levels[upper - 1]) / (levels[upper] - levels[upper - 1])
        start[:] = sample @ (
            (1.0 - share) * displacements[upper - 1] + share * displacements[upper]
        )
        start.reshape(-1)[finer.fixed] = 0.0
    return starts


def sample_on_mesh(
    reading: SmoothReading | FacetReading, positions: Array
) -> scipy.sparse.csr_matrix:
    """Return the sparse matrix that interpolates nodal values at positions (n, 2), mm.

    A position that lies within the rim of one mesh but outside that of another (both are polygons)
    is moved towards the centre, in steps, until it lies on the mesh. Raise InputError if it does
    not.
    """
    shifted = positions.copy()
    is_on_mesh = np.zeros(len(positions), dtype=bool)
    for share in (1.0, 1 - 1e-4, 1 - 1e-3, 1 - 1e-2, 0.95, 0.9):
        shifted[~is_on_mesh] = share * positions[~is_on_mesh]
        matrix, is_on_mesh = reading.matrix(shifted)
        if is_on_mesh.all():
            return matrix
    problem = f"{(~is_on_mesh).sum()} places of the data lie outside of it"
    raise InputError(None, "mesh", problem)
