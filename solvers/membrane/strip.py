"""A strip pulled in its plane, increment by increment of its gauge."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...models.uniaxial import UniaxialModel
from ..base import History
from .derivatives import Derivatives
from .driven import DrivenTangent, Pull
from .element import reference_elements
from .newton import Membrane, initial_moduli

Array = NDArray[np.float64]

MOST_CUTS = 6
#: Increments that the start of the next one is extrapolated from.
LOOK_BACK = 4


def prepare(model: UniaxialModel, law: HypoelasticLaw, tolerance: float) -> Membrane:
    """What does not change from one law to the next."""
    points = np.array(model.mesh.points, dtype=float)
    quads = np.ascontiguousarray(model.mesh.quads, dtype=np.int64)
    held = np.concatenate([model.fixed, model.driven])
    free = np.setdiff1d(np.arange(points.size), held)
    warp = np.broadcast_to(model.warp, (len(quads), 3))
    return Membrane(
        points,
        quads,
        reference_elements(points, quads, warp),
        model.thickness,
        law,
        free,
        DrivenTangent(quads, points.size, free, model.driven),
        tolerance,
        step_limit=0.1 * float(np.ptp(points, axis=0).max()),
    )


def analyse(
    membrane: Membrane,
    model: UniaxialModel,
    parameters: Sequence[str],
    pressure_offset: float,
    guess: Array | None,
) -> tuple[History, Array]:
    """History, and the derivatives of the displacements by `parameters` in every increment.

    The membrane is fresh: no strain, no stress. Direct differentiation through the gauge: the
    strip at a fixed pull moves by a, for one mm of pull by w, and the pull changes so that the
    gauge does not: du = a - w (g a)/(g w), g the derivative of its length. The load's derivative
    is that of the residual at the driven unknowns.

    Stability is not judged (`stable` is None): the judgement for the bubble takes the tangent for
    nearly symmetric and its load for given, and a strip is neither.
    """
    if pressure_offset or "pressure_offset" in parameters:
        raise InputError(None, "pressure_offset", "a strip has no pressure; leave it out")
    initial_moduli(membrane.law)
    tangent = membrane.tangent
    assert isinstance(tangent, DrivenTangent)
    direction = np.zeros(membrane.reference.size)
    direction[model.driven] = -1.0
    pull = Pull(membrane, tangent, direction, model.mesh.node_sets["gauge"])
    levels, shape, free = np.array(model.elongations), membrane.reference.shape, membrane.free
    path, forces = (np.zeros((len(levels), *shape)) for _ in range(2))
    rates = np.zeros((len(levels), *shape, len(parameters)))
    load_slope = np.zeros((len(levels), len(parameters)))
    low, high = np.zeros(3), np.zeros(3)
    derivatives = Derivatives(membrane, parameters) if parameters else None
    membrane.keep_tangent = True
    for i in range(len(levels)):
        u = path[i] = _increment(pull, path[:i], levels, i, guess)
        if derivatives is not None:
            membrane.factor(judge=False)
            rate = derivatives.at_fixed_displacement(u)
            w, (_, slope) = pull.response(), pull.elongation(u)
            du = np.zeros_like(rate)
            du[free] = -membrane.tangent.solve(rate[free])
            du -= np.outer(w, slope @ du) / (slope @ w)
            load_slope[i] = direction @ (rate + tangent.edge() @ du)
            derivatives.advance(du)
            rates[i] = du.reshape(*shape, -1)
        membrane.accept()
        forces[i] = membrane.residual.reshape(shape)
        np.minimum(low, membrane.strain_old.min(axis=(0, 1)), out=low)
        np.maximum(high, membrane.strain_old.max(axis=(0, 1)), out=high)
    history = History(
        model.load_factor * (forces.reshape(len(levels), -1) @ direction),
        path,
        low,
        high,
        {
            n: forces[:, model.mesh.node_sets[n]].sum(axis=1)
            for n in (*model.supports, model.pulled)
        },
        iterations=membrane.iterations,
        path=path,
        path_slope=rates if parameters else None,
        load_slope=model.load_factor * load_slope if parameters else None,
    )
    return history, rates


def _increment(pull: Pull, path: Array, levels: Array, i: int, guess: Array | None) -> Array:
    level = float(levels[i])
    if guess is not None:
        found = pull.equilibrium(_pulled(pull, guess[i]), level)
        if found is not None:
            return found
    lower, before = (0.0, np.zeros_like(pull.membrane.reference)) if i == 0 else (
        float(levels[i - 1]), path[-1])  # fmt: skip
    start = _extrapolate(path, levels[:i], level) if i else _stretched(pull, level)
    # Cut-back as for the bubble: the strain history is not committed in between.
    found = _reach(pull, lower, before, level, start, MOST_CUTS)
    if found is None:
        raise SolverFailure(
            f"no equilibrium at {level:.4g} mm of gauge elongation (increment {i + 1} of "
            f"{len(levels)}); more increments, or moduli nearer to the data, usually help"
        )
    return found


def _reach(
    pull: Pull, lower: float, u_lower: Array, level: float, start: Array, cuts: int
) -> Array | None:
    """Equilibrium at `level`, through halved elongations from `lower` when it is not direct."""
    found = pull.equilibrium(start, level)
    if found is not None or cuts == 0:
        return found
    middle = 0.5 * (lower + level)

    def onward(u: Array, a: float, b: float) -> Array:
        return u * (b / a) if a > 0 else _stretched(pull, b)

    u_middle = _reach(pull, lower, u_lower, middle, onward(u_lower, lower, middle), cuts - 1)
    if u_middle is None:
        return None
    return _reach(pull, middle, u_middle, level, onward(u_middle, middle, level), cuts - 1)


def _stretched(pull: Pull, elongation: float) -> Array:
    """The strip stretched evenly along y: the start of the first increment."""
    reference = pull.membrane.reference
    u = np.zeros_like(reference)
    u[:, 1] = elongation / pull.gauge_length * (reference[:, 1] - reference[:, 1].max())
    return _pulled(pull, u)


def _pulled(pull: Pull, u: Array) -> Array:
    """u (n, 3) with the held unknowns at zero and the driven ones at their common value."""
    flat = np.array(u, dtype=float).reshape(-1)
    driven = pull.direction != 0
    common = float(flat[driven].mean())
    moved = np.zeros_like(flat)
    moved[pull.membrane.free] = flat[pull.membrane.free]
    moved[driven] = common
    return moved.reshape(u.shape)


def _extrapolate(path: Array, levels: Array, level: float) -> Array:
    """Lagrange extrapolation in the elongation, from zero or from the last increments."""
    x = np.concatenate([[0.0], levels])[-LOOK_BACK:]
    known = np.concatenate([np.zeros((1, *path.shape[1:])), path[-LOOK_BACK:]])[-len(x) :]
    weights = [
        math.prod((level - x[b]) / (x[a] - x[b]) for b in range(len(x)) if b != a)
        for a in range(len(x))
    ]
    return np.einsum("a,ank->nk", weights, known)
