"""One load level: Newton iteration with the consistent tangent, and cut-back."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from .element import ReferenceElements
from .factorisation import SingularTangent, Tangent
from .kernel import assemble

Array = NDArray[np.float64]

MOST_ITERATIONS = 40
MOST_BACKTRACKS = 8
# Below this residual, a step that shrank the residual this much is followed by a chord step
# (no new tangent): it costs a quarter of a Newton step and still gains one to two digits.
CHORD_BELOW = 1e-2
CHORD_GAIN = 0.15
# Below this residual Newton gains digits in every step. Where it no longer does, the residual is
# rounding (fine meshes at low pressure reach 1e-8): the iterate is as good as it gets.
ROUNDING_BELOW = 1e-6
MOST_IDLE = 3
# Where a modulus jumps (a tri-linear one at a break) so does the tangent, and full steps can go to
# and fro between two sides for ever. After this many without progress every step has to make some.
MOST_FRUITLESS = 3


@dataclass(eq=False)
class Membrane:
    """Everything an equilibrium iteration needs; strain and stress at the start and the end.

    reference (n, 3) mm; thickness mm, one or (elements,), which section (elements,) repeats;
    strain_*, stress_* (elements, 4, 3); step_limit mm: the largest nodal correction of one
    iteration; keep_tangent: end every increment with the tangent of its
    equilibrium assembled (sensitivities want it; in a chord step it costs little more).
    wrinkle_stiffness: share of the stiffness left to wrinkles; None: the membrane carries
    compression as it carries tension. wrinkle (elements, 4, 3): strain of the fabric less that of
    the surface at the last evaluation.
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
    wrinkle: Array = field(init=False)
    section: Array = field(init=False)
    strain_old: Array = field(init=False)
    stress_old: Array = field(init=False)
    strain_new: Array = field(init=False)
    stress_new: Array = field(init=False)
    residual: Array = field(init=False)

    def __post_init__(self) -> None:
        shape = (len(self.quads), 4, 3)
        self.section = np.array(np.broadcast_to(self.thickness, len(self.quads)), dtype=float)
        self.strain_old, self.stress_old = np.zeros(shape), np.zeros(shape)
        self.strain_new, self.stress_new = np.zeros(shape), np.zeros(shape)
        self.wrinkle = np.zeros(shape)
        self.residual = np.zeros(3 * len(self.reference))

    def unbalance(self, u: Array, pressure: float, with_tangent: bool) -> float:
        """Largest free residual over the largest pressure force; inf where there is no stress."""
        law, e = self.law, self.elements
        force = assemble(
            self.reference + u, self.quads, e.values, e.slopes, e.area, self.section, pressure,
            law.pieces, law.coupling, law.area_power, self.strain_old,
            self.stress_old, self.strain_new, self.stress_new, self.tangent.slot,
            self.tangent.data, self.residual, with_tangent,
            -1.0 if self.wrinkle_stiffness is None else self.wrinkle_stiffness, self.wrinkle,
        )  # fmt: skip
        self.iterations += 1
        if force < 0:
            return np.inf
        self.further_forces(u, with_tangent)
        if force == 0.0:  # no pressure: the reactions of what is prescribed are the measure
            force = float(np.abs(self.residual).max()) or 1.0
        ratio = float(np.abs(self.residual[self.free]).max()) / force
        return ratio if np.isfinite(ratio) else np.inf

    def further_forces(self, u: Array, with_tangent: bool) -> None:
        """Add to `residual` (and the tangent) what is neither stress nor pressure: nothing here."""

    def accept(self) -> None:
        """Take the strain and stress of the last evaluation as the start of the next increment."""
        self.strain_old[:] = self.strain_new
        self.stress_old[:] = self.stress_new

    def factor(self) -> None:
        """Factorise the tangent that `keep_tangent` left.

        Raises
        ------
        SolverFailure : the tangent is singular, so the state is a limit point.
        """
        try:
            self.tangent.factor()
        except SingularTangent:
            raise SolverFailure("the tangent is singular: a limit point") from None

    def equilibrium(self, u: Array, pressure: float) -> Array | None:
        """Displacement (n, 3) in equilibrium at `pressure`, starting from u; None if not found."""
        u = u.copy()
        flat = u.reshape(-1)
        step = before = np.empty(0)
        last, scale, backtracks, chord = np.inf, 1.0, 0, False
        least, idle = np.inf, 0
        jumps, fruitless = self.law.jumps, 0
        for _ in range(MOST_ITERATIONS):
            norm = self.unbalance(u, pressure, with_tangent=self.keep_tangent or not chord)
            if norm < self.tolerance:
                return u
            idle = idle + 1 if 0.5 * least < norm < ROUNDING_BELOW else 0
            if idle >= MOST_IDLE:
                return u
            fruitless = fruitless + 1 if jumps and norm > 0.5 * least else 0
            least = min(least, norm)
            worse = norm > (20.0 * last + 1e-3 if fruitless < MOST_FRUITLESS else last)
            if len(step) and worse and backtracks < MOST_BACKTRACKS:
                scale, backtracks, chord = 0.35 * scale, backtracks + 1, False
                flat[self.free] = before + scale * step
                continue
            if not np.isfinite(norm):
                return None
            if chord and norm > CHORD_GAIN * last:
                chord = False
                if not self.keep_tangent:
                    self.unbalance(u, pressure, with_tangent=True)
            try:
                if not chord:
                    self.tangent.factor()
                step = -self.tangent.solve(self.residual[self.free])
            except SingularTangent:
                return None
            largest = float(np.abs(step).max())
            if not np.isfinite(largest):
                return None
            before = flat[self.free].copy()
            scale = min(1.0, self.step_limit / largest) if largest > 0 else 1.0
            flat[self.free] = before + scale * step
            last, backtracks, chord = norm, 0, norm < CHORD_BELOW and scale == 1.0
        return None


def initial_moduli(law: HypoelasticLaw) -> tuple[float, float, float]:
    """E1, E2, G12 at zero strain, MPa.

    Raises
    ------
    SolverFailure : one of them is not positive, so that there is no equilibrium to look for.
    """
    e1, e2, g12 = (float(modulus(0.0)) for modulus in (law.E1, law.E2, law.G12))
    if not min(e1, e2, g12) > 0:
        raise SolverFailure(
            "no equilibrium at all: E1, E2, G12 at zero strain are "
            f"{e1:.3g}, {e2:.3g}, {g12:.3g} MPa and must be positive"
        )
    return e1, e2, g12


def initial_stiffness(law: HypoelasticLaw) -> Array:
    """Plane stress stiffness (3, 3) at zero strain, MPa.

    Raises
    ------
    SolverFailure : as `initial_moduli`.
    """
    initial_moduli(law)
    none = np.zeros(3)
    _, tangent = law.increment(none, none, none)
    return tangent[0]
