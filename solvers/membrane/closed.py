"""A membrane around a cavity: gas pressure, start from the slack state, rigid bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...models.gas import ClosedGas
from ...models.inflated import RigidCylinder
from .bordered import BorderedTangent
from .cavity import Cavity
from .contact import contact_forces
from .flexure import Flexure
from .line_search import searched_equilibrium
from .newton import Membrane, initial_stiffness
from .wall import Wall

Array = NDArray[np.float64]

#: The slack state's artificial stiffness is multiplied by this in every iteration.
FADE = 0.6
#: Artificial stress of the slack state, as multiples of what makes the first step as large as the
#: answer for a flat part (a cap): it bulges by h = 0.66 R (s/E)^(1/3), s = p R/t, and under the
#: artificial stress alone it would by p R^2/(4 t stress).
SLACK_SHARES = (4.0, 0.4, 40.0)


@dataclass(eq=False, kw_only=True)
class ClosedMembrane(Membrane):
    """A membrane with a cavity. `tangent` is a `BorderedTangent`.

    gas : where given, the pressure follows from the volume and the level asked for is ignored.
    bodies, penalty : rigid bodies at their present place, and their stiffness in MPa/mm.
    slack : MPa of artificial isotropic stress in the next tangent; it fades with every tangent
        and is in no residual, so that no equilibrium depends on it.
    viscosity, anchor : MPa/mm times the distance (n, 3) from there resists; see `drag`.
    flexure, line_slot : the lines of the mesh that resist bending, if any do, and the places
        (lines, 144) of their stiffness in the tangent, each a quad of before, node, after, node.
    pressure, volume : at the last evaluation.
    """

    cavity: Cavity
    wall: Wall = field(default_factory=Wall)
    flexure: Flexure | None = None
    line_slot: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 144), dtype=np.int64))
    gas: ClosedGas | None = None
    bodies: Sequence[RigidCylinder] = ()
    penalty: float = 5.0
    slack: float = 0.0
    viscosity: float = 0.0
    anchor: Array = field(init=False)
    pressure: float = 0.0
    volume: float = 0.0
    contact: list[Array] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.wrinkle_stiffness = self.wall.wrinkle_stiffness
        self._stiff: tuple[HypoelasticLaw, sp.csr_matrix, Array] | None = None
        e, dn = self.elements, self.elements.slopes
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
        """Of all unknowns, and what it adds to the tangent's data; anew where the law is new."""
        assert self.flexure is not None
        if self._stiff is None or self._stiff[0] is not self.law:
            added = np.zeros(len(self.tangent.data))
            slot = self.line_slot.reshape(-1, 4, 3, 4, 3)[:, :3, :, :3]
            values = self.flexure.stiffness(self.law)
            for k in range(3):
                places = slot[:, :, k, :, k]
                inside = places >= 0
                np.add.at(added, places[inside], values[:, k][inside])
            self._stiff = (self.law, self.flexure.matrix(self.law, len(self.reference)), added)
        return self._stiff[1], self._stiff[2]

    def equilibrium(self, u: Array, pressure: float) -> Array | None:
        """As of any membrane; with a line search where rigid bodies may touch it."""
        if self.bodies:
            return searched_equilibrium(self, u, pressure)
        return super().equilibrium(u, pressure)

    def further_forces(self, u: Array, with_tangent: bool) -> None:
        if self.flexure is not None:
            matrix, added = self.bending_stiffness()
            self.residual += matrix @ (self.reference + u).reshape(-1)
            if with_tangent:
                self.tangent.data += added
        if with_tangent and self.slack > 0:
            self._add(self.axis_slot, self.slack * self.isotropic[..., None])
            self.slack *= FADE
        if self.viscosity > 0:
            drag = self.viscosity * self.node_area[:, None]
            self.residual += (drag * (u - self.anchor)).reshape(-1)
            if with_tangent:
                self._add(self.node_slot, drag[:, None] * np.eye(3))
        self.contact = []
        for body in self.bodies:
            push, stiffness, touched = contact_forces(
                body, self.reference + u, self.penalty * self.node_area
            )
            self.residual -= push.reshape(-1)
            self.contact.append(push)
            if with_tangent:
                self._add(self.node_slot[touched], stiffness)

    def drag(self, viscosity: float, anchor: Array) -> None:
        """Resist (MPa/mm) every motion away from the displacement `anchor` (n, 3), or no more."""
        self.viscosity, self.anchor = viscosity, anchor

    def wrinkled_share(self, sides: NDArray[np.bool_]) -> float:
        """Share of the reference surface of `sides` (elements,) without tension in a direction.

        There a wall without bending stiffness wrinkles.
        """
        area, s = self.elements.area[sides], self.stress_new[sides]
        least = 0.5 * (s[..., 0] + s[..., 1]) - np.hypot(0.5 * (s[..., 0] - s[..., 1]), s[..., 2])
        folded = (self.wrinkle[sides] != 0.0).any(axis=2) | (least < 0.0)
        return float(area[folded].sum() / area.sum())

    def wrinkle_work(self, wrinkle: Array) -> float:
        """Work (N mm, of the meshed part) done on what stiffness is left to the wrinkles.

        From the last `accept` (before the next one), where they were `wrinkle` (elements, 4, 3),
        to the last evaluation.
        """
        if not self.wrinkle_stiffness:
            return 0.0
        stiffness = self.wrinkle_stiffness * initial_stiffness(self.law)
        stress = -0.5 * np.einsum("ij,mpj->mpi", stiffness, self.wrinkle + wrinkle)
        change = self.strain_new - self.wrinkle - (self.strain_old - wrinkle)
        weight = self.elements.area * self.section[:, None]
        return float(np.einsum("mp,mpi,mpi", weight, stress, change))

    def _add(self, slot: NDArray[np.int64], entries: Array) -> None:
        slot, entries = np.broadcast_arrays(slot, entries)
        inside = slot >= 0
        np.add.at(self.tangent.data, slot[inside], entries[inside])

    def equilibrium_from_slack(self, start: Array, level: float) -> Array | None:
        """Equilibrium from a start with slack parts: with an artificial stress, which fades."""
        modulus = 0.5 * (float(self.law.E1(0.0)) + float(self.law.E2(0.0)))
        area = float((self.elements.area.sum(axis=1) * self.section).sum())
        line = 2.0 * level * self.cavity.measure(self.reference)[0] / area  # p R/t of a tube
        for share in SLACK_SHARES:
            self.slack = share * float(np.cbrt(modulus * line**2))
            found = self.equilibrium(start, level)
            self.slack = 0.0
            if found is not None:
                return found
        return None
