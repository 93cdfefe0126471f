"""Beam finite elements of an inflated tube: plane sections, large rotations, shear.

Reissner's beam: with the axis at (Z, Y) over the length s and sections turned by a, the strains
1 + e = Z' cos a + Y' sin a, g = Y' cos a - Z' sin a and a' are conjugate to N, V and M of a section
(`meshes/beam_model.py`). Linear elements with one point each do not lock. Half of the beam, from
mid-span; its end lies on a roller h = `roller_below` the axis, at Z + h sin a, whose height is
constant: the reaction is the multiplier of that, with the moment h sin a times it. The deflection
of mid-span is given, the load an unknown.
"""

from itertools import pairwise

import numpy as np

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.beam_model import BeamModel
from ...meshes.mesh import Array
from ...notes import Note
from ..base import EARLY, History
from .loading import IncrementProgress, RunRequest

#: Newton's iterations in a step; how often it is halved.
MOST_ITERATIONS, MOST_CUTS = 30, 6


class Beam:
    """Half of a beam; its state x: Z - s, Y, angle node by node, then the reaction and the load."""

    def __init__(self, model: BeamModel, tolerance: float) -> None:
        self.model = model
        self.tolerance = tolerance
        half = 0.5 * model.span
        at = 0.5 * model.load_spacing
        width = 0.5 * model.load_width
        ends = sorted({0.0, max(at - width, 0.0), at, at + width, half})
        pieces = [
            np.linspace(a, b, max(2, round((b - a) / model.size)) + 1)[1:]
            for a, b in pairwise(ends)
        ]
        self.s = np.concatenate([[0.0], *pieces])
        self.length = np.diff(self.s)
        count = 3 * len(self.s)
        self.places = 3 * np.arange(len(self.length))[:, None] + np.arange(6)
        self.load = np.zeros(count)
        self.weight = np.zeros(count)
        shares = np.zeros(len(self.s))
        if width > 0:
            # A strap over mid-span lies on both halves, as two straps do.
            middle = 0.5 * (self.s[1:] + self.s[:-1])
            loaded_length = np.where(np.abs(middle - at) < width, self.length, 0.0)
            shares[:-1] += loaded_length
            shares[1:] += loaded_length
        else:
            shares[np.argmin(np.abs(self.s - at))] = 1.0
        self.load[1::3] = -0.5 * shares / shares.sum()
        for part in (slice(None, -1), slice(1, None)):
            self.weight[1::3][part] -= 0.5 * model.weight * self.length
        self.free = np.setdiff1d(np.arange(count + 2), [0, 2])
        self.iterations = 0

    def residual(self, x: Array, deflection: float | None) -> tuple[Array, Array]:
        """Return the residual (n,) and its tangent (n, n) at x; without a deflection no load."""
        model = self.model
        count = 3 * len(self.s)
        q = x[:count].reshape(-1, 3)
        reaction = x[count]
        load = x[count + 1]
        z = 1.0 + np.diff(q[:, 0]) / self.length
        y = np.diff(q[:, 1]) / self.length
        turn = 0.5 * (q[1:, 2] + q[:-1, 2])
        bend = np.diff(q[:, 2]) / self.length
        c = np.cos(turn)
        s = np.sin(turn)
        stretch = z * c + y * s
        shear = y * c - z * s
        normal, moment, stiff = model.section.resultants(stretch - 1.0, bend)
        stiffness = model.section.shear
        self.strains = (stretch - 1.0, bend)
        # Derivatives of (e, g, a') by (Z', Y', a, a').
        by = np.zeros((len(c), 3, 4))
        by[:, 0, 0] = c
        by[:, 0, 1] = s
        by[:, 0, 2] = shear
        by[:, 1, 0] = -s
        by[:, 1, 1] = c
        by[:, 1, 2] = -stretch
        by[:, 2, 3] = 1.0
        force = np.stack([normal, stiffness * shear, moment], axis=1)
        law = np.zeros((len(c), 3, 3))
        law[:, ::2, ::2] = stiff
        law[:, 1, 1] = stiffness
        inner = np.einsum("eai,eab,ebj->eij", by, law, by)
        n = force[:, 0]
        v = force[:, 1]
        for i, curved in ((0, -n * s - v * c), (1, n * c - v * s)):
            inner[:, i, 2] += curved
            inner[:, 2, i] += curved
        inner[:, 2, 2] += -n * stretch - v * shear
        # By the six unknowns of an element.
        to = np.zeros((len(c), 4, 6))
        for k in range(2):
            to[:, k, k] = -1 / self.length
            to[:, k, 3 + k] = 1 / self.length
        to[:, 2, 2] = to[:, 2, 5] = 0.5
        to[:, 3, 2] = -1 / self.length
        to[:, 3, 5] = 1 / self.length
        local = np.einsum("e,eka,eik,ei->ea", self.length, to, by, force)
        element = np.einsum("e,eka,ekl,elb->eab", self.length, to, inner, to)
        r: Array = np.zeros(count + 2)
        matrix: Array = np.zeros((count + 2, count + 2))
        np.add.at(r, self.places, local)
        np.add.at(matrix, (self.places[:, :, None], self.places[:, None, :]), element)
        r[:count] -= self.weight + load * self.load
        matrix[:count, count + 1] = -self.load
        h = model.roller_below
        end = q[-1, 2]
        r[count - 2] += reaction
        r[count - 1] += reaction * h * np.sin(end)
        matrix[count - 1, count - 1] += reaction * h * np.cos(end)
        r[count] = q[-1, 1] + h * (1.0 - np.cos(end))
        for row, value in ((count - 2, 1.0), (count - 1, h * np.sin(end))):
            matrix[row, count] = matrix[count, row] = value
        if deflection is None:
            r[count + 1] = load
            matrix[count + 1, count + 1] = 1.0
        else:
            r[count + 1] = -q[0, 1] - deflection
            matrix[count + 1, 1] = -1.0
        return r, matrix

    def equilibrium(self, x: Array, deflection: float | None) -> Array | None:
        """Return the state at a deflection of mid-span (mm), from x; None where none is found."""
        x = x.copy()
        free = self.free
        for _ in range(MOST_ITERATIONS):
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

    def reach(self, x: Array, at: float, to: float, halvings: int = MOST_CUTS) -> Array | None:
        """Return the state at the deflection `to` from x at another, in halved steps if needed."""
        state = self.equilibrium(x, to)
        if state is not None or halvings == 0:
            return state
        middle = 0.5 * (at + to)
        halfway = self.reach(x, at, middle, halvings - 1)
        return None if halfway is None else self.reach(halfway, middle, to, halvings - 1)

    def surface(self, x: Array) -> Array:
        """Return the displacement (nodes, 3) mm of the mesh that is drawn."""
        p = self.model.mesh.points
        q = x[: 3 * len(self.s)].reshape(-1, 3)
        along, up, turn = (np.interp(p[:, 2], self.s, q[:, k]) for k in range(3))
        displacement = up + p[:, 1] * (np.cos(turn) - 1.0), along - p[:, 1] * np.sin(turn)
        return np.column_stack([np.zeros(len(p)), *displacement])


def prepare(model: BeamModel, law: HypoelasticLaw, tolerance: float, wall: object) -> Beam:
    return Beam(model, tolerance)


def analyse(beam: Beam, model: BeamModel, request: RunRequest) -> tuple[History, Array]:
    """Return the history: the inflated tube under its weight, then every reported deflection.

    SolverFailure : no equilibrium under its weight, or at the first deflection.
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
        state_reached = beam.reach(states[-1], sag + previous, sag + deflection)
        if state_reached is None:
            early = f"the run stopped early: no equilibrium between {previous:.4g} and "
            early += f"{deflection:.4g} mm of deflection"
            break
        states.append(state_reached)
        previous = deflection
        strain, bend = beam.strains
        reach = np.abs(bend) * model.section.radius
        low = min(low, float((strain - reach).min()))
        high = max(high, float((strain + reach).max()))
        if request.on_progress is not None:
            request.on_progress(IncrementProgress(i + 1))
    if len(states) == 1:
        raise SolverFailure(f"no frame of the bending: {early}")
    frames = [0, *(i + 1 for i in model.reported if i + 1 < len(states))]
    reported = np.array([states[i] for i in frames])
    load = reported[:, -1] + model.friction * (np.arange(len(reported)) > 0)
    none = np.zeros(len(reported))
    volume = 2 * np.pi * model.section.radius**2 * (0.5 * model.span + reported[:, -5])
    history = History(
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
    return history, np.zeros((*history.displacement.shape, 0))
