"""A membrane around a cavity: gas pressure, start from the slack state, rigid bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...models.gas import ClosedGas
from ...models.inflated import RigidCylinder
from .cavity import Cavity
from .contact import contact_forces
from .factorisation import Tangent
from .newton import Membrane, initial_moduli

Array = NDArray[np.float64]

#: The slack state's artificial stiffness is multiplied by this in every iteration.
FADE = 0.6
#: Artificial stress of the slack state, as multiples of what makes the first step as large as the
#: answer for a flat part (a cap): it bulges by h = 0.66 R (s/E)^(1/3), s = p R/t, and under the
#: artificial stress alone it would by p R^2/(4 t stress).
SLACK_SHARES = (4.0, 0.4, 40.0)


class BorderedTangent:
    """A sparse tangent plus c v v', solved by Sherman and Morrison's formula.

    A gas couples all nodes: dp/du = -c v with v = dV/du, which would fill the matrix.
    """

    def __init__(self, inner: Tangent) -> None:
        self.inner, self.data, self.slot = inner, inner.data, inner.slot
        self.stiffness, self.border = 0.0, np.empty(0)

    def factor(self, judge: bool = False) -> bool:
        """Factorise the sparse part; `judge` looks at that part only (the rest is positive)."""
        good = self.inner.factor(judge)
        self.answer = self.inner.solve(self.border) if self.stiffness else self.border
        return good

    def solve(self, rhs: Array) -> Array:
        x = self.inner.solve(rhs)
        if not self.stiffness:
            return x
        share = self.stiffness / (1.0 + self.stiffness * float(self.border @ self.answer))
        across = np.tensordot(self.border, x, axes=1)
        return np.asarray(x - share * np.multiply.outer(self.answer, across))


@dataclass(eq=False, kw_only=True)
class ClosedMembrane(Membrane):
    """A membrane with a cavity. `tangent` is a `BorderedTangent`.

    gas : where given, the pressure follows from the volume and the level asked for is ignored.
    bodies, penalty : rigid bodies at their present place, and their stiffness in MPa/mm.
    slack : MPa of artificial isotropic stress in the next tangent; it fades with every tangent
        and is in no residual, so that no equilibrium depends on it.
    pressure, volume : at the last evaluation.
    """

    cavity: Cavity
    gas: ClosedGas | None = None
    bodies: Sequence[RigidCylinder] = ()
    penalty: float = 5.0
    slack: float = 0.0
    pressure: float = 0.0
    volume: float = 0.0
    contact: list[Array] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__post_init__()
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

    def further_forces(self, u: Array, with_tangent: bool) -> None:
        if with_tangent and self.slack > 0:
            self._add(self.axis_slot, self.slack * self.isotropic[..., None])
            self.slack *= FADE
        self.contact = []
        for body in self.bodies:
            push, stiffness, touched = contact_forces(
                body, self.reference + u, self.penalty * self.node_area
            )
            self.residual -= push.reshape(-1)
            self.contact.append(push)
            if with_tangent:
                self._add(self.node_slot[touched], stiffness)

    def wrinkled_share(self, wall: NDArray[np.bool_]) -> float:
        """Share of the reference surface of `wall` (elements,) without stress in one direction."""
        area = self.elements.area[wall]
        folded = (self.wrinkle[wall] != 0.0).any(axis=2)
        return float(area[folded].sum() / area.sum())

    def wrinkle_work(self, wrinkle: Array) -> float:
        """Work (N mm, of the meshed part) done on what stiffness is left to the wrinkles.

        From the last `accept` (before the next one), where they were `wrinkle` (elements, 4, 3),
        to the last evaluation.
        """
        if not self.wrinkle_stiffness:
            return 0.0
        e1, e2, g12 = initial_moduli(self.law)
        nu = self.law.nu12
        whole = 1.0 / (1.0 - nu**2 * e2 / e1)
        stiffness = self.wrinkle_stiffness * np.array(
            [
                [e1 * whole, nu * e2 * whole, 0.0],
                [nu * e2 * whole, e2 * whole, 0.0],
                [0.0, 0.0, g12],
            ]
        )
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
