"""Analysis of an inflated tube in bending by beam elements with shear and large rotations.

Reissner's beam theory, with plane sections. At the length s along the undeformed axis, (Z, Y) is
the position of the deformed axis (Z along the tube, Y up) and a the rotation of the section. The
axial strain e, the shear g and the curvature a', from 1 + e = Z' cos a + Y' sin a and
g = Y' cos a - Z' sin a, are conjugate to the axial force N, the shear force V and the moment M of a
section (`meshes/beam_model.py`). Elements are linear with one integration point, so that they do
not lock in shear.

Half of the beam is analysed, from mid-span to its support. The support is a roller at the distance
h = `roller_below` under the axis, at Z + h sin a, and of constant height; its reaction is the
Lagrange multiplier of this constraint, and acts on the beam with the moment h sin a times the
reaction. The deflection of mid-span is prescribed, and the load is an unknown.
"""

from itertools import pairwise

import numpy as np

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import BeamModel
from ...meshes.mesh import Array
from ...notes import Note
from ..base import EARLY, History
from .loading import RunRequest


class Beam:
    """Finite element model of half of a beam.

    Its state x is a vector of Z - s, Y (mm) and the rotation (rad) of each node in turn, followed
    by the reaction of the roller and the load (N).
    """

    max_iterations = 30  #: largest number of Newton's iterations for one deflection
    max_halvings = 6  #: how often a step of deflection may be halved

    def __init__(self, model: BeamModel, tolerance: float) -> None:
        self.model = model
        self.tolerance = tolerance
        self.s = _axis_nodes(model)
        self.length = np.diff(self.s)
        count = 3 * len(self.s)
        self.unknowns = 3 * np.arange(len(self.length))[:, None] + np.arange(6)
        self.load = np.zeros(count)
        self.load[1::3] = -0.5 * _load_shares(model, self.s)
        self.weight = np.zeros(count)
        for nodes in (slice(None, -1), slice(1, None)):
            self.weight[1::3][nodes] -= 0.5 * model.weight * self.length
        self.free = np.setdiff1d(np.arange(count + 2), [0, 2])
        self.iterations = 0

    def residual(self, x: Array, deflection: float | None) -> tuple[Array, Array]:
        """Return the residual (n,) of the equations at the state x (n,), and its tangent (n, n).

        Parameters
        ----------
        deflection : float or None
            Of mid-span in mm, which is prescribed; None if instead the load is zero.
        """
        model = self.model
        count = 3 * len(self.s)
        q = x[:count].reshape(-1, 3)
        load = x[count + 1]
        z_slope = 1.0 + np.diff(q[:, 0]) / self.length
        y_slope = np.diff(q[:, 1]) / self.length
        rotation = 0.5 * (q[1:, 2] + q[:-1, 2])
        curvature = np.diff(q[:, 2]) / self.length
        cos = np.cos(rotation)
        sin = np.sin(rotation)
        stretch = z_slope * cos + y_slope * sin
        shear = y_slope * cos - z_slope * sin
        normal, moment, stiff = model.section.resultants(stretch - 1.0, curvature)
        shear_stiffness = model.section.shear
        self.strains = (stretch - 1.0, curvature)
        # Derivatives of (e, g, a') by (Z', Y', a, a').
        strain_slope = np.zeros((len(cos), 3, 4))
        strain_slope[:, 0, 0] = cos
        strain_slope[:, 0, 1] = sin
        strain_slope[:, 0, 2] = shear
        strain_slope[:, 1, 0] = -sin
        strain_slope[:, 1, 1] = cos
        strain_slope[:, 1, 2] = -stretch
        strain_slope[:, 2, 3] = 1.0
        # Of a section: (N, V, M) and their derivatives by (e, g, a').
        force = np.stack([normal, shear_stiffness * shear, moment], axis=1)
        section = np.zeros((len(cos), 3, 3))
        section[:, ::2, ::2] = stiff
        section[:, 1, 1] = shear_stiffness
        inner = np.einsum("eai,eab,ebj->eij", strain_slope, section, strain_slope)
        n = force[:, 0]
        v = force[:, 1]
        # The second derivatives of e and g, times the forces.
        for i, change in ((0, -n * sin - v * cos), (1, n * cos - v * sin)):
            inner[:, i, 2] += change
            inner[:, 2, i] += change
        inner[:, 2, 2] += -n * stretch - v * shear
        modes = self._element_modes()
        local = np.einsum("e,eka,eik,ei->ea", self.length, modes, strain_slope, force)
        element = np.einsum("e,eka,ekl,elb->eab", self.length, modes, inner, modes)
        r: Array = np.zeros(count + 2)
        matrix: Array = np.zeros((count + 2, count + 2))
        np.add.at(r, self.unknowns, local)
        np.add.at(matrix, (self.unknowns[:, :, None], self.unknowns[:, None, :]), element)
        r[:count] -= self.weight + load * self.load
        matrix[:count, count + 1] = -self.load
        self._add_roller(x, r, matrix)
        if deflection is None:
            r[count + 1] = load
            matrix[count + 1, count + 1] = 1.0
        else:
            r[count + 1] = -q[0, 1] - deflection
            matrix[count + 1, 1] = -1.0
        return r, matrix

    def _element_modes(self) -> Array:
        """Return the derivatives (elements, 4, 6) of (Z', Y', a, a') by an element's unknowns."""
        modes = np.zeros((len(self.length), 4, 6))
        for k in range(2):
            modes[:, k, k] = -1 / self.length
            modes[:, k, 3 + k] = 1 / self.length
        modes[:, 2, 2] = 0.5
        modes[:, 2, 5] = 0.5
        modes[:, 3, 2] = -1 / self.length
        modes[:, 3, 5] = 1 / self.length
        return modes

    def _add_roller(self, x: Array, r: Array, matrix: Array) -> None:
        """Add the roller's reaction and constraint to the residual and the tangent.

        Parameters
        ----------
        x, r : (n,) array
            The state, and its residual, which is written.
        matrix : (n, n) array
            The tangent, which is written.
        """
        count = 3 * len(self.s)
        reaction = x[count]
        height = x[count - 2]
        angle = x[count - 1]
        h = self.model.roller_below
        r[count - 2] += reaction
        r[count - 1] += reaction * h * np.sin(angle)
        matrix[count - 1, count - 1] += reaction * h * np.cos(angle)
        r[count] = height + h * (1.0 - np.cos(angle))
        for row, value in ((count - 2, 1.0), (count - 1, h * np.sin(angle))):
            matrix[row, count] = value
            matrix[count, row] = value

    def equilibrium(self, x: Array, deflection: float | None) -> Array | None:
        """Return the state in equilibrium at a deflection of mid-span (mm), or None.

        Parameters
        ----------
        x : array
            State to start Newton's iteration from.
        deflection : float or None
            None for no load.
        """
        x = x.copy()
        free = self.free
        for _ in range(self.max_iterations):
            r, k = self.residual(x, deflection)
            self.iterations += 1
            scale = self.model.pressure * np.pi * self.model.section.radius**2
            if not np.isfinite(r).all():
                return None
            if np.abs(r[free]).max() < self.tolerance * max(scale, 1.0):
                return x
            try:
                x[free] -= np.linalg.solve(k[np.ix_(free, free)], r[free])
            except np.linalg.LinAlgError:
                return None
        return None

    def reach(
        self,
        x: Array,
        deflection: float,
        target: float,
        halvings: int | None = None,
    ) -> Array | None:
        """Return the state at the deflection `target` (mm), in several steps if necessary, or None.

        Parameters
        ----------
        x : array
            The state at `deflection` (mm).
        halvings : int or None
            How often the step may be halved; `max_halvings` unless given.
        """
        state = self.equilibrium(x, target)
        if halvings is None:
            halvings = self.max_halvings
        if state is not None or halvings == 0:
            return state
        middle = 0.5 * (deflection + target)
        halfway = self.reach(x, deflection, middle, halvings - 1)
        if halfway is None:
            return None
        return self.reach(halfway, middle, target, halvings - 1)

    def surface(self, x: Array) -> Array:
        """Return the displacement (nodes, 3) mm of the model's surface mesh at the state x."""
        p = self.model.mesh.points
        q = x[: 3 * len(self.s)].reshape(-1, 3)
        axial_position = p[:, 2]
        along, up, rotation = (np.interp(axial_position, self.s, column) for column in q.T)
        upward = up + p[:, 1] * (np.cos(rotation) - 1.0)
        axial = along - p[:, 1] * np.sin(rotation)
        return np.column_stack([np.zeros(len(p)), upward, axial])


def _axis_nodes(model: BeamModel) -> Array:
    """Return the places (n,) mm of the nodes on half of the axis, from mid-span.

    There is a node at the middle and at both ends of the loaded length.
    """
    load_position = 0.5 * model.load_spacing
    width = 0.5 * model.load_width
    loaded = {max(load_position - width, 0.0), load_position, load_position + width}
    ends = sorted({0.0, *loaded, 0.5 * model.span})
    nodes = [np.zeros(1)]
    for a, b in pairwise(ends):
        count = max(2, round((b - a) / model.size))
        nodes.append(np.linspace(a, b, count + 1)[1:])
    return np.concatenate(nodes)


def _load_shares(model: BeamModel, s: Array) -> Array:
    """Return the shares (n,), which add up to 1, of the load of one half at nodes s (n,) mm."""
    load_position = 0.5 * model.load_spacing
    width = 0.5 * model.load_width
    shares = np.zeros(len(s))
    if width > 0:
        # A strap over mid-span lies on both halves, as two straps do.
        middle = 0.5 * (s[1:] + s[:-1])
        loaded_length = np.where(np.abs(middle - load_position) < width, np.diff(s), 0.0)
        shares[:-1] += loaded_length
        shares[1:] += loaded_length
    else:
        shares[np.argmin(np.abs(s - load_position))] = 1.0
    return shares / shares.sum()


def prepare(
    model: BeamModel,
    law: HypoelasticLaw,
    tolerance: float,
    wall: object,
) -> Beam:
    """Return the finite element model of a beam.

    Parameters
    ----------
    law, wall
        Not used, as the model has the stiffness of its wall.
    tolerance : float
        Ratio of the largest residual to the pressure force on a section below which a state is an
        equilibrium.
    """
    return Beam(model, tolerance)


def analyse(beam: Beam, model: BeamModel, request: RunRequest) -> tuple[History, Array]:
    """Return the history of a bending: the inflated tube under its weight, then the deflections.

    There are no derivatives: their array is (frames, nodes, 3, 0). InputError if the request has
    parameters or a guess. SolverFailure if there is no equilibrium under the weight, or at the
    first deflection; at a later one the history ends early.
    """
    if request.parameters or request.guess is not None:
        raise InputError(None, "parameters", "a beam takes no parameters or guess")
    x = beam.equilibrium(np.zeros(3 * len(beam.s) + 2), None)
    if x is None:
        raise SolverFailure("no equilibrium of the inflated tube under its weight")
    sag = -x[1]
    states = [x]
    early = ""
    previous = 0.0
    low = high = 0.0
    for i, deflection in enumerate(model.increments):
        state = beam.reach(states[-1], sag + previous, sag + deflection)
        if state is None:
            early = f"the run stopped early: no equilibrium between {previous:.4g} and "
            early += f"{deflection:.4g} mm of deflection"
            break
        states.append(state)
        previous = deflection
        axial_strain, curvature = beam.strains
        bending_strain = np.abs(curvature) * model.section.radius
        low = min(low, float((axial_strain - bending_strain).min()))
        high = max(high, float((axial_strain + bending_strain).max()))
        request.report(i + 1)
    if len(states) == 1:
        raise SolverFailure(f"no frame of the bending: {early}")
    history = _history(beam, model, states, (low, high), early)
    return history, np.zeros((*history.displacement.shape, 0))


def _history(
    beam: Beam,
    model: BeamModel,
    states: list[Array],
    extremes: tuple[float, float],
    early: str,
) -> History:
    """Return the history of the reported frames.

    Parameters
    ----------
    states : list of (n,) arrays
        Of the inflated tube and at each increment of deflection, as x of `Beam`.
    extremes : tuple of float, float
        Lowest and highest axial strain.
    early : str
        Why the bending ended early, or "".
    """
    # The first state is the inflated tube; those after an early end are missing.
    state_numbers = [0, *(i + 1 for i in model.reported if i + 1 < len(states))]
    reported = np.array([states[i] for i in state_numbers])
    load = reported[:, -1] + model.friction * (np.arange(len(reported)) > 0)
    none = np.zeros(len(reported))
    volume = 2 * np.pi * model.section.radius**2 * (0.5 * model.span + reported[:, -5])
    low, high = extremes
    return History(
        load,
        np.array([beam.surface(state) for state in reported]),
        np.array([low, 0.0, 0.0]),
        np.array([high, 0.0, 0.0]),
        {"supports": np.column_stack([none, -2 * reported[:, -2], none])},
        cavity_pressure=np.full(len(reported), model.pressure),
        cavity_volume=volume,
        iterations=beam.iterations,
        remarks=(Note(EARLY, early),) if early else (),
        early=early,
    )
