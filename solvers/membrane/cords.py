"""Cords along a membrane, as straight members that cross its quads from edge to edge.

Both ends of a member lie on edges of one quad, so that the vector from end to end is
d = sum of b_n x_n over the positions x_n of the quad's nodes, with coefficients b_n that add up to
zero. With the length l = |d|, the direction t = d / l and the tensile force N(l), the internal
forces of the nodes are b_n N t, and their derivatives by the positions are
b_n b_m [dN/dl t t' + N/l (1 - t t')]. A cord that slides along the wall has the same force in all
its members, which depends on their total length; then dN/dl couples all their nodes (`sliding`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.bubble_model import BubbleModel, SheetCord
from ...meshes.cylinder_model import Cord, has_same_force
from ...meshes.mesh import Array, Mesh, Numbers

#: Relative tolerance for lengths, and tolerance in degrees for angles.
TOLERANCE = 1e-6


@dataclass(eq=False)
class Cords:
    """The m members of all cords on a mesh.

    Attributes
    ----------
    cords : sequence of Cord or SheetCord
    quads : (m,) ndarray of int
        Quad that each member crosses.
    coefficients : (m, 4) ndarray
        Coefficients b_n of the quad's nodes in the vector along the member.
    cord : (m,) ndarray of int
        Number of the cord to which each member belongs.
    mesh_share : (m,) ndarray
        Share of the member that belongs to the mesh: 1/2 in a plane of symmetry, else 1.
    nodes : (m, 4) ndarray of int
        Nodes of the quad that each member crosses.
    points : (n, 3) ndarray, mm
        All nodes at rest.
    level : float
        Present pressure over the final one; prescribed initial forces are multiplied by it.
    force : (m,) ndarray, N
        Force of the whole cord in each member, at the last evaluation.
    sliding : list of ((3 n,) ndarray, float)
        For each cord that slides, the derivative of its length by the positions of all nodes, and
        that of its force by its length, N/mm; of the last evaluation.
    """

    cords: Sequence[Cord | SheetCord]
    quads: Numbers
    coefficients: Array
    cord: Numbers
    mesh_share: Array
    nodes: Numbers
    points: Array

    def __post_init__(self) -> None:
        self.level = 1.0
        is_prescribed = [cord.initial_force is not None for cord in self.cords]
        self.has_prescribed_force = np.array(is_prescribed)[self.cord]
        self.prestrain = np.array([cord.prestrain for cord in self.cords])[self.cord]
        vectors = self._vectors(self.points)
        self.rest_length = np.linalg.norm(vectors, axis=1)
        self.rest_direction = vectors / self.rest_length[:, None]
        self.is_inflated = False
        self.sliding: list[tuple[Array, float]] = []

    def _vectors(self, position: Array) -> Array:
        """Return the vector (m, 3) mm of each member by the positions (n, 3) mm of the nodes."""
        return np.einsum("mn,mnk->mk", self.coefficients, position[self.nodes])

    def begin(self, position: Array) -> None:
        """End the inflation: from here on, cords with a prescribed initial force are strained.

        Parameters
        ----------
        position : array
            Of the nodes in the inflated state, (n, 3) mm; cords have that force there.
        """
        length = np.linalg.norm(self._vectors(position), axis=1)
        prescribed = self.has_prescribed_force
        self.rest_length[prescribed] = length[prescribed]
        strains = [cord.table.strain_at(cord.initial_force or 0.0) for cord in self.cords]
        self.prestrain[prescribed] = np.array(strains)[self.cord[prescribed]]
        self.is_inflated = True

    def forces(self, position: Array) -> tuple[Array, Array]:
        """Return the internal forces of the members and their derivatives.

        Parameters
        ----------
        position : array
            Of all nodes, (n, 3) mm. The forces are (m, 4 nodes, 3) N, and their derivatives by the
            positions of the same nodes (m, 12, 12) N/mm, without the coupling in `sliding`.
        """
        vectors = self._vectors(position)
        length = np.linalg.norm(vectors, axis=1)
        direction = vectors / length[:, None]
        slope = self._pull(position, length, direction)
        tension = self.mesh_share * self.force
        self.stiffness = self.mesh_share * slope / self.rest_length
        along = np.einsum("mi,mj->mij", direction, direction)
        across = (tension / length)[:, None, None] * (np.eye(3) - along)
        block = self.stiffness[:, None, None] * along + across
        b = self.coefficients
        tangent = np.einsum("mn,mp,mij->mnipj", b, b, block).reshape(-1, 12, 12)
        return np.einsum("mn,m,mk->mnk", b, tension, direction), tangent

    def _pull(self, position: Array, length: Array, direction: Array) -> Array:
        """Set `force` and `sliding`; return the derivatives (m,) N of forces by a member's strain.

        They are zero where a cord slides, as its force depends on all its members.
        """
        strain = length / self.rest_length - 1.0 + self.prestrain
        self.force = np.empty(len(length))
        self.sliding = []
        slope = np.empty(len(length))
        for number, cord in enumerate(self.cords):
            members = self.cord == number
            mesh_share = self.mesh_share[members]
            rest_length = float(mesh_share @ self.rest_length[members])
            slides = not cord.bonded and rest_length > 0
            if slides:
                stretch = mesh_share @ length[members] / rest_length
                strain[members] = stretch - 1.0 + self.prestrain[members]
            self.force[members], slope[members] = cord.table.pull(
                strain[members], cord.tension_only
            )
            if cord.initial_force is not None and not self.is_inflated:
                self.force[members] = self.level * cord.initial_force
                slope[members] = 0.0
            if slides:
                weights = mesh_share[:, None] * self.coefficients[members]
                length_slope = np.zeros(position.shape)
                np.add.at(
                    length_slope,
                    self.nodes[members],
                    weights[..., None] * direction[members, None],
                )
                force_slope = float(slope[members][0]) / rest_length
                self.sliding.append((length_slope.reshape(-1), force_slope))
                slope[members] = 0.0
        return slope

    def slopes(self, position: Array, surface: Array, free: Array) -> Array:
        """Return the derivatives (3 n, k) of the internal forces by k parameters of the sheet.

        Parameters
        ----------
        position : array
            Of the nodes, (n, 3) mm.
        surface, free : array
            Derivatives (n, 3, k) of the reference positions of the nodes, and of their positions in
            the stress-free sheet.
        """
        tangent = self.forces(position)[1]
        vectors = self._vectors(position)
        node_slopes = surface[self.nodes].reshape(len(vectors), 12, -1)
        b = self.coefficients
        rest_length_slopes = np.einsum("mi,mn,mnik->mk", self.rest_direction, b, free[self.nodes])
        # Of the force over the length, which multiplies the vector of a member.
        pull_slopes = -(self.stiffness / self.rest_length)[:, None] * rest_length_slopes
        by_member = tangent @ node_slopes
        by_member += np.einsum("mn,mi,mk->mnik", b, vectors, pull_slopes).reshape(by_member.shape)
        forces = np.zeros(surface.shape)
        np.add.at(forces, self.nodes, by_member.reshape(len(vectors), 4, 3, -1))
        return forces.reshape(-1, surface.shape[-1])


def cords_on(mesh: Mesh, cords: Sequence[Cord], planes: NDArray[np.bool_]) -> Cords | None:
    """Return the members of cords along a tube, whose axis is z with y up; None without cords.

    Parameters
    ----------
    mesh : Mesh
        The tube, or the part of it at x >= 0.
    cords : sequence of Cord
    planes : (n, 3) array of bool
        See `Cavity.planes`.

    Raises
    ------
    InputError
        If only half of the tube is meshed and a cord has no mirror image.
    """
    is_half = bool(planes[:, 0].any())
    p = mesh.points
    members = []
    radius = np.hypot(p[:, 0], p[:, 1])
    distance = np.abs(radius[mesh.quads] - radius.max())
    is_on_tube = (distance < TOLERANCE * radius.max()).all(axis=1)
    for number, cord in enumerate(cords):
        if is_half and not any(_is_mirror_image(cord, other_cord) for other_cord in cords):
            problem = f"{cord.angle:g} degrees needs its mirror image at {360 - cord.angle:g}; "
            raise InputError(None, "cord.angle", problem + 'or take symmetry = "full"')
        if is_half and cord.angle > 180:  # its mirror image lies on the half that is meshed
            continue
        outward = np.array([np.sin(np.radians(cord.angle)), np.cos(np.radians(cord.angle))])
        # The line at the opposite angle has the same distances.
        is_on_side = (p[:, :2] @ outward)[mesh.quads].min(axis=1) > 0
        candidates = np.flatnonzero(is_on_tube & is_on_side)
        aside = p[:, 0] * outward[1] - p[:, 1] * outward[0]
        crossed, b = _crossed(
            aside[mesh.quads[candidates]], p[mesh.quads[candidates], 2], (-np.inf, np.inf)
        )
        is_in_plane = is_half and cord.angle % 180 == 0
        members.append((number, candidates[crossed], b, 0.5 if is_in_plane else 1.0))
    return _members(mesh, cords, members, p)


def cords_on_sheet(model: BubbleModel) -> Cords | None:
    """Return the members of cords along a sheet; None if no cord lies on the part that is meshed.

    InputError if a cord does not cross any quad of a sheet that is meshed as a whole.
    """
    q = model.mesh.quads
    p = model.mesh.points
    members = []
    for number, cord in enumerate(model.cords):
        x, y = (p[:, :2] - cord.ends[0]).T
        length = float(np.linalg.norm(cord.ends[1] - cord.ends[0]))
        c, s = (cord.ends[1] - cord.ends[0]) / length
        aside = c * y - s * x
        along = c * x + s * y
        crossed, b = _crossed(aside[q], along[q], (0.0, length))
        if not len(crossed) and not model.halved:
            raise InputError(
                None, f"cord[{number}].ends", "expected a line on the sheet, not beside it"
            )
        is_in_plane = any(cord.lies_in(axis) for axis in model.halved)
        members.append((number, crossed, b, 0.5 if is_in_plane else 1.0))
    return _members(model.mesh, model.cords, members, model.stress_free)


def _members(
    mesh: Mesh,
    cords: Sequence[Cord | SheetCord],
    pieces: Sequence[tuple[int, Numbers, Array, float]],
    points: Array,
) -> Cords | None:
    """Return the members of all cords, or None without any.

    Parameters
    ----------
    pieces : sequence of (int, array, array, float)
        For each cord its number, the quads that it crosses, the coefficients b_n there and the
        share that belongs to the mesh, see `Cords`.
    points : array
        Of the stress-free sheet, (n, 3) mm.
    """
    if not sum(len(quads) for _, quads, _, _ in pieces):
        return None
    numbers, quads, coefficients, mesh_shares = zip(*pieces, strict=True)
    counts = [len(quads_of_cord) for quads_of_cord in quads]
    quad_numbers = np.concatenate(quads)
    return Cords(
        cords=cords,
        quads=quad_numbers,
        coefficients=np.concatenate(coefficients),
        cord=np.repeat(numbers, counts),
        mesh_share=np.repeat(mesh_shares, counts),
        nodes=mesh.quads[quad_numbers],
        points=points,
    )


def _is_mirror_image(cord: Cord, candidate: Cord) -> bool:
    return abs((cord.angle + candidate.angle) % 360) < TOLERANCE and has_same_force(cord, candidate)


def _crossed(aside: Array, along: Array, ends: tuple[float, float]) -> tuple[Numbers, Array]:
    """Return the quads that a straight line crosses, and the coefficients b_n (m, 4) in each.

    Parameters
    ----------
    aside, along : (q, 4) array, mm
        Signed distance of the nodes of q quads from the line, and their coordinate along it.
    ends : (float, float), mm
        Coordinates along the line at which it begins and ends.
    """
    tolerance = TOLERANCE * np.abs(aside).max()
    # A line along an edge crosses the quads on one of its sides, or the only ones there are.
    for side in (1.0, -1.0):
        is_positive = side * aside > -tolerance
        cut = is_positive != np.roll(is_positive, -1, axis=1)
        crossed = np.flatnonzero(cut.any(axis=1))
        if len(crossed):
            break
    aside = aside[crossed]
    along = along[crossed]
    cut = cut[crossed]
    # Between nodes at distances a and b, the line crosses the edge at the fraction a / (a - b).
    rows = np.arange(len(crossed))
    edge_weights = []
    first_cut = np.argmax(cut, axis=1)
    last_cut = 3 - np.argmax(cut[:, ::-1], axis=1)
    for first in (first_cut, last_cut):
        second = (first + 1) % 4
        a = aside[rows, first]
        b = aside[rows, second]
        fraction = a / (a - b)
        weights = np.zeros(aside.shape)
        weights[rows, first] = 1.0 - fraction
        weights[rows, second] = fraction
        edge_weights.append(weights)
    start, end = np.sort([(weights * along).sum(axis=1) for weights in edge_weights], axis=0)
    length = np.minimum(end, ends[1]) - np.maximum(start, ends[0])
    has_length = length > tolerance
    # Of a member that ends within a quad, the same coefficients for a part of the length.
    part = length[has_length] / (end - start)[has_length]
    coefficients = (edge_weights[1] - edge_weights[0])[has_length] * part[:, None]
    return crossed[has_length], coefficients
