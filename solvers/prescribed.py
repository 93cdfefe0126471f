"""Parts that move as prescribed: grips of a strip, supports and collar of a cylinder.

A solver that cannot drive the gauge of a strip drives grips, along the path on which the membrane
opens the gauge under the same law (or an even stretch, run once to correct it); its results are
interpolated to the model's elongations. Supports and collar are solids of prescribed nodes, as
contact needs faces.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..materials.law import HypoelasticLaw
from ..meshes.bubble_model import BubbleModel
from ..meshes.closed_surfaces import enclosed_volume
from ..meshes.cylinder_model import Collar, CylinderModel, RigidSupports
from ..meshes.mesh import Array, Numbers, grid_quads
from ..meshes.strip_models import UniaxialModel
from ..notes import Note
from .base import History, extremes, log_strain
from .membrane.solver import MembraneSolver

log = logging.getLogger(__name__)


def held_dofs(directions: Sequence[int]) -> tuple[int, ...]:
    """Return a shell's held degrees of freedom (from 0): of one direction, a plane of symmetry."""
    turns = {0: (4, 5), 1: (3, 5), 2: (3, 4)}
    return (*directions, *(turns[directions[0]] if len(directions) == 1 else ()))


def grip_pulls(
    model: UniaxialModel,
    law: HypoelasticLaw,
    opened: Callable[[Array], Array],
    solver: str,
) -> tuple[Array, bool]:
    """Return pulls (increments,) mm of the grips, and whether they are the gauge; SolverFailure.

    Parameters
    ----------
    opened : callable
        Runs the strip at given pulls and returns how far its gauge opened, (increments,) mm.
    """
    driven = direct(model)
    if driven is not None:
        return driven, True
    pulls = as_the_membrane(model, law)
    if pulls is None:
        # As if the whole strip stretched as the gauge does.
        length = np.ptp(model.mesh.points[:, 1])
        even = np.array(model.elongations) * length / model.gauge_length
        pulls = corrected(model, even, opened(even), solver)
    return pulls, False


def direct(model: UniaxialModel) -> Array | None:
    """Return the pulls when the gauge lies between the grips themselves, along the pull."""
    lower, upper = (3 * node + np.arange(3) for node in model.mesh.node_sets["gauge"])
    is_gripped = np.isin(np.concatenate([lower[[0, 2]], upper]), model.fixed).all()
    first, last = model.mesh.points[model.mesh.node_sets["gauge"]]
    is_along_pull = first[0] == last[0] and first[1] < last[1]
    if is_gripped and is_along_pull and lower[1] in model.driven:
        return np.array(model.elongations)
    return None


def as_the_membrane(model: UniaxialModel, law: HypoelasticLaw) -> Array | None:
    """Return pulls (increments + 1,) on which the membrane opens the gauge; None where it fails."""
    try:
        history = MembraneSolver().run(model, law)
    except SolverFailure as failure:
        log.info("grips are pulled evenly first: %s", failure)
        return None
    return _onward(-history.displacement[:, model.mesh.node_sets[model.pulled][0], 1])


def corrected(
    model: UniaxialModel,
    pulls: Array,
    opened: Array,
    solver: str,
) -> Array:
    """Return pulls (increments + 1,) mm, as steep beyond the end, at which the gauge is right.

    Parameters
    ----------
    pulls, opened : (n,) array, mm
        Pulls of a run and how far they opened the gauge.
    """
    spline = _over_gauge(opened, pulls, solver)
    gauge = spline.x
    pull = np.insert(pulls, 0, 0.0)
    levels = np.array(model.elongations)
    last_slope = (pull[-1] - pull[-2]) / (gauge[-1] - gauge[-2])
    pull_at_levels = spline(np.minimum(levels, gauge[-1]))
    missing = np.maximum(levels - gauge[-1], 0.0)
    return _onward(pull_at_levels + last_slope * missing)


def _over_gauge(opened: Array, values: Array, solver: str) -> Any:
    """Return a spline of values, zero at rest, over the opening of the gauge; SolverFailure.

    Parameters
    ----------
    opened, values : (increments,) and (increments, ...) arrays
        Opening in mm.
    """
    gauge = np.insert(opened, 0, 0.0)
    if not (np.diff(gauge) > 0).all():
        raise SolverFailure("the gauge gets shorter while the grips move apart", solver)
    values_from_rest = np.concatenate([np.zeros((1, *values.shape[1:])), values])
    return scipy.interpolate.CubicSpline(gauge, values_from_rest)


def at_elongations(
    opened: Array,
    model: UniaxialModel,
    values: Array,
    solver: str,
) -> Array:
    """Return values at the model's elongations by a cubic spline, (elongations, ...).

    Parameters
    ----------
    opened : (increments,) array, mm
        How far the gauge opened.
    model : UniaxialModel
    values : (increments, ...) array
        Values at these openings.
    solver : str
        Name of the solver, for messages.

    Raises
    ------
    SolverFailure
        The gauge does not get there, or shrinks.
    """
    levels = np.array(model.elongations)
    tolerance = 1e-9 * model.gauge_length
    if len(opened) == len(levels) and np.abs(opened - levels).max() <= tolerance:
        return values
    if opened[-1] < levels[-1]:
        problem = (
            f"the gauge opened by {opened[-1]:.5g} mm only and not by {levels[-1]:.5g}; "
            "refine the mesh, or see whether the law gets too soft between gauge and grips"
        )
        raise SolverFailure(problem, solver)
    return np.asarray(_over_gauge(opened, values, solver)(levels))


def gauge_opened(model: UniaxialModel, u: Array) -> Array:
    """Return the elongation (increments,) mm of the gauge.

    Parameters
    ----------
    u : (increments, nodes, 3) array, mm
        Displacements.
    """
    lower, upper = (model.mesh.points[n] + u[:, n] for n in model.mesh.node_sets["gauge"])
    return np.linalg.norm(upper - lower, axis=1) - model.gauge_length


def strip_history(
    model: UniaxialModel,
    u: Array,
    forces: Array,
    sets: Mapping[str, Numbers],
    solver: str,
    iterations: int,
    driven: bool = False,
) -> History:
    """Return load, displacement, reactions at the gauge's elongations; else SolverFailure.

    Parameters
    ----------
    u : (increments, nodes of the mesh, 3) array, mm
    forces : (increments, nodes, 3) array
        N of the supports, by the node sets of the solver's own mesh.
    driven : bool
        The grips are the gauge.
    """
    gauge = gauge_opened(model, u)

    def at_levels(values: Array) -> Array:
        return values if driven else at_elongations(gauge, model, values, solver)

    corners = np.ascontiguousarray(at_levels(u))
    low, high = extremes(log_strain(model.mesh, corners, model.warp))
    supported_sets = (*model.supports, model.pulled)
    sums = {name: at_levels(forces[:, sets[name]].sum(axis=1)) for name in supported_sets}
    load = -model.load_factor * sums[model.pulled][:, 1]
    return History(
        load,
        corners,
        low,
        high,
        sums,
        iterations=iterations,
        path=corners,
    )


def inflated_history(
    model: BubbleModel,
    u: Array,
    forces: Array | None,
    sets: Mapping[str, Numbers],
    iterations: int,
    remarks: tuple[Note, ...] = (),
) -> History:
    """Return displacements, support forces and strains in the reported frames of a bubble.

    Parameters
    ----------
    u : (increments, nodes, 3) array
        mm from the sheet without stress.
    forces : (frames, nodes, 3) array or None
        N of the supports, by the node sets of the solver's own mesh; None where they are not known.
    """
    sums: dict[str, Array] = {}
    if forces is not None:
        supported_sets = [name for name in model.supports if name in sets]
        sums = {name: forces[:, sets[name]].sum(axis=1) for name in supported_sets}
    low, high = extremes(log_strain(replace(model.mesh, points=model.stress_free), u))
    path = u + (model.stress_free - model.mesh.points)
    keep = model.reported
    levels = np.array(model.increments)[keep]
    return History(
        levels,
        path[keep],
        low,
        high,
        sums,
        iterations=iterations,
        path=path,
        remarks=remarks,
    )


def _onward(pulls: Array) -> Array:
    """Return pulls with one further than expected, so that the gauge surely gets there."""
    further = 1.02
    return np.append(pulls, further * pulls[-1])


#: mm that the collar begins above the inflated cylinder, so that it does not touch.
ABOVE = 0.5


@dataclass(frozen=True)
class ContactBodies:
    """How supports and collar are made as bodies of elements, and what may touch them.

    Arcs are from and to, in degrees: around a support from the axis of the cylinder, around a
    quarter collar from the top. Elements are few where a body is straight, many where it is round
    (benchmarks/bench_calculix.py collar).
    """

    support_into: float = 0.02  # mm that the support begins inside the cylinder, so that it touches
    beside_support: float = 80.0  # mm to either side of a support, where places may touch
    beside_collar: float = 60.0  # mm beyond the collar's edge
    highest_on_support: float = -0.35  # radii, height of places that may touch a support
    lowest_in_collar: float = 0.1  # radii
    beyond_symmetry: float = 20.0  # mm of length beyond a plane of symmetry
    thickness: float = 10.0  # mm of a body
    support_arc: tuple[float, float] = (165.0, 15.0)
    support_counts: tuple[int, int] = (48, 3)  # elements around and across
    support_reach: float = 1.3  # radii, to which a support goes across the cylinder
    collar_arc: tuple[float, float] = (60.0, -9.0)
    collar_counts: tuple[int, int] = (24, 2)  # elements around and along
    fillet_count: int = 6  # elements along the fillet
    fillet_turn: float = 75.0  # degrees that the fillet turns, short of a face across the axis
    # Behind the fillet the faces draw together, so that no solid turns inside out.
    behind_fillet: float = 0.3  # length behind over length in front
    extra_thickness: float = 5.0  # mm, of the collar


CONTACT = ContactBodies()


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A body of elements (m, 8) over points (n, 3) mm; the last four nodes (S2) are in contact."""

    points: Array
    elements: Numbers

    @property
    def faces(self) -> Array:
        """Return (m, 4, 3) mm corners of the faces in contact, as seen from the cylinder."""
        return np.asarray(self.points[self.elements[:, 4:]], dtype=float)


def bodies(
    model: CylinderModel,
    inflated: Array,
    under: Numbers,
    program: str,
) -> tuple[RigidBody, RigidBody]:
    """Return support and collar at the inflated cylinder.

    Parameters
    ----------
    model : CylinderModel
    inflated : (n, 3) array, mm
        Points of the inflated cylinder.
    under : (m,) array of int
        Numbers of the points that a support holds.
    program : str
        Name of the program, for messages.

    Raises
    ------
    InputError
        The whole cylinder is meshed; the program's deck bends a quarter.
    """
    if model.copies != 4:
        raise InputError(None, "symmetry", f"{program} bends a quarter; mesh it as 'quarter'")
    radius = np.abs(model.mesh.points[:, 1]).max()
    support = support_body(model.supports, radius, inflated[under, 1].min() + CONTACT.support_into)
    return support, collar_body(model.collar, inflated, ABOVE)


def without_cords(model: CylinderModel | BubbleModel, program: str) -> None:
    """Raise InputError for cords, or loads and supports of a cylinder for the membrane alone."""
    if model.cords:
        problem = f"cords are for the solver membrane: {program}'s deck has no tension-only members"
        raise InputError(None, "cord", problem)
    if isinstance(model, BubbleModel):
        return
    pumped = model.gas.constant == "pressure"
    membrane_only = {
        "saddle": model.supports.saddle,
        "collar.spacing": model.collar.spacing,
        "mass_per_area": model.weight,
        "gas.constant": pumped,
    }
    for key, setting in membrane_only.items():
        if setting:
            raise InputError(None, key, f"is for the solver membrane, {program}'s deck has none")


def may_touch(model: CylinderModel, places: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which places (n, 3) of the tube at rest support and collar may touch."""
    radius = np.abs(model.mesh.points[:, 1]).max()
    height = places[:, 1]
    z = np.abs(places[:, 2])
    is_near_support = np.abs(z - 0.5 * model.supports.span) < CONTACT.beside_support
    is_near_collar = z < 0.5 * model.collar.length + CONTACT.beside_collar
    is_low = height < CONTACT.highest_on_support * radius
    is_high = height > CONTACT.lowest_in_collar * radius
    return is_near_support & is_low, is_near_collar & is_high


def volumes(model: CylinderModel, displacements: Array) -> Array:
    """Return (frames,) mm^3 inside the middle surface of the whole cylinder.

    Parameters
    ----------
    displacements : (frames, nodes, 3) array, mm
    """
    mesh = model.mesh
    quarter_volumes = [enclosed_volume(mesh.points + u, mesh.quads) for u in displacements]
    return model.copies * np.array(quarter_volumes)


def support_body(supports: RigidSupports, radius: float, top: float) -> RigidBody:
    """Return the upper part of the support at z = span / 2, its crest at `top` mm."""
    support_radius = 0.5 * supports.diameter

    def place(angle: Array, x: Array, face: int) -> Array:
        distance = support_radius - CONTACT.thickness * (1 - face)
        y = top - support_radius + distance * np.sin(angle)
        z = 0.5 * supports.span + distance * np.cos(angle)
        return np.stack([x, y, z], axis=-1)

    count_around, count_across = CONTACT.support_counts
    around = np.radians(np.linspace(*CONTACT.support_arc, count_around + 1))
    end = CONTACT.support_reach * radius
    across = np.linspace(-CONTACT.beyond_symmetry, end, count_across + 1)
    return _body(around, across, place)


def collar_body(collar: Collar, cylinder: Array, clearance: float) -> RigidBody:
    """Return the upper part of the collar on x, z >= 0, above the cylinder's points (n, 3).

    It stands `clearance` (mm) above where one of its faces, chords of the ring, meets the cylinder.
    """
    body = _ring(collar)
    up = clearance - way_down(body.faces, cylinder)
    return replace(body, points=body.points + np.array([0.0, up, 0.0]))


def way_down(faces: Array, points: Array) -> float:
    """Return how far (mm) flat faces (n, 4, 3) around z go down to points (m, 3) inside."""
    normals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    smallest_way = np.inf
    for face, normal in zip(faces, normals, strict=True):
        first, last = face[:, 2].min(), face[:, 2].max()
        is_below = (points[:, 2] >= first) & (points[:, 2] <= last)
        # Across its axis the ring is convex: a point beyond no face's plane is inside.
        if normal[1] < 0.0 and is_below.any():
            distance = (points[is_below] - face.mean(axis=0)) @ normal
            smallest_way = min(smallest_way, distance.min() / -normal[1])
    return smallest_way


def _ring(collar: Collar) -> RigidBody:
    """Return the collar with its axis at height 0."""
    radius = 0.5 * collar.inner_diameter
    half = 0.5 * collar.length
    edge = half - collar.fillet
    count_around, count_along = CONTACT.collar_counts
    straight = np.linspace(-CONTACT.beyond_symmetry, edge, count_along + 1)
    turn = np.radians(np.linspace(0.0, CONTACT.fillet_turn, CONTACT.fillet_count + 1)[1:])
    along = np.concatenate([straight, half - collar.fillet * (1 - np.sin(turn))])
    flare = np.concatenate([np.zeros_like(straight), collar.fillet * (1 - np.cos(turn))])
    behind = np.where(along > edge, CONTACT.behind_fillet, 1.0)

    def place(angle: Array, row: Array, face: int) -> Array:
        number = row.astype(int)
        z = along if face else edge + behind * (along - edge)
        behind_face = 0.0 if face else CONTACT.thickness + CONTACT.extra_thickness
        distance = (radius + flare + behind_face)[number]
        return np.stack([distance * np.sin(angle), distance * np.cos(angle), z[number]], axis=-1)

    around = np.radians(np.linspace(*CONTACT.collar_arc, count_around + 1))
    return _body(around, np.arange(len(along), dtype=float), place)


def _body(u: Array, v: Array, place: Callable[[Array, Array, int], Array]) -> RigidBody:
    """Return one layer of solids over a grid; `place(u, v, face)`: 0 behind, 1 in contact."""
    grid = np.meshgrid(u, v, indexing="ij")
    points = np.concatenate([place(*grid, face).reshape(-1, 3) for face in (0, 1)])
    nodes = np.arange(len(u) * len(v)).reshape(len(u), len(v))
    quads = grid_quads(nodes)
    behind = points[quads[0]]
    front = points[quads[0] + nodes.size]
    normal = np.cross(behind[1] - behind[0], behind[3] - behind[0])
    if normal @ (front[0] - behind[0]) < 0:
        quads = quads[:, ::-1]
    return RigidBody(points, np.concatenate([quads, quads + nodes.size], axis=1))
