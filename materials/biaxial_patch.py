"""Solve a patch without shear under loads along warp and fill, an increment a load.

Loads are per width before the test:

    n1 = t0 (J2)^p sigma1 / lambda1,    n2 = t0 (J2)^p sigma2 / lambda2,   J2 = lambda1 lambda2
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..compilation import compiled
from .forms.base import Array
from .law import HypoelasticLaw, law_slopes
from .pieces import CompiledLaw, LawTangent, PointState, modulus_slopes, point_response
from .point_law import stress_rates, stress_update

#: Newton iterations of one load, and halvings of a step that does not come nearer.
MAX_ITERATIONS = 60
MAX_HALVINGS = 40
#: Unbalanced force, over the largest load, that is taken as none, and up to which rounding may
#: end the iteration.
FORCE_TOLERANCE = 1e-13
ROUNDING = 1e-9
#: kN/m: no fabric carries more.
LARGEST_LOAD = 1000.0


@dataclass(frozen=True, eq=False)
class BiaxialResponse:
    """A patch at one load after the other, as far as there is an equilibrium; NaN beyond.

    Attributes
    ----------
    strain : (n, 2) ndarray
        Logarithmic strain along warp and fill.
    stress : (n, 2) ndarray, MPa
        Cauchy stress.
    slope : (n, 2, parameters) ndarray
        Derivatives of the strain.
    reached : int
        Number of loads with an equilibrium.
    stable : (n,) ndarray of bool
        Whether every further strain takes work.
    """

    strain: Array
    stress: Array
    slope: Array
    reached: int
    stable: NDArray[np.bool_]

    @property
    def elongation(self) -> Array:
        """Return (n, 2) change of length over the length before the test."""
        return np.expm1(self.strain)


def biaxial_response(
    law: HypoelasticLaw,
    loads: ArrayLike,
    thickness: float,
    parameters: Sequence[str] = (),
) -> BiaxialResponse:
    """Compute a patch's strains under one load after the other, as on first loading.

    Parameters
    ----------
    law : HypoelasticLaw
        A memory, which first loading does not need, is left out.
    loads : (n, 2) array_like, N/mm
        Along warp and fill, per width before the test.
    thickness : float, mm
    parameters : sequence of str
        By which the strains are differentiated, see `law.law_slopes`.
    """
    if law.memory is not None:
        law = replace(law, memory=None)
    load_path = np.ascontiguousarray(np.atleast_2d(np.asarray(loads, dtype=float)))
    of_law = law_slopes(law, parameters, thickness)
    strain, stress = np.full((2, len(load_path), 2), np.nan)
    slope = np.full((len(load_path), 2, len(parameters)), np.nan)
    stable = np.zeros(len(load_path), dtype=bool)
    path = PatchPath(strain, stress, slope, stable)
    reached = _follow_loads(law.compiled, thickness, load_path, of_law, path)
    return BiaxialResponse(strain, stress, slope, int(reached), stable)


def largest_load(
    law: HypoelasticLaw,
    thickness: float,
    shares: Sequence[tuple[float, float]],
    ends: ArrayLike,
) -> float:
    """Find the load up to which the strains of every ratio stay within ends.

    Parameters
    ----------
    law : HypoelasticLaw
    thickness : float, mm
    shares : sequence of (float, float)
        Of the larger load along warp and fill, a pair for each ratio.
    ends : (2,) array_like
        Largest logarithmic strains.

    Returns
    -------
    float, kN/m
        The larger of the two loads; 0 where there is none.
    """
    largest_strain = np.asarray(ends, dtype=float)
    increments = 20
    halvings = 50

    def stays_within(load: float) -> bool:
        larger = np.linspace(0.0, load, increments + 1)[1:]
        for pair in shares:
            response = biaxial_response(law, np.outer(larger, pair), thickness)
            if response.reached < increments or not (response.strain <= largest_strain).all():
                return False
        return True

    low = 0.0
    high = LARGEST_LOAD
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        if stays_within(middle):
            low = middle
        else:
            high = middle
    return low


class PatchPath(NamedTuple):
    """Arrays of a `BiaxialResponse`, for the compiled loop over the loads."""

    strain: Array
    stress: Array
    slope: Array
    stable: NDArray[np.bool_]


class PatchIncrement(NamedTuple):
    """An increment of the patch.

    Attributes
    ----------
    law : CompiledLaw
    thickness : float, mm
    before, after : PointState
        States at its start and, written, at its end.
    written : LawTangent
        Written as `stress_update` does.
    unbalanced : (2,) array, N/mm
        Forces per width less the load; written.
    stiffness : (2, 2) array, N/mm
        Their derivatives by the strains; written.
    step, trial : (2,) and (3,) arrays
        Scratch of the iteration.
    """

    law: CompiledLaw
    thickness: float
    before: PointState
    after: PointState
    written: LawTangent
    unbalanced: Array
    stiffness: Array
    step: Array
    trial: Array


@compiled(internal=True)
def _evaluate(increment, load, strain):  # type: ignore[no-untyped-def]
    """Write unbalanced forces and stiffness at a strain (3,). False where the law ends."""
    power = increment.law.area_power
    s = increment.after.stress
    tangent = increment.written.tangent
    k = increment.stiffness
    after = PointState(strain, s)
    if not stress_update(increment.law, increment.before, after, increment.written):
        return False
    for i in range(2):
        arm = increment.thickness * math.exp(power * (strain[0] + strain[1]) - strain[i])
        increment.unbalanced[i] = arm * s[i] - load[i]
        for j in range(2):
            k[i, j] = arm * (tangent[i, j] + power * s[i])
        k[i, i] -= arm * s[i]
    return True


@compiled(internal=True)
def _size(force):  # type: ignore[no-untyped-def]
    """Return the larger absolute value of two forces."""
    return max(abs(force[0]), abs(force[1]))


@compiled(internal=True)
def _search_along(  # type: ignore[no-untyped-def]
    increment,
    load,
    previous_size,
    largest,
):
    """Move the strain along a step, halved until it gains; return whether there is a stress."""
    h = increment.after.strain
    trial = increment.trial
    step = increment.step
    share = 1.0
    is_valid = False
    for _ in range(MAX_HALVINGS):
        trial[0] = h[0] + share * step[0]
        trial[1] = h[1] + share * step[1]
        is_valid = _evaluate(increment, load, trial)
        gains = _size(increment.unbalanced) < previous_size
        if is_valid and (gains or previous_size < ROUNDING * largest):
            break
        share *= 0.5
    for i in range(3):
        h[i] = trial[i]
    return is_valid


@compiled(internal=True)
def _equilibrium(increment, load, largest):  # type: ignore[no-untyped-def]
    """Write the state under a load and its unbalanced forces; False for none."""
    k = increment.stiffness
    unbalanced = increment.unbalanced
    step = increment.step
    is_valid = _evaluate(increment, load, increment.after.strain)
    for _ in range(MAX_ITERATIONS):
        previous_size = _size(unbalanced)
        if not is_valid or previous_size <= FORCE_TOLERANCE * largest:
            break
        det = k[0, 0] * k[1, 1] - k[0, 1] * k[1, 0]
        step[0] = (k[0, 1] * unbalanced[1] - k[1, 1] * unbalanced[0]) / det
        step[1] = (k[1, 0] * unbalanced[0] - k[0, 0] * unbalanced[1]) / det
        is_valid = _search_along(increment, load, previous_size, largest)
        if previous_size < ROUNDING * largest and _size(unbalanced) >= previous_size:
            break
    return is_valid and _size(unbalanced) <= ROUNDING * largest


@compiled(internal=True)
def _is_stable(k, h):  # type: ignore[no-untyped-def]
    """Return whether every further strain takes work; k (2, 2) at the strain h."""
    a = k[0, 0] * math.exp(-h[0])
    b = k[1, 1] * math.exp(-h[1])
    fill_of_warp = k[0, 1] * math.exp(-h[1])
    warp_of_fill = k[1, 0] * math.exp(-h[0])
    across = 0.5 * (fill_of_warp + warp_of_fill)
    return a > 0.0 and a * b > across * across


@compiled(internal=True)
def _take_slopes(  # type: ignore[no-untyped-def]
    increment,
    of_law,
    weights,
    of_moduli,
    dh,
    ds,
):
    """Take derivatives (2, p) of strain and stress to the end of an increment."""
    law = increment.law
    h = increment.after.strain
    k = increment.stiffness
    tangent = increment.written.tangent
    count = of_law.coupling.shape[1]
    for i in range(2):
        modulus_slopes(law, of_law, i, h[i], increment.before.strain[i], weights, of_moduli[i])
    arm0 = increment.thickness * math.exp(law.area_power * (h[0] + h[1]) - h[0])
    arm1 = increment.thickness * math.exp(law.area_power * (h[0] + h[1]) - h[1])
    det = k[0, 0] * k[1, 1] - k[0, 1] * k[1, 0]
    slopes = increment.written.slopes
    stress_rates(slopes, law.coupling[0], of_moduli, of_law.coupling, dh, ds, ds)
    for j in range(count):
        a0 = ds[0, j]
        a1 = ds[1, j]
        r0 = arm0 * a0
        r1 = arm1 * a1
        dh[0, j] = (k[0, 1] * r1 - k[1, 1] * r0) / det
        dh[1, j] = (k[1, 0] * r0 - k[0, 0] * r1) / det
        ds[0, j] = a0 + tangent[0, 0] * dh[0, j] + tangent[0, 1] * dh[1, j]
        ds[1, j] = a1 + tangent[1, 0] * dh[0, j] + tangent[1, 1] * dh[1, j]


@compiled()
def _follow_loads(  # type: ignore[no-untyped-def]
    law,
    thickness,
    loads,
    of_law,
    path,
):
    """Solve load by load; return how many have an equilibrium."""
    count = of_law.coupling.shape[1]
    before = PointState(np.zeros(3), np.zeros(3))
    after = PointState(np.zeros(3), np.zeros(3))
    written = point_response().law
    increment = PatchIncrement(
        law,
        thickness,
        before,
        after,
        written,
        unbalanced=np.empty(2),
        stiffness=np.empty((2, 2)),
        step=np.empty(2),
        trial=np.zeros(3),
    )
    weights = np.empty((law.pieces.shape[1], 4))
    dh = np.zeros((2, count))
    ds = np.zeros((2, count))
    of_moduli = np.zeros((2, count))
    largest = 1e-12
    for n in range(len(loads)):
        load = loads[n]
        largest = max(largest, max(abs(load[0]), abs(load[1])))
        after.strain[:] = before.strain
        if not _equilibrium(increment, load, largest):
            return n
        path.stable[n] = _is_stable(increment.stiffness, after.strain)
        if count > 0:
            _take_slopes(
                increment,
                of_law,
                weights,
                of_moduli,
                dh,
                ds,
            )
            path.slope[n] = dh
        for i in range(2):
            path.strain[n, i] = after.strain[i]
            path.stress[n, i] = after.stress[i]
        before.strain[:] = after.strain
        before.stress[:] = after.stress
    return len(loads)
