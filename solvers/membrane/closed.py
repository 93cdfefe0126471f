"""A closed membrane: its cavity with gas, contact with bodies, and its start from slackness."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import InputError
from ...materials.law import HypoelasticLaw
from ...meshes.closed_surfaces import volume_and_gradient
from ...meshes.cylinder_model import ClosedGas, InflatedModel, RigidCylinder
from ...meshes.mesh import Array
from .contact import contact_forces
from .cords import cords_on
from .factorisation import BorderedTangent, Tangent, by_near_inverse, tangent_for
from .flexure import Flexure, flexure_of
from .kernel import reference_elements
from .line_search import SETTINGS as LINE_SEARCH
from .line_search import LineSearchSettings, searched_equilibrium
from .membrane import Membrane, arrays_of, initial_stiffness, refuse_memory
from .wall import STIFF, Wall

#: Before a membrane touches bodies, its equilibrium is as near as that of Newton's method.
PRECISE = replace(LINE_SEARCH, tolerance_factor=1.0)
#: From the unloaded state, where the tangent is definite but soft: flat facets carry no pressure.
FROM_SLACK = replace(PRECISE, initial_viscosity=10.0)


@dataclass(frozen=True, eq=False)
class Cavity:
    """The space inside a closed surface, or inside a part of one that symmetry planes close.

    Attributes
    ----------
    quads : (m, 4) ndarray of int
    weight, origin : (3,) ndarray
        See `volume_and_gradient`. A direction that is normal to two symmetry planes, as in a slice
        of a long tube, has the weight zero.
    symmetric : (3,) ndarray of bool
        Whether there is a symmetry plane normal to each axis.
    planes : (n, 3) ndarray of bool
        Whether a node lies on an open edge in a symmetry plane, by the axis normal to the plane.
    """

    quads: NDArray[np.intp]
    weight: Array
    origin: Array
    symmetric: NDArray[np.bool_]
    planes: NDArray[np.bool_]

    def measure(self, position: Array) -> tuple[float, Array]:
        """Return the volume (mm^3) inside the meshed part, and its derivative (3 n,) in mm^2.

        Parameters
        ----------
        position : array
            Of the nodes, (n, 3) mm; the derivative is by these.
        """
        volume, push = volume_and_gradient(position, self.quads, self.weight, self.origin)
        return volume, push.reshape(-1)


def closed_cavity(points: Array, quads: NDArray[np.intp], fixed: NDArray[np.intp]) -> Cavity:
    """Return the cavity inside a surface, with the symmetry planes that close its open edges.

    Parameters
    ----------
    points : (n, 3) array, mm
    quads : (m, 4) array of int
    fixed : (k,) array of int
        Held unknowns, 3 * node + direction.

    Returns
    -------
    Cavity

    Raises
    ------
    InputError
        If an open edge lies in no symmetry plane, that is in no plane normal to an axis along which
        its nodes are held; or if planes close the cavity on all six sides.
    """
    following = np.roll(quads, -1, axis=1)
    sides = np.stack([quads, following], axis=2).reshape(-1, 2)
    edges, count = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
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
        levels = points[border[in_plane[:, k], 0], k]
        if len(levels):
            origin[k] = levels[0]
            weight[k] = float(np.ptp(levels) < 1e-9 * size)
    if not weight.any():
        raise InputError(None, "mesh", "the cavity is closed by planes on all six sides")
    planes = np.zeros(points.shape, dtype=bool)
    for k in range(3):
        planes[border[in_plane[:, k]], k] = True
    return Cavity(quads, weight / weight.sum(), origin, in_plane.any(axis=0), planes)


@dataclass(eq=False, kw_only=True)
class ClosedMembrane(Membrane):
    """A membrane with a cavity; its `tangent` is a `BorderedTangent`.

    Attributes
    ----------
    cavity : Cavity
    wall : Wall
    flexure : Flexure or None
        Bending of the wall.
    line_slot : (h, 144) ndarray of int
        Places in the tangent's data of the stiffness of each triple of `flexure`, as if it were a
        quad of the nodes before, at, after and at.
    full : float, MPa
        Pressure at which cords have their prescribed initial force.
    gas : ClosedGas or None
        Gas of constant mass, by which the volume determines the pressure; None if the pressure is
        prescribed.
    bodies : sequence of RigidCylinder
        Rigid bodies at their present place.
    penalty : float, MPa/mm
        Stiffness of contact with them.
    slack : float, MPa
        Artificial isotropic stress that stiffens the next tangent but is in no residual; every
        tangent reduces it.
    resistance : float, MPa/mm
        Viscosity in the tangent.
    needed_viscosity : float
        The last one that made a tangent positive definite; see `resist`.
    dead : (3 n,) ndarray, N, or None
        Minus the dead loads on the nodes.
    pressure, volume : float, MPa and mm^3
        At the last evaluation; the volume is that inside the meshed part.
    contact : list of (n, 3) ndarray, N
        Forces of each body on the nodes at the last evaluation.
    touched : list of ((t, 3, 3) ndarray, (t,) ndarray)
        Stiffness of the contact with each body, N/mm, and the nodes in contact, at the last
        evaluation with a tangent.
    """

    #: Largest number of corrections of a step for contact that it makes or ends.
    max_contact_corrections: ClassVar[int] = 6
    #: Residual of a step that needs no such correction, as a share of that before the step.
    contact_tolerance: ClassVar[float] = 0.05
    #: Share of the residual after the step as it was up to which a corrected step is taken.
    contact_gain: ClassVar[float] = 0.3

    #: Factor by which the artificial stress of the slack state is reduced in every iteration.
    slack_fade: ClassVar[float] = 0.6
    #: Artificial stresses that are tried in turn, as multiples of that with which the first step of
    #: a flat cap, p R^2/(4 t stress), is as large as its deflection, 0.66 R (p R/(t E))^(1/3); R is
    #: the radius, t the thickness and p the pressure.
    slack_shares: ClassVar[tuple[float, ...]] = (4.0, 0.4, 40.0)

    cavity: Cavity
    wall: Wall = field(default_factory=Wall)
    flexure: Flexure | None = None
    line_slot: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 144), dtype=np.int64))
    full: float = 1.0
    gas: ClosedGas | None = None
    bodies: Sequence[RigidCylinder] = ()
    penalty: float = 5.0
    slack: float = 0.0
    resistance: float = 0.0
    needed_viscosity: float = 0.0
    dead: Array | None = None
    pressure: float = 0.0
    volume: float = 0.0
    contact: list[Array] = field(default_factory=list)
    touched: list[tuple[Array, NDArray[np.intp]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.wrinkle_stiffness = self.wall.wrinkle_stiffness
        self._stiff: tuple[HypoelasticLaw, scipy.sparse.csr_matrix, Array] | None = None
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

    def bending_stiffness(self) -> tuple[scipy.sparse.csr_matrix, Array]:
        """Return the stiffness of the wall's bending: for all unknowns, and for the tangent.

        The first is (3 n, 3 n); the second holds its entries in the tangent's data. Both are kept
        until the law changes.
        """
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
            return self.rest(u, pressure, LINE_SEARCH)
        return super().equilibrium(u, pressure)

    def rest(
        self, u: Array, pressure: float, settings: LineSearchSettings = PRECISE
    ) -> Array | None:
        """Return the stable equilibrium (n, 3) mm to which the membrane descends, or None.

        Parameters
        ----------
        u : array
            Displacement (n, 3) mm to start from, where the membrane may be slack or fold.
        pressure : float
            In MPa; without effect if there is a gas.
        settings : LineSearchSettings
        """
        return searched_equilibrium(self, u, pressure, settings)

    def further_forces(self, u: Array, with_tangent: bool) -> None:
        """Add forces of the wall's bending, cords, dead loads and contact.

        Parameters
        ----------
        u : (nodes, 3) array, mm
            Displacement.
        """
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
            self.slack *= self.slack_fade
        if with_tangent:
            self.resistance = 0.0
        if self.dead is not None:
            self.residual += self.dead
        self._add_contact(u, with_tangent)

    def _add_contact(self, u: Array, with_tangent: bool) -> None:
        """Add the forces of rigid bodies on the nodes, at the displacement u (nodes, 3) mm."""
        self.contact, touched = self._contact_at(u)
        for push in self.contact:
            self.residual -= push.reshape(-1)
        if with_tangent:
            self.touched = touched
            for stiffness, nodes in touched:
                self.add(self.node_slot[nodes], stiffness)

    def _contact_at(self, u: Array) -> tuple[list[Array], list[tuple[Array, NDArray[np.intp]]]]:
        """Return `contact` and `touched` at the displacement u (nodes, 3) mm."""
        forces = []
        touched = []
        for body in self.bodies:
            push, stiffness, nodes = contact_forces(
                body, self.reference + u, self.penalty * self.node_area
            )
            forces.append(push)
            touched.append((stiffness, nodes))
        return forces, touched

    def step_into_contact(self, u: Array, step: Array) -> Array:
        """Return a Newton step, corrected for contact that it makes or ends.

        The residual is linearised but for the contact forces, which are those after the step;
        corrections are Newton's steps with that residual. The tangent gets the contact after the
        step that is returned.

        Parameters
        ----------
        u : (n, 3) array, mm
            Displacement at the last evaluation.
        step : (free,) array, mm

        Returns
        -------
        (free,) array, mm
            The step as it was where it needs no correction, or none is found.
        """
        if not self.bodies:
            return step
        before = self.residual[self.free]
        limit = self.contact_tolerance * float(np.linalg.norm(before))
        linear = before + np.sum(self.contact, axis=0).reshape(-1)[self.free]
        linear += self._times_without_contact(step)
        first_touched = self.touched
        after, touched = self._after_contact(u, step, linear)
        first_error = error = float(np.linalg.norm(after))
        corrected = step
        for _ in range(self.max_contact_corrections):
            if error <= limit:
                break
            self._change_contact(touched)
            correction = by_near_inverse(self.tangent, after, tolerance=0.05)
            # Where the forces do work along it, it leads to an unstable equilibrium.
            if correction is None or float(correction @ after) < 0:
                break
            corrected = corrected - correction
            linear -= self._times_without_contact(correction)
            after, touched = self._after_contact(u, corrected, linear)
            error = float(np.linalg.norm(after))
        if error <= limit or error < self.contact_gain * first_error:
            return corrected
        self._change_contact(first_touched)
        return step

    def _after_contact(
        self, u: Array, step: Array, linear: Array
    ) -> tuple[Array, list[tuple[Array, NDArray[np.intp]]]]:
        """Return the residual (free,) N of a linearised problem after a step, and `touched` there.

        Parameters
        ----------
        u : (n, 3) array, mm
            Displacement before it.
        step, linear : (free,) array, mm and N
            The residual without contact, linearised, is `linear` after the step.
        """
        moved = u.copy()
        moved.reshape(-1)[self.free] += step
        forces, touched = self._contact_at(moved)
        return linear - np.sum(forces, axis=0).reshape(-1)[self.free], touched

    def _change_contact(self, touched: list[tuple[Array, NDArray[np.intp]]]) -> None:
        """Replace the stiffness of contact in the tangent."""
        for sign, contact in ((-1.0, self.touched), (1.0, touched)):
            for stiffness, nodes in contact:
                self.add(self.node_slot[nodes], sign * stiffness)
        self.touched = touched

    def _times_without_contact(self, step: Array) -> Array:
        """Return the tangent without contact times a step (free,) mm, in N."""
        motion = np.zeros(self.reference.shape)
        motion.reshape(-1)[self.free] = step
        product = np.zeros_like(motion)
        for stiffness, nodes in self.touched:
            product[nodes] += np.einsum("tij,tj->ti", stiffness, motion[nodes])
        return self.tangent.times(step[:, None])[:, 0] - product.reshape(-1)[self.free]

    def node_weight(self, weight: float) -> Array:
        """Return the weight (n,) N that each node carries.

        Parameters
        ----------
        weight : float
            Of the thinnest part of the wall, N/mm^2; thicker parts weigh more in proportion.
        """
        point_weight = weight * self.elements.area * (self.section / self.section.min())[:, None]
        shares = np.einsum("mp,pn->mn", point_weight, self.elements.values)
        return np.asarray(np.bincount(self.quads.ravel(), shares.ravel()), dtype=float)

    def resist(self, viscosity: float) -> None:
        """Replace the viscosity in the tangent, which resists every motion.

        Parameters
        ----------
        viscosity : float
            Pressure of the resistance per distance, as a multiple of the pressure in the membrane
            over the size of a typical quad.
        """
        resistance = viscosity * abs(self.pressure) / (2.0 * self.step_limit)
        if resistance != self.resistance:
            added = (resistance - self.resistance) * self.node_area
            self.add(np.einsum("nkk->nk", self.node_slot), added[:, None])
            self.resistance = resistance

    def wrinkled_share(self, sides: NDArray[np.bool_]) -> float:
        """Return the share of a surface that carries no tension in one direction.

        Parameters
        ----------
        sides : (elements,) array of bool
            Whether an element belongs to that surface.
        """
        area = self.elements.area[sides]
        s = self.stress_new[sides]
        smaller_principal = 0.5 * (s[..., 0] + s[..., 1]) - np.hypot(
            0.5 * (s[..., 0] - s[..., 1]), s[..., 2]
        )
        folded = (self.wrinkle[sides] != 0.0).any(axis=2) | (smaller_principal < 0.0)
        return float(area[folded].sum() / area.sum())

    def wrinkle_work(self, wrinkle: Array) -> float:
        """Return the work (N mm) in the meshed part on the stiffness that is left across wrinkles.

        It is that of the present increment, up to the last evaluation.

        Parameters
        ----------
        wrinkle : array
            The attribute of this name, (elements, 4, 3), at the start of the increment.
        """
        if not self.wrinkle_stiffness:
            return 0.0
        stiffness = self.wrinkle_stiffness * initial_stiffness(self.law)
        stress = -0.5 * np.einsum("ij,mpj->mpi", stiffness, self.wrinkle + wrinkle)
        change = self.strain_new - self.wrinkle - (self.strain_old - wrinkle)
        weight = self.elements.area * self.section[:, None]
        return float(np.einsum("mp,mpi,mpi", weight, stress, change))

    def equilibrium_from_slack(self, start: Array, level: float) -> Array | None:
        """Return the equilibrium (n, 3) mm at a pressure (MPa) from a slack state, or None.

        An artificial stress stiffens the slack surface and vanishes in the course of the iteration.

        Parameters
        ----------
        start : array
            Displacement (n, 3) mm to start from.
        """
        modulus = 0.5 * (float(self.law.E1(0.0)) + float(self.law.E2(0.0)))
        area = float((self.elements.area.sum(axis=1) * self.section).sum())
        line = 2.0 * level * self.cavity.measure(self.reference)[0] / area  # p R/t of a tube
        for share in self.slack_shares:
            self.slack = share * float(np.cbrt(modulus * line**2))
            displacement = self.equilibrium(start, level)
            self.slack = 0.0
            if displacement is not None:
                return displacement
        return None


def prepare(
    model: InflatedModel,
    law: HypoelasticLaw,
    tolerance: float,
    wall: Wall | None,
) -> ClosedMembrane:
    """Return the closed membrane of a model; its wall is stiff unless another one is given."""
    return closed_membrane(model, law, tolerance, model.fixed(), wall or STIFF)


def closed_membrane(
    model: InflatedModel,
    law: HypoelasticLaw,
    tolerance: float,
    fixed: NDArray[np.intp],
    wall: Wall,
) -> ClosedMembrane:
    """Return the membrane of a closed surface with its cavity, its bending and its cords.

    Parameters
    ----------
    model : InflatedModel
    law : HypoelasticLaw
    tolerance : float
        See `Membrane`.
    fixed : (k,) array of int
        Held unknowns, 3 * node + direction.
    wall : Wall

    Raises
    ------
    SolverFailure
        If the law has a memory.
    InputError
        If the cavity is open.
    """
    refuse_memory(law, "a closed membrane")
    points, quads = arrays_of(model.mesh)
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
    tangent: Tangent = tangent_for(coupled, points, free, is_tube=True)
    line_slot = tangent.slot[len(quads) :]
    tangent.slot = tangent.slot[: len(quads)]
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
