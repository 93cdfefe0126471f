"""The embedded membrane solver: the strain path, increment by increment."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from ... import __version__
from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw
from ...models.bubble import BubbleModel
from ..base import PARAMETERS, History, SolverCheck
from .element import reference_elements
from .factorisation import tangent_for
from .newton import Membrane
from .sensitivity import POINT, advance, explicit

Array = NDArray[np.float64]

MOST_CUTS = 6
# The bands are too small to share: where another program uses a core, BLAS threads that wait for
# each other made an analysis 12 to 290 times slower (two runs of benchmarks/bench_analysis.py).
BLAS = ThreadpoolController()
# Heights tried for the first increment, as multiples of the estimate.
FIRST_HEIGHTS = (1.0, 1.5, 0.75, 2.0, 1.25, 0.5)


class MembraneSolver:
    """In-process finite element solver with exact sensitivities (needs no other program).

    Parameters
    ----------
    tolerance : largest residual force over the largest nodal pressure force.
    """

    name = "membrane"
    external = False

    def __init__(self, tolerance: float = 1e-8) -> None:
        self.tolerance = tolerance
        self._prepared: tuple[BubbleModel, Membrane] | None = None

    def check(self) -> SolverCheck:
        """Always there; the law is its own."""
        return SolverCheck(self.name, True, __version__, True)

    def run(
        self,
        model: BubbleModel,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
        pressure_offset: float = 0.0,
        guess: Array | None = None,
    ) -> History:
        """Inflate the model (scratch and timeout are for external solvers and not used).

        Parameters
        ----------
        pressure_offset : MPa added to every load level.
        guess : (increments, nodes, 3) displacements to start each increment from, mm.

        Raises
        ------
        SolverFailure : an increment has no equilibrium that Newton and cut-back can find.
        """
        return self._inflate(model, law, (), pressure_offset, guess)[0]

    def run_with_sensitivity(
        self,
        model: BubbleModel,
        law: HypoelasticLaw,
        parameters: Sequence[str] = PARAMETERS[:12],
        pressure_offset: float = 0.0,
        guess: Array | None = None,
    ) -> tuple[History, Array]:
        """History and d displacement / d parameters, (frames, nodes, 3, len(parameters)).

        Derivatives by coefficients are per MPa, by the pressure offset per MPa.
        """
        unknown = [name for name in parameters if name not in PARAMETERS]
        if unknown:
            raise InputError(None, "parameters", f"{unknown} not among {PARAMETERS}")
        return self._inflate(model, law, parameters, pressure_offset, guess)

    def _membrane(self, model: BubbleModel, law: HypoelasticLaw) -> Membrane:
        """Geometry and sparsity are made once a model; strain history anew every run."""
        if self._prepared is None or self._prepared[0] is not model:
            points = np.column_stack([model.mesh.points[:, :2], np.zeros(len(model.mesh.points))])
            if model.mesh.points.shape[1] == 3:
                points = np.array(model.mesh.points, dtype=float)
            quads = np.ascontiguousarray(model.mesh.quads, dtype=np.int64)
            free = np.setdiff1d(np.arange(points.size), model.fixed)
            size = float(np.ptp(points, axis=0).max())
            self._prepared = (
                model,
                Membrane(
                    points,
                    quads,
                    reference_elements(points, quads),
                    model.thickness,
                    law,
                    free,
                    tangent_for(quads, points.size, free),
                    self.tolerance,
                    step_limit=0.1 * size,
                ),
            )
        membrane = self._prepared[1]
        membrane.law = law
        membrane.keep_tangent, membrane.iterations = False, 0
        membrane.strain_old[:] = 0.0
        membrane.stress_old[:] = 0.0
        return membrane

    @BLAS.wrap(limits=1, user_api="blas")
    def _inflate(
        self,
        model: BubbleModel,
        law: HypoelasticLaw,
        parameters: Sequence[str],
        pressure_offset: float,
        guess: Array | None,
    ) -> tuple[History, Array]:
        membrane = self._membrane(model, law)
        levels = np.array(model.increments) + pressure_offset
        if levels[0] <= 0:
            raise SolverFailure(f"pressure {levels[0] * 1e3:.3g} kPa is not positive")
        shape = membrane.reference.shape
        path = np.zeros((len(levels), *shape))
        forces = np.zeros((len(levels), *shape))
        low, high = np.zeros(3), np.zeros(3)
        derivatives = _Derivatives(membrane, parameters) if parameters else None
        rates = np.zeros((len(levels), *shape, len(parameters)))
        last = len(levels) - 1
        stable = True
        for i in range(last + 1):
            membrane.keep_tangent = derivatives is not None or i == last
            u = self._increment(membrane, path, levels, i, guess)
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
        self, membrane: Membrane, path: Array, levels: Array, i: int, guess: Array | None
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


class _Derivatives:
    """Displacement derivatives, carried along the strain path."""

    def __init__(self, membrane: Membrane, parameters: Sequence[str]) -> None:
        self.membrane = membrane
        self.which = np.array([PARAMETERS.index(name) for name in parameters])
        shape = (len(membrane.quads), 4, 3, len(self.which))
        self.strain, self.stress, self.fresh = np.zeros(shape), np.zeros(shape), np.empty(shape)
        self.point = np.empty((len(membrane.quads), 4, POINT))
        self.rate = np.empty((membrane.reference.size, len(self.which)))

    def increment(self, u: Array) -> Array:
        """d u / d parameters (3 n, np) at the equilibrium u, factorised and not yet accepted."""
        m, e, law = self.membrane, self.membrane.elements, self.membrane.law
        explicit(
            m.reference + u, m.quads, e.values, e.slopes, e.area, m.thickness, law.beta, law.nu12,
            law.strain_range, law.area_power, m.strain_old, m.stress_old, self.which,
            self.strain, self.stress, self.fresh, self.point, self.rate,
        )  # fmt: skip
        du = np.zeros_like(self.rate)
        du[m.free] = -m.tangent.solve(self.rate[m.free])
        self.stress, self.fresh = self.fresh, self.stress
        advance(m.quads, e.slopes, self.point, du, self.strain, self.stress)
        return du


def _from_flat(membrane: Membrane, level: float, cuts: int) -> Array:
    """First increment: a flat membrane has no stiffness, so start from an inflated guess."""
    law = membrane.law
    radius = np.hypot(membrane.reference[:, 0], membrane.reference[:, 1])
    size = float(radius.max())
    moduli = [float(modulus(0.0)) for modulus in (law.E1, law.E2, law.G12)]
    if not min(moduli) > 0:
        raise SolverFailure(
            "no equilibrium at all: E1, E2, G12 at zero strain are "
            f"{', '.join(f'{m:.3g}' for m in moduli)} MPa and must be positive"
        )
    stiffness = 0.5 * membrane.thickness * (moduli[0] + moduli[1])
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
