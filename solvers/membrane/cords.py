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
NEAR = 1e-6


@dataclass(eq=False)
class Cords:
    """The m members of all cords on a mesh.

    Attributes
    ----------
    cords : sequence of Cord or SheetCord
    quads : (m,) ndarray of int
        Quad that each member crosses.
    shares : (m, 4) ndarray
        Coefficients b_n of the quad's nodes in the vector along the member.
    cord : (m,) ndarray of int
        Number of the cord to which each member belongs.
    part : (m,) ndarray
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
    shares: Array
    cord: Numbers
    part: Array
    nodes: Numbers
    points: Array

    def __post_init__(self) -> None:
        self.level = 1.0
        self.force = np.zeros(len(self.quads))
        self.given = np.array([c.initial_force is not None for c in self.cords])[self.cord]
        self.start = np.array([c.prestrain for c in self.cords])[self.cord]
        way = self._vectors(self.points)
        self.rest = np.linalg.norm(way, axis=1)
        self.rest_way = way / self.rest[:, None]
        self.bent = False
        self.sliding: list[tuple[Array, float]] = []

    def _vectors(self, position: Array) -> Array:
        """Return the vector (m, 3) mm of each member by the positions (n, 3) mm of the nodes."""
        return np.einsum("mn,mnk->mk", self.shares, position[self.nodes])

    def begin(self, position: Array) -> None:
        """End the inflation: from here on, cords with a prescribed initial force are strained.

        Parameters
        ----------
        position : array
            Of the nodes in the inflated state, (n, 3) mm; cords have that force there.
        """
        length = np.linalg.norm(self._vectors(position), axis=1)
        has_force = self.given
        self.rest[has_force] = length[has_force]
        strains = [c.table.strain_at(c.initial_force or 0.0) for c in self.cords]
        self.start[has_force] = np.array(strains)[self.cord[has_force]]
        self.bent = True

    def forces(self, position: Array) -> tuple[Array, Array]:
        """Return the internal forces of the members and their derivatives.

        Parameters
        ----------
        position : array
            Of all nodes, (n, 3) mm. The forces are (m, 4 nodes, 3) N, and their derivatives by the
            positions of the same nodes (m, 12, 12) N/mm, without the coupling in `sliding`.
        """
        d = self._vectors(position)
        length = np.linalg.norm(d, axis=1)
        t = d / length[:, None]
        strain = length / self.rest - 1.0 + self.start
        force, slope, self.sliding = np.empty(len(d)), np.empty(len(d)), []
        for i, cord in enumerate(self.cords):
            of_cord = self.cord == i
            rest_length = float(self.part[of_cord] @ self.rest[of_cord])
            if not cord.bonded and rest_length > 0:
                strain[of_cord] = (
                    self.part[of_cord] @ length[of_cord] / rest_length - 1.0 + self.start[of_cord]
                )
            force[of_cord], slope[of_cord] = cord.table.pull(strain[of_cord], cord.tension_only)
            if cord.initial_force is not None and not self.bent:
                force[of_cord] = self.level * cord.initial_force
                slope[of_cord] = 0.0
            if not cord.bonded and rest_length > 0:
                opens = np.zeros(position.shape)
                pulls = (self.part[of_cord, None] * self.shares[of_cord])[..., None] * t[
                    of_cord, None
                ]
                np.add.at(opens, self.nodes[of_cord], pulls)
                self.sliding.append((opens.reshape(-1), float(slope[of_cord][0]) / rest_length))
                slope[of_cord] = 0.0
        self.force = force
        pull, self.steep = self.part * force, self.part * slope / self.rest
        tt = np.einsum("mi,mj->mij", t, t)
        across = (pull / length)[:, None, None] * (np.eye(3) - tt)
        block = self.steep[:, None, None] * tt + across
        b = self.shares
        tangent = np.einsum("mn,mp,mij->mnipj", b, b, block).reshape(-1, 12, 12)
        return np.einsum("mn,m,mk->mnk", b, pull, t), tangent

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
        d = self._vectors(position)
        node_slopes = surface[self.nodes].reshape(len(d), 12, -1)
        longer = np.einsum("mi,mn,mnik->mk", self.rest_way, self.shares, free[self.nodes])
        pull = -(self.steep / self.rest)[:, None] * longer
        by_member = tangent @ node_slopes
        by_member += np.einsum("mn,mi,mk->mnik", self.shares, d, pull).reshape(by_member.shape)
        forces = np.zeros(surface.shape)
        np.add.at(forces, self.nodes, by_member.reshape(len(d), 4, 3, -1))
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
    half = bool(planes[:, 0].any())
    p = mesh.points
    members = []
    radius = np.hypot(p[:, 0], p[:, 1])
    tube = (np.abs(radius[mesh.quads] - radius.max()) < NEAR * radius.max()).all(1)
    for i, cord in enumerate(cords):
        if half and not any(_mirrored(cord, cord_beside) for cord_beside in cords):
            problem = f"{cord.angle:g} degrees needs its mirror image at {360 - cord.angle:g}; "
            raise InputError(None, "cord.angle", problem + 'or take symmetry = "full"')
        if half and cord.angle > 180:
            continue
        up = np.array([np.sin(np.radians(cord.angle)), np.cos(np.radians(cord.angle))])
        candidates = np.flatnonzero(tube & ((p[:, :2] @ up)[mesh.quads].min(axis=1) > 0))
        aside = p[:, 0] * up[1] - p[:, 1] * up[0]
        crossed, b = _crossed(
            aside[mesh.quads[candidates]], p[mesh.quads[candidates], 2], (-np.inf, np.inf)
        )
        members.append((i, candidates[crossed], b, 0.5 if half and cord.angle % 180 == 0 else 1.0))
    return _members(mesh, cords, members, p)


def cords_on_sheet(model: BubbleModel) -> Cords | None:
    """Return the members of cords along a sheet; None if no cord lies on the part that is meshed.

    InputError if a cord does not cross any quad of a sheet that is meshed as a whole.
    """
    q = model.mesh.quads
    p = model.mesh.points
    members = []
    for i, cord in enumerate(model.cords):
        x, y = (p[:, :2] - cord.ends[0]).T
        length = float(np.linalg.norm(cord.ends[1] - cord.ends[0]))
        c, s = (cord.ends[1] - cord.ends[0]) / length
        crossed, b = _crossed((c * y - s * x)[q], (c * x + s * y)[q], (0.0, length))
        if not len(crossed) and not model.halved:
            raise InputError(None, f"cord[{i}].ends", "expected a line on the sheet, not beside it")
        in_plane = any(cord.lies_in(axis) for axis in model.halved)
        members.append((i, crossed, b, 0.5 if in_plane else 1.0))
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
    quad_numbers, shares = (np.concatenate([piece[k] for piece in pieces]) for k in (1, 2))
    counts = [len(quads) for _, quads, _, _ in pieces]
    number, part = (np.repeat([piece[k] for piece in pieces], counts) for k in (0, 3))
    return Cords(
        cords,
        quad_numbers,
        shares,
        number,
        part,
        mesh.quads[quad_numbers],
        points,
    )


def _mirrored(cord: Cord, candidate: Cord) -> bool:
    return abs((cord.angle + candidate.angle) % 360) < NEAR and has_same_force(cord, candidate)


def _crossed(aside: Array, along: Array, ends: tuple[float, float]) -> tuple[Numbers, Array]:
    """Return the quads that a straight line crosses, and the coefficients b_n (m, 4) in each.

    Parameters
    ----------
    aside, along : (q, 4) array, mm
        Signed distance of the nodes of q quads from the line, and their coordinate along it.
    ends : (float, float), mm
        Coordinates along the line at which it begins and ends.
    """
    size = NEAR * np.abs(aside).max()
    # A line along an edge crosses the quads on one of its sides, or the only ones there are.
    for side in (1.0, -1.0):
        is_positive = side * aside > -size
        cut = is_positive != np.roll(is_positive, -1, axis=1)
        crossed = np.flatnonzero(cut.any(axis=1))
        if len(crossed):
            break
    aside = aside[crossed]
    along = along[crossed]
    cut = cut[crossed]
    # From edge to edge: between nodes at asides a and b the line is at a share a / (a - b).
    rows = np.arange(len(crossed))
    places = []
    for first in (np.argmax(cut, axis=1), 3 - np.argmax(cut[:, ::-1], axis=1)):
        second = (first + 1) % 4
        a = aside[rows, first]
        b = aside[rows, second]
        to = a / (a - b)
        place = np.zeros(aside.shape)
        place[rows, first] = 1.0 - to
        place[rows, second] = to
        places.append(place)
    start, end = np.sort([(place * along).sum(axis=1) for place in places], axis=0)
    length = np.minimum(end, ends[1]) - np.maximum(start, ends[0])
    has_length = length > size
    shares = (places[1] - places[0])[has_length] * (
        length / np.where(has_length, end - start, 1.0)
    )[has_length, None]
    return crossed[has_length], shares
