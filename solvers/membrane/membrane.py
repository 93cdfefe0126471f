"""A membrane of quads during an increment: its strain, stress, residual force and tangent.

Strain and stress become the start of the next increment only where a load of the model is reached,
so that the result does not depend on the intermediate steps by which it was found. Laws that an
analysis cannot apply, as without stiffness at zero strain, are refused.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.mesh import Mesh
from .cords import Cords
from .factorisation import SingularTangent, Tangent
from .kernel import Elements, ReferenceElements, State, System, Wrinkling, assemble
from .newton import NewtonIteration, NewtonSettings

Array = NDArray[np.float64]


@dataclass(eq=False)
class Membrane:
    """A membrane, with its strain and stress at the start and at the end of an increment.

    Attributes
    ----------
    reference : (n, 3) ndarray, mm
        Positions of the nodes, to which displacements are added.
    quads : (m, 4) ndarray of int
    elements : ReferenceElements
        Shape functions of the quads on the stress-free surface.
    thickness : float or (m,) ndarray, mm
        Thickness as it was given.
    section : (m,) ndarray, mm
        Thickness of each quad.
    law : HypoelasticLaw
    free : (f,) ndarray of int
        Numbers of the free unknowns, 3 * node + direction.
    tangent : Tangent
        Stiffness matrix of the free unknowns.
    tolerance : float
        Ratio of the largest residual force to the largest pressure force below which the membrane
        is in equilibrium.
    step_limit : float, mm
        Largest nodal correction of one iteration.
    keep_tangent : bool
        Whether the tangent is assembled at the end of every increment.
    iterations : int
        Number of evaluations of the residual.
    wrinkle_stiffness : float or None
        Share of the stiffness that is left across wrinkles; None if the membrane carries
        compression.
    cords : Cords or None
        Cords along the membrane.
    newton : NewtonSettings
    strain_old, strain_new : (m, 4, law.state) ndarray
        Log strain (eps1, eps2, gamma12), and what a law with a memory adds to it, at the Gauss
        points at the start of the increment and at the last evaluation.
    stress_old, stress_new : (m, 4, 3) ndarray, MPa
        Cauchy stress (warp, fill, shear) at the same instants.
    wrinkle : (m, 4, 3) ndarray
        Strain of the fabric less that of the mean surface, at the last evaluation.
    residual : (3 n,) ndarray, N
        Internal less external forces at the last evaluation.
    """

    reference: Array
    quads: NDArray[np.intp]
    elements: ReferenceElements
    thickness: float | Array
    law: HypoelasticLaw
    free: NDArray[np.intp]
    tangent: Tangent
    tolerance: float
    step_limit: float
    keep_tangent: bool = False
    iterations: int = 0
    wrinkle_stiffness: float | None = None
    cords: Cords | None = None
    newton: NewtonSettings = field(default_factory=NewtonSettings)
    wrinkle: Array = field(init=False)
    section: Array = field(init=False)
    strain_old: Array = field(init=False)
    stress_old: Array = field(init=False)
    strain_new: Array = field(init=False)
    stress_new: Array = field(init=False)
    residual: Array = field(init=False)

    def __post_init__(self) -> None:
        shape = (len(self.quads), 4, 3)
        state = (len(self.quads), 4, self.law.state)
        self.section = np.array(np.broadcast_to(self.thickness, len(self.quads)), dtype=float)
        self.strain_old = np.zeros(state)
        self.stress_old = np.zeros(shape)
        self.strain_new = np.zeros(state)
        self.stress_new = np.zeros(shape)
        self.wrinkle = np.zeros(shape)
        self.residual = np.zeros(3 * len(self.reference))

    @property
    def compiled_elements(self) -> Elements:
        """Return the elements in the form that the compiled functions take."""
        e = self.elements
        return Elements(self.quads, e.values, e.slopes, e.area, self.section)

    def unbalance(self, u: Array, pressure: float, with_tangent: bool) -> float:
        """Evaluate the residual and the stress, and the tangent if `with_tangent`.

        Parameters
        ----------
        u : (n, 3) array, mm
            Displacement.
        pressure : float, MPa
        with_tangent : bool

        Returns
        -------
        float
            Ratio of the largest residual of a free unknown to the largest pressure force (without a
            pressure: to the largest reaction); inf where a point has no valid stress.
        """
        wrinkling = None
        if self.wrinkle_stiffness is not None:
            wrinkling = Wrinkling(self.wrinkle_stiffness, self.wrinkle)
        force = assemble(
            self.reference + u,
            self.compiled_elements,
            pressure,
            self.law.compiled,
            State(self.strain_old, self.stress_old),
            State(self.strain_new, self.stress_new),
            System(self.tangent.slot, self.tangent.data, self.residual),
            with_tangent,
            wrinkling,
        )
        self.iterations += 1
        if force < 0:
            return np.inf
        self.further_forces(u, with_tangent)
        if force == 0.0:  # no pressure: reactions of the prescribed unknowns are the measure
            force = float(np.abs(self.residual).max()) or 1.0
        ratio = float(np.abs(self.residual[self.free]).max()) / force
        return ratio if np.isfinite(ratio) else np.inf

    def further_forces(self, u: Array, with_tangent: bool) -> None:
        """Add the forces other than stress and pressure to the residual and the tangent.

        In a `Membrane` these are the forces of cords; subclasses add others.

        Parameters
        ----------
        u : (nodes, 3) array, mm
            Displacement.
        """
        if self.cords is None:
            return
        pull, stiff = self.cords.forces(self.reference + u)
        np.add.at(self.residual.reshape(-1, 3), self.cords.nodes, pull)
        if with_tangent:
            self.add(self.tangent.slot[self.cords.quads], stiff.reshape(-1, 144))
            tangent = self.tangent
            for length_slope, force_slope in self.cords.sliding:
                tangent = tangent.inner  # type: ignore[attr-defined]
                tangent.border = length_slope[self.free]
                tangent.stiffness = force_slope

    def add(self, slot: NDArray[np.int64], entries: Array) -> None:
        """Add entries to the tangent's data at the places `slot`; a place of -1 is left out.

        Places are -1 where an entry belongs to an unknown that is held.
        """
        slot, entries = np.broadcast_arrays(slot, entries)
        is_free = slot >= 0
        np.add.at(self.tangent.data, slot[is_free], entries[is_free])

    def accept(self) -> None:
        """End the increment: strain and stress as last evaluated start the next one."""
        self.strain_old[:] = self.strain_new
        self.stress_old[:] = self.stress_new

    def factor(self) -> None:
        """Factorise the assembled tangent; SolverFailure at a limit point.

        It needs the tangent that is kept where `keep_tangent` is True.
        """
        try:
            self.tangent.factor()
        except SingularTangent:
            raise SolverFailure("the tangent is singular: a limit point") from None

    def equilibrium(self, u: Array, pressure: float) -> Array | None:
        """Return the displacement (n, 3) mm in equilibrium at a pressure, or None.

        Parameters
        ----------
        u : array
            Displacement (n, 3) mm to start the iteration from.
        pressure : float
            In MPa.
        """
        return NewtonIteration(self, u, pressure, self.newton, self.law.jumps).run()


def arrays_of(mesh: Mesh) -> tuple[Array, NDArray[np.int64]]:
    """Return points (n, 3) and quads (m, 4) of a mesh in the types of compiled functions."""
    points = np.array(mesh.points, dtype=float)
    return points, np.ascontiguousarray(mesh.quads, dtype=np.int64)


def initial_moduli(law: HypoelasticLaw) -> tuple[float, float, float]:
    """Return the moduli E1, E2, G12 (MPa) at zero strain.

    SolverFailure if one of them is not positive, since then there is no equilibrium.
    """
    e1, e2, g12 = (float(modulus(0.0)) for modulus in (law.E1, law.E2, law.G12))
    if not min(e1, e2, g12) > 0:
        raise SolverFailure(
            "no equilibrium at all: E1, E2, G12 at zero strain are "
            f"{e1:.3g}, {e2:.3g}, {g12:.3g} MPa and must be positive"
        )
    return e1, e2, g12


def initial_stiffness(law: HypoelasticLaw) -> NDArray[np.float64]:
    """Return the plane stress stiffness (3, 3) at zero strain, MPa; fails as `initial_moduli`."""
    initial_moduli(law)
    none = np.zeros(3)
    _, tangent = law.increment(none, none, none)
    return tangent[0]


def refuse_memory(law: HypoelasticLaw, description: str) -> None:
    """Raise SolverFailure if a law has a memory, for an analysis that cannot take it into account.

    Parameters
    ----------
    description : str
        The analysis in words, for the message.
    """
    if law.memory is not None:
        losses = "unloading, permanent set and hysteresis are lost"
        raise SolverFailure(
            f"{description} takes no law with a memory ({losses}): use the card without it"
        )
