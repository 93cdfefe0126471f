"""Analysis of a long inflated tube in tension and torsion, whose homogeneous wall is one quad."""

from dataclasses import dataclass

import numpy as np

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.mesh import Array
from ...meshes.strip_models import TubeModel
from ..base import History
from .kernel import reference_elements
from .loading import IncrementRecord, RunRequest
from .membrane import Membrane, arrays_of, initial_moduli
from .sensitivity import Derivatives
from .wall import Wall


@dataclass(frozen=True)
class TubeIteration:
    """Settings of Newton's iteration for a homogeneous tube."""

    max_iterations: int = 60
    longest_step: float = 0.1  #: largest change of a strain in one iteration
    #: Residual up to which a state is an equilibrium: these shares of the largest load and of the
    #: largest stiffness, added.
    force_rounding: float = 1e-11
    stiffness_rounding: float = 1e-14


SETTINGS = TubeIteration()


class DenseTangent:
    """Storage for the dense stiffness matrix (12, 12) of one quad, as `assemble` writes it."""

    def __init__(self) -> None:
        self.slot = np.arange(144, dtype=np.int64)[None]
        self.data = np.zeros(144)


def prepare(
    model: TubeModel,
    law: HypoelasticLaw,
    tolerance: float,
    wall: Wall,
) -> Membrane:
    """Return the membrane of the tube, a quad of its wall with no unknown held.

    Parameters
    ----------
    wall : Wall
        Not used.
    """
    points, quads = arrays_of(model.mesh)
    return Membrane(
        points,
        quads,
        reference_elements(points, quads),
        model.thickness,
        law,
        np.arange(12),
        DenseTangent(),  # type: ignore[arg-type]
        tolerance,
        step_limit=np.inf,
    )


def analyse(membrane: Membrane, model: TubeModel, request: RunRequest) -> tuple[History, Array]:
    """Return the history of a homogeneous tube, and the derivatives of its displacements.

    The derivatives (loads, 4, 3, parameters) are found by direct differentiation.

    Raises
    ------
    SolverFailure
        If there is no equilibrium under one of the loads.
    """
    initial_moduli(membrane.law)
    parameters = request.parameters
    tube = HomogeneousTube(membrane, model.radius)
    derivatives = Derivatives(membrane, parameters) if parameters else None
    record = IncrementRecord(membrane, len(model.loads))
    slopes = np.zeros((*record.path.shape, len(parameters)))
    unstable = []
    for i, (pressure, force, torque) in enumerate(model.loads.tolist()):
        if not tube.find_equilibrium(pressure, force, torque):
            load = f"{1e3 * pressure:.4g} kPa, {force:.4g} N and {1e-3 * torque:.4g} N m"
            raise SolverFailure(f"no equilibrium of the tube at {load} (load {i + 1})", "membrane")
        if np.linalg.eigvalsh(tube.stiffness)[0] <= 0:
            unstable.append(f"{1e3 * pressure:.4g} kPa, {force:.4g} N, {1e-3 * torque:.4g} N m")
        u = tube.displacement()
        if derivatives is not None:
            residual_slopes = tube.modes.T @ derivatives.at_fixed_displacement(u) / tube.area
            du = -tube.modes @ np.linalg.solve(tube.stiffness, residual_slopes)
            derivatives.advance(du)
            slopes[i] = du.reshape(4, 3, -1)
        record.accept(i, u)
    history = History(
        model.loads[:, 0],
        record.path,
        record.low,
        record.high,
        iterations=membrane.iterations,
        unstable=tuple(unstable),
    )
    return history, slopes


class HomogeneousTube:
    """Equilibrium of a homogeneous tube in three unknowns.

    They are the stretch a along the tube, the stretch b around it, and the shear s of lines along
    it; the displacement of the patch is linear in them. The potential of the pressure p, the force
    F and the torque T on a tube of the radius R is p R a b^2 / 2 + F a / (2 pi R) +
    T s / (2 pi R^2 b), per area of the undeformed wall.

    Attributes
    ----------
    modes : (12, 3) ndarray, mm
        Displacement of the patch per unit of a - 1, b - 1 and s.
    strains : (3,) ndarray
        Present values of a - 1, b - 1 and s.
    stiffness : (3, 3) ndarray, MPa mm
        Derivative of the residual by these, per area of the undeformed wall, at the last
        evaluation.
    """

    def __init__(self, membrane: Membrane, radius: float) -> None:
        self.membrane = membrane
        self.radius = radius
        points = membrane.reference
        self.area = float(membrane.elements.area.sum())
        self.modes = np.zeros((12, 3))
        self.modes[0::3, 0] = points[:, 0]
        self.modes[1::3, 1] = points[:, 1]
        self.modes[1::3, 2] = points[:, 0]
        self.strains = np.zeros(3)
        self.stiffness = np.zeros((3, 3))

    def displacement(self) -> Array:
        """Return the displacement (4, 3) mm of the patch's corners."""
        return (self.modes @ self.strains).reshape(4, 3)

    def find_equilibrium(
        self,
        pressure: float,
        force: float,
        torque: float,
        settings: TubeIteration = SETTINGS,
    ) -> bool:
        """Find the strains in equilibrium with loads; return whether they are found.

        Parameters
        ----------
        pressure : float, MPa
        force : float, N
            Along the tube.
        torque : float, N mm
        """
        residual = np.full(3, np.inf)
        tolerance = 0.0
        for _ in range(settings.max_iterations):
            self.membrane.unbalance(self.displacement(), 0.0, with_tangent=True)
            push, push_slope = self._loads(pressure, force, torque)
            residual = self.modes.T @ self.membrane.residual / self.area - push
            tangent = self.membrane.tangent.data.reshape(12, 12)
            self.stiffness = self.modes.T @ tangent @ self.modes / self.area - push_slope
            is_finite = np.isfinite(residual).all() and np.isfinite(self.stiffness).all()
            if not (is_finite and self.strains[0] > -1 and self.strains[1] > -1):
                break
            tolerance = settings.force_rounding * np.abs(push).max()
            tolerance += settings.stiffness_rounding * np.abs(self.stiffness).max()
            if np.abs(residual).max() <= tolerance:
                break
            try:
                step = np.linalg.solve(self.stiffness, residual)
            except np.linalg.LinAlgError:
                break
            share = min(1.0, settings.longest_step / np.abs(step).max())
            self.strains = self.strains - share * step
        return bool(np.abs(residual).max() <= tolerance)

    def _loads(self, pressure: float, force: float, torque: float) -> tuple[Array, Array]:
        """Return the generalised loads and their derivatives by the strains, (3,) and (3, 3).

        They are the derivatives of the loads' potential, in MPa mm; see the class.
        """
        radius = self.radius
        twisting = torque / (2 * np.pi * radius**2)
        a = 1.0 + self.strains[0]
        b = 1.0 + self.strains[1]
        s = self.strains[2]
        push = np.array(
            [
                0.5 * pressure * radius * b**2 + force / (2 * np.pi * radius),
                pressure * radius * a * b - twisting * s / b**2,
                twisting / b,
            ]
        )
        ab = pressure * radius * b
        bs = -twisting / b**2
        bb = pressure * radius * a + 2 * twisting * s / b**3
        return push, np.array([[0.0, ab, 0.0], [ab, bb, bs], [0.0, bs, 0.0]])
