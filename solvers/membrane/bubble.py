"""Inflation of a flat membrane, increment by increment."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from ...models.bubble import BubbleModel
from ..base import History
from .derivatives import Derivatives
from .element import reference_elements
from .factorisation import tangent_for
from .newton import Membrane, initial_moduli

Array = NDArray[np.float64]

MOST_CUTS = 6
# Heights tried for the first increment, as multiples of the estimate.
FIRST_HEIGHTS = (1.0, 1.5, 0.75, 2.0, 1.25, 0.5)


def prepare(model: BubbleModel, law: HypoelasticLaw, tolerance: float) -> Membrane:
    """What does not change from one law to the next."""
    points = np.column_stack([model.mesh.points[:, :2], np.zeros(len(model.mesh.points))])
    if model.mesh.points.shape[1] == 3:
        points = np.array(model.mesh.points, dtype=float)
    quads = np.ascontiguousarray(model.mesh.quads, dtype=np.int64)
    free = np.setdiff1d(np.arange(points.size), model.fixed)
    return Membrane(
        points,
        quads,
        reference_elements(points, quads),
        model.thickness,
        law,
        free,
        tangent_for(quads, points.size, free),
        tolerance,
        step_limit=0.1 * float(np.ptp(points, axis=0).max()),
    )


def analyse(
    membrane: Membrane,
    model: BubbleModel,
    parameters: Sequence[str],
    pressure_offset: float,
    guess: Array | None,
) -> tuple[History, Array]:
    """History, and the derivatives by `parameters` in the reported frames.

    The membrane is fresh: no strain, no stress.
    """
    levels = np.array(model.increments) + pressure_offset
    if levels[0] <= 0:
        raise SolverFailure(f"pressure {levels[0] * 1e3:.3g} kPa is not positive")
    shape = membrane.reference.shape
    path = np.zeros((len(levels), *shape))
    forces = np.zeros((len(levels), *shape))
    low, high = np.zeros(3), np.zeros(3)
    derivatives = Derivatives(membrane, parameters) if parameters else None
    rates = np.zeros((len(levels), *shape, len(parameters)))
    last = len(levels) - 1
    stable = True
    for i in range(last + 1):
        membrane.keep_tangent = derivatives is not None or i == last
        u = _increment(membrane, path, levels, i, guess)
        path[i] = u
        if membrane.keep_tangent:
            stable = membrane.factor(judge=i == last)
        if derivatives is not None:
            rates[i] = derivatives.increment(u).reshape(*shape, -1)
        membrane.accept()
        forces[i] = membrane.residual.reshape(shape)
        np.minimum(low, membrane.strain_old.min(axis=(0, 1)), out=low)
        np.maximum(high, membrane.strain_old.max(axis=(0, 1)), out=high)
    keep = model.reported
    reactions = {
        name: forces[keep][:, model.mesh.node_sets[name]].sum(axis=1)
        for name in model.supports
        if name in model.mesh.node_sets
    }
    history = History(
        levels[keep],
        path[keep],
        low,
        high,
        reactions,
        iterations=membrane.iterations,
        path=path,
        path_slope=rates if parameters else None,
        stable=stable,
    )
    return history, rates[keep]


def _increment(
    membrane: Membrane, path: Array, levels: Array, i: int, guess: Array | None
) -> Array:
    level = float(levels[i])
    if guess is not None:
        found = membrane.equilibrium(guess[i], level)
        if found is not None:
            return found
    if i == 0:
        return _from_flat(membrane, level, MOST_CUTS)
    start = _extrapolate(path[:i], levels[:i], level)
    # Cut-back is continuation in load inside the increment: strain history is not committed
    # in between, so that the path integral, and with it the result, does not depend on it.
    found = _reach(membrane, float(levels[i - 1]), path[i - 1], level, start, MOST_CUTS)
    if found is None:
        raise SolverFailure(
            f"no equilibrium at {level * 1e3:.4g} kPa (increment {i + 1} of {len(levels)}); "
            "more increments, or moduli nearer to the data, usually help"
        )
    return found


def _from_flat(membrane: Membrane, level: float, cuts: int) -> Array:
    """First increment: a flat membrane has no stiffness, so start from an inflated guess."""
    moduli = initial_moduli(membrane.law)
    radius = np.hypot(membrane.reference[:, 0], membrane.reference[:, 1])
    size = float(radius.max())
    stiffness = 0.5 * float(np.median(membrane.section)) * (moduli[0] + moduli[1])
    # Hencky: apex = 0.662 R (p R / (E t))^(1/3)
    height = 0.662 * size * (level * size / stiffness) ** (1.0 / 3.0)
    dome = np.zeros_like(membrane.reference)
    dome[:, 2] = 1.0 - (radius / size) ** 2
    held = np.setdiff1d(np.arange(dome.size), membrane.free)
    for factor in FIRST_HEIGHTS:
        start = factor * height * dome
        start.reshape(-1)[held] = 0.0
        found = membrane.equilibrium(start, level)
        if found is not None:
            return found
    if cuts > 0:
        lower = _from_flat(membrane, 0.25 * level, cuts - 1)
        found = _reach(membrane, 0.25 * level, lower, level, lower * 4.0 ** (1 / 3), cuts)
        if found is not None:
            return found
    raise SolverFailure(f"no equilibrium at the first increment, {level * 1e3:.4g} kPa")


def _reach(
    membrane: Membrane, lower: float, u_lower: Array, level: float, start: Array, cuts: int
) -> Array | None:
    """Equilibrium at `level`, through halved load steps from `lower` when it is not direct."""
    found = membrane.equilibrium(start, level)
    if found is not None or cuts == 0:
        return found
    middle = 0.5 * (lower + level)
    rise: Callable[[float, float], float] = lambda a, b: (b / a) ** (1.0 / 3.0)  # noqa: E731
    u_middle = _reach(membrane, lower, u_lower, middle, u_lower * rise(lower, middle), cuts - 1)
    if u_middle is None:
        return None
    return _reach(membrane, middle, u_middle, level, u_middle * rise(middle, level), cuts - 1)


def _extrapolate(path: Array, levels: Array, level: float) -> Array:
    """Lagrange extrapolation in p^(1/3), in which inflation is nearly linear, over four steps."""
    if len(path) == 1:
        return np.asarray(path[0] * math.cbrt(level / levels[0]))
    count = min(len(path), 4)
    x = np.cbrt(levels[-count:])
    weights = [
        math.prod((math.cbrt(level) - x[b]) / (x[a] - x[b]) for b in range(count) if b != a)
        for a in range(count)
    ]
    return np.einsum("a,ank->nk", weights, path[-count:])
