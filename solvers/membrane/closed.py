"""A membrane around a cavity: gas pressure, start from the slack state, rigid bodies."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...errors import InputError
from ...materials.law import HypoelasticLaw
from ...meshes.cylinder_model import ClosedGas, InflatedModel, RigidCylinder
from ...meshes.mesh import Array, Numbers
from ...meshes.volume import volume_and_gradient
from .bubble import STIFF, Wall
from .cords import cords_on
from .factorisation import BorderedTangent, Tangent, tangent_for
from .initial_stiffness import initial_stiffness, refuse_memory
from .kernel import reference_elements
from .line_search import searched_equilibrium
from .membrane import Membrane

#: cos of the largest angle in a line of the mesh: a cap's rim is a seam, and carries no moment.
STRAIGHT = 0.7
#: mm to which the first touch is found, and places tried at once on the way to it.
TOUCH, WAYS = 1e-9, 500
#: The slack state's artificial stiffness is multiplied by this in every iteration.
FADE = 0.6
#: Artificial stress of the slack state over that with which a cap's first step, p R^2/(4 t stress),
#: is as large as the result, 0.66 R (p R/(t E))^(1/3).
SLACK_SHARES = (4.0, 0.4, 40.0)


@dataclass(frozen=True, eq=False)
class Cavity:
    """A closed surface, or the part of one that symmetry planes close.

    weight, origin (3,): see `volume_and_gradient`; where two planes share a direction (a slice of a
    long tube) it gets no weight. symmetric (3,): directions with a plane; planes (n, 3): nodes of
    open edges in one, by its normal.
    """

    quads: NDArray[np.intp]
    weight: Array
    origin: Array
    symmetric: NDArray[np.bool_]
    planes: NDArray[np.bool_]

    def measure(self, position: Array) -> tuple[float, Array]:
        """Return volume (mm^3) of the meshed part at `position` (n, 3) and derivative (3 n,)."""
        volume, push = volume_and_gradient(position, self.quads, self.weight, self.origin)
        return volume, push.reshape(-1)


def closed_cavity(points: Array, quads: NDArray[np.intp], fixed: NDArray[np.intp]) -> Cavity:
    """Find the symmetry planes that close the surface, of unknowns held (3 * node + direction).

    InputError : an open edge in no plane in which its nodes are held.
    """
    sides = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    border = edges[count == 1]
    is_fixed = np.zeros(points.shape, dtype=bool)
    is_fixed.reshape(-1)[fixed] = True
    size = float(np.ptp(points, axis=0).max())
    level = np.abs(points[border[:, 0]] - points[border[:, 1]]) < 1e-9 * size
    in_plane = is_fixed[border].all(axis=1) & level  # (edges, 3)
    if not in_plane.any(axis=1).all():
        first, second = border[int(np.argmin(in_plane.any(axis=1)))]
        raise InputError(
            None,
            "mesh",
            f"the cavity is open between nodes {first} and {second}: close it, "
            "or hold the edge normal to a symmetry plane",
        )
    weight = np.ones(3)
    origin = points.mean(axis=0)
    for k in range(3):
        at = points[border[in_plane[:, k], 0], k]
        if len(at):
            origin[k] = at[0]
            weight[k] = float(np.ptp(at) < 1e-9 * size)
    if not weight.any():
        raise InputError(None, "mesh", "the cavity is closed by planes on all six sides")
    planes = np.zeros(points.shape, dtype=bool)
    for k in range(3):
        planes[border[in_plane[:, k]], k] = True
    return Cavity(quads, weight / weight.sum(), origin, in_plane.any(axis=0), planes)


# Bending stiffness of the wall, which keeps a wrinkle from being as fine as the mesh.
#
# No rotations: the curvature along a line of the mesh is the second difference of three positions,
#     [(x_+ - x_0)/l_+ - (x_0 - x_-)/l_-] / h,   h = (l_+ + l_-)/2,
# a vector that turns with the wall, and the energy of a node's share of the surface D/2 times its
# square (Bergou et al., Symposium on Geometry Processing 2006, on lines of a grid): quadratic in
# the positions, with one constant matrix. The sheet is flat when it is free; no twist.


@dataclass(frozen=True, eq=False)
class Flexure:
    """Lines of a mesh through its nodes.

    nodes (h, 3): before, at, after; a plane of symmetry mirrors the node after. differences (h, 3,
    3): by node and component, 1/mm^2, of the curvature. shares (h, 2) mm^2 mm^3: surface times
    thickness^3/12 that bends along warp, fill.
    """

    nodes: Numbers
    differences: Array
    shares: Array

    def stiffness(self, law: HypoelasticLaw) -> Array:
        """Return (h, 3, 3, 3) N/mm by line, component, node, node; with moduli at zero strain."""
        plane = np.diagonal(initial_stiffness(law))[:2]
        c = self.differences
        return np.asarray(np.einsum("h,hai,hbi->hiab", self.shares @ plane, c, c))

    def matrix(self, law: HypoelasticLaw, count: int) -> sp.csr_matrix:
        """Return (3 count, 3 count) N/mm on all unknowns of `count` nodes."""
        values = self.stiffness(law)
        unknowns = 3 * self.nodes[:, None, :] + np.arange(3)[:, None]  # (h, 3, 3)
        rows = np.broadcast_to(unknowns[..., :, None], values.shape)
        columns = np.broadcast_to(unknowns[..., None, :], values.shape)
        triples = (values.ravel(), (rows.ravel(), columns.ravel()))
        return sp.csr_matrix(triples, shape=(3 * count, 3 * count))


def flexure_of(
    points: Array, quads: Numbers, warp: Array, thickness: Array, planes: NDArray[np.bool_]
) -> Flexure:
    """Return the lines through every node of a mesh; thickness mm, one or (quads,).

    planes : (n, 3) whether an open edge at the node lies in a plane of symmetry, by its normal.
    """
    share, inertia, along = _of_nodes(points, quads, warp, thickness)
    nodes = []
    differences = []
    shares = []
    for previous_node, node, next_node, mirror in _lines(points, quads, planes):
        step = points[next_node] - points[node]
        back = (
            points[node] - points[previous_node] if previous_node != next_node else -mirror * step
        )
        ahead = float(np.linalg.norm(step))
        behind = float(np.linalg.norm(back))
        if step @ back < STRAIGHT * ahead * behind:
            continue
        ones = np.ones(3)
        slopes = np.stack([mirror / behind, -ones / behind - ones / ahead, ones / ahead])
        if previous_node == next_node:
            # Components normal to the plane are equal on both sides and cancel.
            slopes *= mirror > 0
        nodes.append((previous_node, node, next_node))
        differences.append(slopes / (0.5 * (ahead + behind)))
        direction = step / ahead + back / behind
        cosine = direction @ along[node] / np.linalg.norm(direction)
        warps = min(1.0, float(cosine) ** 2)
        shares.append(share[node] * inertia[node] * np.array([warps**2, (1.0 - warps) ** 2]))
    return Flexure(
        np.array(nodes, dtype=np.intp).reshape(-1, 3),
        np.array(differences).reshape(-1, 3, 3),
        np.array(shares).reshape(-1, 2),
    )


def _of_nodes(
    points: Array, quads: Numbers, warp: Array, thickness: Array
) -> tuple[Array, Array, Array]:
    """Return of every node: surface mm^2, mean of thickness^3 / 12, direction of the warp."""
    corner = points[quads]
    across = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    area = 0.5 * np.linalg.norm(across, axis=1)
    normal = across / (2.0 * area[:, None])
    flat = warp - np.einsum("mk,mk->m", warp, normal)[:, None] * normal
    flat /= np.linalg.norm(flat, axis=1)[:, None]
    share = np.zeros(len(points))
    cube = np.zeros(len(points))
    along = np.zeros(points.shape)
    np.add.at(share, quads, 0.25 * area[:, None])
    np.add.at(cube, quads, 0.25 * (area * np.broadcast_to(thickness, area.shape) ** 3)[:, None])
    np.add.at(along, quads, flat[:, None])
    inertia = cube / (12.0 * np.where(share > 0, share, 1.0))
    length = np.linalg.norm(along, axis=1)[:, None]
    return share, inertia, along / np.where(length > 0, length, 1.0)


def _lines(
    points: Array, quads: Numbers, planes: NDArray[np.bool_]
) -> Iterator[tuple[int, int, int, Array]]:
    """Yield (before, node, after, mirror (3,)): neighbours in line through a node."""
    elements_by_neighbour: list[dict[int, set[int]]] = [{} for _ in points]
    for e, quad in enumerate(quads.tolist()):
        for a, b in zip(quad, quad[1:] + quad[:1], strict=True):
            elements_by_neighbour[a].setdefault(b, set()).add(e)
            elements_by_neighbour[b].setdefault(a, set()).add(e)
    size = 1e-9 * float(np.ptp(points, axis=0).max())
    for node, around in enumerate(elements_by_neighbour):
        normals = np.flatnonzero(planes[node])
        unmatched = list(around)
        for normal in normals:
            leaving = [a for a in around if abs(points[a, normal] - points[node, normal]) > size]
            if len(leaving) == 1:
                mirror = np.ones(3)
                mirror[normal] = -1.0
                yield leaving[0], node, leaving[0], mirror
                unmatched.remove(leaving[0])
        if len(around) + len(normals) == 4 and len(unmatched) > 1:
            for i, a in enumerate(unmatched):
                for b in unmatched[i + 1 :]:
                    if not around[a] & around[b]:
                        yield a, node, b, np.ones(3)


def gaps(body: RigidCylinder, position: Array) -> tuple[Array, Array, Array]:
    """Return distance (n,) mm of points from a body, gradient (n, 3) and Hessian (n, 3, 3).

    Negative inside. In a ring's mouth it is that from the circle through the fillet's centre, less
    its radius.
    """
    axis = np.asarray(body.axis, dtype=float)
    arm = position - np.asarray(body.centre, dtype=float)
    along = arm @ axis
    across = arm - along[:, None] * axis
    r = np.maximum(np.linalg.norm(across, axis=1), 1e-9)
    radial = across / r[:, None]
    around = np.cross(axis, radial)
    turn = np.einsum("ni,nj->nij", around, around) / r[:, None, None]
    if not body.ring:
        return r - body.radius, radial, turn
    into_mouth = np.abs(along) - (0.5 * body.length - body.fillet)
    in_mouth = into_mouth > 0
    s = np.where(in_mouth, into_mouth, 0.0)
    q = body.radius + body.fillet - r
    d = np.where(in_mouth, np.hypot(q, s), q)
    d = np.where(np.abs(d) > 1e-9, d, 1e-9)
    out = -(q / d)[:, None] * radial + (s / d * np.sign(along))[:, None] * axis
    side = (s / d)[:, None] * radial + (q / d * np.sign(along))[:, None] * axis
    curve = np.where(in_mouth, 1.0 / d, 0.0)
    hessian = curve[:, None, None] * np.einsum("ni,nj->nij", side, side)
    return d - body.fillet, out, hessian - (q / d)[:, None, None] * turn


def contact_forces(
    body: RigidCylinder, position: Array, stiffness: Array
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return forces (n, 3) N on the nodes, minus their derivative (touched, 3, 3), and which touch.

    stiffness (n,) N/mm: penalty times the node's share of the reference surface.
    """
    within_reach = _within_reach(body, position)
    gap, out, hessian = gaps(body, position[within_reach])
    penetrates = gap < 0
    touched = within_reach[penetrates]
    k = stiffness[touched]
    g = gap[penetrates]
    n = out[penetrates]
    force = np.zeros_like(position)
    force[touched] = -(k * g)[:, None] * n
    slope = np.einsum("ni,nj->nij", n, n) + g[:, None, None] * hessian[penetrates]
    return force, k[:, None, None] * slope, touched


def _within_reach(body: RigidCylinder, position: Array) -> NDArray[np.intp]:
    arm = position - np.asarray(body.centre, dtype=float)
    along = arm @ np.asarray(body.axis, dtype=float)
    square = np.einsum("ni,ni->n", arm, arm) - along**2
    if body.ring:
        # The mouth opens from the inner radius outwards.
        return np.flatnonzero((square > body.radius**2) & (np.abs(along) < 0.5 * body.length))
    return np.flatnonzero(square < body.radius**2)


def brought_to_touch(
    body: RigidCylinder, position: Array, direction: Array, bite: float
) -> RigidCylinder:
    """Return the body moved along `direction` until it is `bite` (mm) into the surface."""
    centre = np.asarray(body.centre, dtype=float)
    axis = np.asarray(body.axis, dtype=float)
    arm = position - centre
    if body.ring:
        within_reach = np.abs(arm @ axis) < 0.5 * body.length
    else:
        within_reach = np.abs(arm @ np.cross(axis, direction)) < body.radius
    if not within_reach.any():
        problem = f"no node of the mesh lies where {body.name!r} could touch; refine it there"
        raise InputError(None, "mesh", problem)
    nodes = position[within_reach]
    heights = arm[within_reach] @ direction
    low = float(heights.min()) - 2 * body.radius
    high = float(heights.max()) + 2 * body.radius
    # Search the first touch from outside; a ring starts around the membrane's middle.
    if body.ring:
        low = 0.5 * float(heights.min() + heights.max())

    def least(ways: Array) -> Array:
        """Return the smallest gap for each way: the nodes move instead of the body."""
        shifted = nodes - ways[:, None, None] * direction
        return gaps(body, shifted.reshape(-1, 3))[0].reshape(len(ways), -1).min(axis=1)

    while high - low > TOUCH:
        ways = np.linspace(low, high, WAYS)
        first = int(np.argmax(least(ways) < -bite))
        low = float(ways[max(first - 1, 0)])
        high = float(ways[first])
    return replace(body, centre=tuple((centre + low * direction).tolist()))


@dataclass(eq=False, kw_only=True)
class ClosedMembrane(Membrane):
    """A membrane with a cavity; `tangent` is a `BorderedTangent`.

    gas : sets the pressure by the volume. penalty : MPa/mm, of `bodies` at their present place.
    slack : MPa of artificial isotropic stress in the next tangent, in no residual; it fades
    with every tangent. dead : (3 n,) N, minus dead loads on the nodes. line_slot : (lines, 144)
    places of the flexure's stiffness in the tangent, each a quad of before, node, after, node.
    full : MPa at which cords have their initial force. pressure, volume : at the last
    evaluation.
    """

    cavity: Cavity
    wall: Wall = field(default_factory=Wall)
    flexure: Flexure | None = None
    line_slot: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 144), dtype=np.int64))
    full: float = 1.0
    gas: ClosedGas | None = None
    bodies: Sequence[RigidCylinder] = ()
    penalty: float = 5.0
    slack: float = 0.0
    viscosity: float = 0.0
    anchor: Array = field(init=False)
    dead: Array | None = None
    pressure: float = 0.0
    volume: float = 0.0
    contact: list[Array] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.wrinkle_stiffness = self.wall.wrinkle_stiffness
        self._stiff: tuple[HypoelasticLaw, sp.csr_matrix, Array] | None = None
        e = self.elements
        dn = self.elements.slopes
        weight: Array = e.area * self.section[:, None]
        #: (elements, 4, 4) N/mm for 1 MPa of isotropic stress
        self.isotropic: Array = np.einsum("mp,mpan,mpak->mnk", weight, dn, dn)
        tributary = np.einsum("mp,pn->mn", e.area, e.values)
        count = len(self.reference)
        shares = np.bincount(self.quads.ravel(), tributary.ravel(), count)
        self.node_area: Array = np.asarray(shares, dtype=float)
        slot = self.tangent.slot.reshape(-1, 4, 3, 4, 3)
        self.axis_slot = np.stack([slot[:, :, k, :, k] for k in range(3)], axis=-1)
        self.node_slot = np.full((len(self.reference), 3, 3), -1, dtype=np.int64)
        for a in range(4):
            self.node_slot[self.quads[:, a]] = slot[:, a, :, a, :]

    def unbalance(self, u: Array, pressure: float, with_tangent: bool) -> float:
        self.pressure = pressure
        self.volume, push = self.cavity.measure(self.reference + u)
        assert isinstance(self.tangent, BorderedTangent)
        if self.gas is not None:
            if not self.volume > 0:
                return np.inf
            self.pressure = self.gas.pressure(self.volume)
        if with_tangent:
            self.tangent.stiffness = self.gas.stiffness(self.volume) if self.gas else 0.0
            self.tangent.border = push[self.free]
        return super().unbalance(u, self.pressure, with_tangent)

    def bending_stiffness(self) -> tuple[sp.csr_matrix, Array]:
        """Return the matrix of all unknowns, and its part in the tangent; anew for a new law."""
        assert self.flexure is not None
        if self._stiff is None or self._stiff[0] is not self.law:
            added = np.zeros(len(self.tangent.data))
            slot = self.line_slot.reshape(-1, 4, 3, 4, 3)[:, :3, :, :3]
            values = self.flexure.stiffness(self.law)
            for k in range(3):
                places = slot[:, :, k, :, k]
                is_stored = places >= 0
                np.add.at(added, places[is_stored], values[:, k][is_stored])
            self._stiff = (self.law, self.flexure.matrix(self.law, len(self.reference)), added)
        return self._stiff[1], self._stiff[2]

    def equilibrium(self, u: Array, pressure: float) -> Array | None:
        if self.bodies:
            return searched_equilibrium(self, u, pressure)
        return super().equilibrium(u, pressure)

    def further_forces(self, u: Array, with_tangent: bool) -> None:
        if self.flexure is not None:
            matrix, added = self.bending_stiffness()
            self.residual += matrix @ (self.reference + u).reshape(-1)
            if with_tangent:
                self.tangent.data += added
        if self.cords is not None:
            self.cords.level = self.pressure / self.full
        super().further_forces(u, with_tangent)
        if with_tangent and self.slack > 0:
            self.add(self.axis_slot, self.slack * self.isotropic[..., None])
            self.slack *= FADE
        if self.viscosity > 0:
            drag = self.viscosity * self.node_area[:, None]
            self.residual += (drag * (u - self.anchor)).reshape(-1)
            if with_tangent:
                self.add(self.node_slot, drag[:, None] * np.eye(3))
        if self.dead is not None:
            self.residual += self.dead
        self.contact = []
        for body in self.bodies:
            push, stiffness, touched = contact_forces(
                body, self.reference + u, self.penalty * self.node_area
            )
            self.residual -= push.reshape(-1)
            self.contact.append(push)
            if with_tangent:
                self.add(self.node_slot[touched], stiffness)

    def node_weight(self, weight: float) -> Array:
        """Return (n,) N of the nodes; weight : N/mm^2 of the thinnest part of the wall."""
        point_weight = weight * self.elements.area * (self.section / self.section.min())[:, None]
        shares = np.einsum("mp,pn->mn", point_weight, self.elements.values)
        return np.asarray(np.bincount(self.quads.ravel(), shares.ravel()), dtype=float)

    def drag(self, viscosity: float, anchor: Array) -> None:
        """Resist (MPa/mm times distance) motion away from the displacement `anchor` (n, 3)."""
        self.viscosity = viscosity
        self.anchor = anchor

    def wrinkled_share(self, sides: NDArray[np.bool_]) -> float:
        """Return the share of the surface of `sides` (elements,) without tension in a direction."""
        area = self.elements.area[sides]
        s = self.stress_new[sides]
        smaller_principal = 0.5 * (s[..., 0] + s[..., 1]) - np.hypot(
            0.5 * (s[..., 0] - s[..., 1]), s[..., 2]
        )
        folded = (self.wrinkle[sides] != 0.0).any(axis=2) | (smaller_principal < 0.0)
        return float(area[folded].sum() / area.sum())

    def wrinkle_work(self, wrinkle: Array) -> float:
        """Return the work (N mm, of the meshed part) on the stiffness that is left to wrinkles.

        From the last `accept`, where they were `wrinkle` (elements, 4, 3), to the last evaluation.
        """
        if not self.wrinkle_stiffness:
            return 0.0
        stiffness = self.wrinkle_stiffness * initial_stiffness(self.law)
        stress = -0.5 * np.einsum("ij,mpj->mpi", stiffness, self.wrinkle + wrinkle)
        change = self.strain_new - self.wrinkle - (self.strain_old - wrinkle)
        weight = self.elements.area * self.section[:, None]
        return float(np.einsum("mp,mpi,mpi", weight, stress, change))

    def equilibrium_from_slack(self, start: Array, level: float) -> Array | None:
        """Return the equilibrium from a slack start, by an artificial stress that fades."""
        modulus = 0.5 * (float(self.law.E1(0.0)) + float(self.law.E2(0.0)))
        area = float((self.elements.area.sum(axis=1) * self.section).sum())
        line = 2.0 * level * self.cavity.measure(self.reference)[0] / area  # p R/t of a tube
        for share in SLACK_SHARES:
            self.slack = share * float(np.cbrt(modulus * line**2))
            displacement = self.equilibrium(start, level)
            self.slack = 0.0
            if displacement is not None:
                return displacement
        return None


def prepare(
    model: InflatedModel, law: HypoelasticLaw, tolerance: float, wall: Wall | None
) -> ClosedMembrane:
    return closed_membrane(model, law, tolerance, model.fixed(), wall or STIFF)


def closed_membrane(
    model: InflatedModel, law: HypoelasticLaw, tolerance: float, fixed: NDArray[np.intp], wall: Wall
) -> ClosedMembrane:
    refuse_memory(law, "a closed membrane")
    points = np.array(model.mesh.points, dtype=float)
    quads = np.ascontiguousarray(model.mesh.quads, dtype=np.int64)
    warp = np.broadcast_to(np.asarray(model.warp, dtype=float), (len(quads), 3))
    elements = reference_elements(points, quads, warp)
    free = np.setdiff1d(np.arange(points.size), fixed)
    cavity = closed_cavity(points, quads, fixed)
    thickness = np.asarray(model.thickness, dtype=float)
    flexure = None
    coupled = quads
    if model.bending is not None and wall.bending_stiffness > 0:
        flexure = flexure_of(points, quads, warp, thickness, cavity.planes)
        flexure = replace(flexure, shares=wall.bending_stiffness * flexure.shares)
        previous_node, node, next_node = flexure.nodes.T
        coupled = np.concatenate([quads, np.stack([previous_node, node, next_node, node], axis=1)])
    tangent: Tangent = tangent_for(coupled, points.size, free, points)
    tangent.slot, line_slot = tangent.slot[: len(quads)], tangent.slot[len(quads) :]
    for _ in range(sum(not cord.bonded for cord in model.cords)):
        tangent = BorderedTangent(tangent)
    return ClosedMembrane(
        points,
        quads,
        elements,
        thickness,
        law,
        free,
        BorderedTangent(tangent),
        tolerance,
        # A slack step much larger than a facet folds the mesh.
        step_limit=0.5 * float(np.sqrt(np.median(elements.area.sum(axis=1)))),
        wall=wall,
        cavity=cavity,
        flexure=flexure,
        line_slot=line_slot,
        cords=cords_on(model.mesh, model.cords, cavity.planes),
        full=float(model.pressures[-1]),
    )
