"""Cords along a membrane: axial members whose ends are places on the edges of its quads.

A member crosses one quad from edge to edge. Its vector d = sum of b_n x_n over the quad's nodes (b
adds up to zero), so that with l = |d|, t = d / l and the force N(l) its forces on the nodes are
b_n N t, and their derivatives b_n b_m [dN/dl t t' + N/l (1 - t t')]. A cord that slides has one
force, of the length of all its members: dN/dl couples all of them, by one vector (`sliding`).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...meshes.cylinder_model import Cord
from ...meshes.mesh import Array, Mesh, Numbers

#: Of a tube's radius and of an angle in radians: what is rounding.
NEAR = 1e-6


class Cords:
    """Members of cords on a mesh.

    quads (m,): the quad of each; shares (m, 4): b_n; cord (m,): its number; part (m,): 1/2 where it
    lies in a plane of symmetry. level : share of the full pressure, by which initial forces rise.
    force (m,) N: of whole cords at the last evaluation. sliding : of each cord that slides, the
    derivative (3 n,) of its length by the positions, and that of its force by it, N/mm.
    """

    def __init__(
        self, cords: Sequence[Cord], quads: Numbers, shares: Array, cord: Numbers, part: Array,
        nodes: Numbers, points: Array,
    ) -> None:  # fmt: skip
        self.cords, self.quads, self.shares = list(cords), quads, shares
        self.cord, self.part, self.nodes = cord, part, nodes
        self.level, self.force = 1.0, np.zeros(len(quads))
        self.given = np.array([c.initial_force is not None for c in cords])[cord]
        self.start = np.array([c.prestrain for c in cords])[cord]
        self.rest = np.linalg.norm(self._vectors(points), axis=1)
        self.bent = False
        self.sliding: list[tuple[Array, float]] = []

    def _vectors(self, position: Array) -> Array:
        return np.asarray(np.einsum("mn,mnk->mk", self.shares, position[self.nodes]))

    def begin(self, position: Array) -> None:
        """Begin to strain cords with an initial force, from the inflated `position` (n, 3) on."""
        length, given = np.linalg.norm(self._vectors(position), axis=1), self.given
        self.rest[given] = length[given]
        strains = [c.table.strain_at(c.initial_force or 0.0) for c in self.cords]
        self.start[given] = np.array(strains)[self.cord[given]]
        self.bent = True

    def forces(self, position: Array) -> tuple[Array, Array]:
        """Return forces (m, 4, 3) N that resist on the nodes, and their derivative (m, 12, 12)."""
        d = self._vectors(position)
        length = np.linalg.norm(d, axis=1)
        t = d / length[:, None]
        strain = length / self.rest - 1.0 + self.start
        force, slope, self.sliding = np.empty(len(d)), np.empty(len(d)), []
        for i, cord in enumerate(self.cords):
            own = self.cord == i
            rest = float(self.part[own] @ self.rest[own])
            if not cord.bonded and rest > 0:
                strain[own] = self.part[own] @ length[own] / rest - 1.0 + self.start[own]
            force[own], slope[own] = cord.table.pull(strain[own], cord.tension_only)
            if cord.initial_force is not None and not self.bent:
                force[own], slope[own] = self.level * cord.initial_force, 0.0
            if not cord.bonded and rest > 0:
                opens = np.zeros(position.shape)
                pulls = (self.part[own, None] * self.shares[own])[..., None] * t[own, None]
                np.add.at(opens, self.nodes[own], pulls)
                self.sliding.append((opens.reshape(-1), float(slope[own][0]) / rest))
                slope[own] = 0.0
        self.force = force
        pull, steep = self.part * force, self.part * slope / self.rest
        tt = np.einsum("mi,mj->mij", t, t)
        across = (pull / length)[:, None, None] * (np.eye(3) - tt)
        block = steep[:, None, None] * tt + across
        b = self.shares
        tangent = np.einsum("mn,mp,mij->mnipj", b, b, block).reshape(-1, 12, 12)
        return np.einsum("mn,m,mk->mnk", b, pull, t), tangent


def cords_on(mesh: Mesh, cords: Sequence[Cord], planes: NDArray[np.bool_]) -> Cords | None:
    """Return the members of cords along the tube (z its axis, y up); None without cords.

    planes : (n, 3) whether an open edge at the node lies in a plane of symmetry, by its normal.
    Raises InputError : on half of a tube, a cord without its mirror image.
    """
    if not cords:
        return None
    half = bool(planes[:, 0].any())
    quads, shares, number, part = [], [], [], []
    p = mesh.points
    radius = np.hypot(p[:, 0], p[:, 1])
    tube = np.flatnonzero((np.abs(radius[mesh.quads] - radius.max()) < NEAR * radius.max()).all(1))
    for i, cord in enumerate(cords):
        if half and not any(_mirrored(cord, other) for other in cords):
            problem = f"{cord.angle:g} degrees needs its mirror image at {360 - cord.angle:g}; "
            raise InputError(None, "cord.angle", problem + 'or take symmetry = "full"')
        if half and cord.angle > 180:
            continue
        own, b = _crossed(p, mesh.quads, tube, np.radians(cord.angle))
        quads.append(own)
        shares.append(b)
        number.append(np.full(len(own), i))
        lies_in_plane = half and cord.angle % 180 == 0
        part.append(np.full(len(own), 0.5 if lies_in_plane else 1.0))
    which = np.concatenate(quads)
    return Cords(
        cords, which, np.concatenate(shares), np.concatenate(number), np.concatenate(part),
        mesh.quads[which], p,
    )  # fmt: skip


def _mirrored(cord: Cord, other: Cord) -> bool:
    names = ("initial_force", "prestrain", "tension_only", "bonded")
    same = all(getattr(cord, name) == getattr(other, name) for name in names)
    turned = abs((cord.angle + other.angle) % 360) < NEAR
    one, two = ([own.table.strain, own.table.force] for own in (cord, other))
    return turned and same and np.array_equal(one, two)


def _crossed(p: Array, quads: Numbers, tube: Numbers, angle: float) -> tuple[Numbers, Array]:
    """Return the quads of the tube that a line along z crosses, and b_n (m, 4) of each."""
    direction = np.array([np.sin(angle), np.cos(angle)])
    corners = p[quads[tube]]
    along = corners[..., :2] @ direction
    aside = corners[..., 0] * direction[1] - corners[..., 1] * direction[0]
    size = NEAR * np.abs(aside).max()
    low, high = aside.min(axis=1), aside.max(axis=1)
    # A line along an edge crosses the quads on one of its sides, or the only ones there are.
    inside = (along.min(axis=1) > 0) & (low < -size) & (high > -size)
    if not inside.any():
        inside = (along.min(axis=1) > 0) & (low < size) & (high > size)
    crossed, aside = tube[inside], aside[inside]
    z = p[quads[crossed]][..., 2]
    ahead = z > z.mean(axis=1)[:, None]
    shares = np.empty(z.shape)
    for end, sign in ((ahead, 1.0), (~ahead, -1.0)):
        # Two nodes to an end, at asides a and b: the line is at a share a / (a - b) from the first.
        first = np.argmax(end, axis=1)
        second = 3 - np.argmax(end[:, ::-1], axis=1)
        rows = np.arange(len(aside))
        a, b = aside[rows, first], aside[rows, second]
        to = a / (a - b)
        shares[rows, first], shares[rows, second] = sign * (1.0 - to), sign * to
    return crossed, shares
