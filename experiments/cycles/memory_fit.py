"""Fit a loading curve with a memory to a load history, and predict cycles from the others."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...lazy_modules import pandas as pd
from ...materials.forms.spline import Spline
from ...materials.law import HypoelasticLaw, law_slopes
from ...materials.memory import NAMES, QUANTITIES, Memory, own_stress
from ...readers.histories import passage
from ...solvers.base import Array
from .values import CRITERIA, EvaluatedHistory, matched_rows, tangent_stiffness


@dataclass(frozen=True)
class CycleFitSettings:
    """Settings of a fit of a loading curve and a memory to a history."""

    knots: int = 8  # number of knots of the tangent of the loading curve
    tangent_bounds: tuple[float, float] = (1e-4, 1e2)  # over the mean stiffness
    largest_set: float = 0.99
    largest_unloading: float = 1.99  # largest unloading U; the reloading R stays below U
    largest_saturation: float = 100.0
    slip_bounds: tuple[float, float] = (-0.1, 0.3)  # over the largest strain
    slip_step: float = 1e-7  # step of central differences by slip, over the largest strain
    initial_memory: tuple[float, ...] = (0.3, 1.4, 0.4, 0.1)  # set, U, share of R, saturation
    tolerance: float = 1e-14
    max_evaluations: int = 400
    driven_points: int = 400  # number of points along a branch that is predicted


CYCLE_FIT = CycleFitSettings()


@dataclass(frozen=True, eq=False)
class FittedCycles:
    """A loading curve with unloading and reloading, fitted to a history (`materials/memory.py`).

    Parameters
    ----------
    knots, stiffness : (k,) arrays
        Strains above that at the reference load, and the tangent of the loading curve there, N.
    memory : (4,) array
        Set, unloading, reloading and saturation, in the order of `memory.QUANTITIES`.
    slip : mapping of int to float
        Strain that the extensometer lost before a cycle, by the number of the cycle.
    sigma : (k + 4 + slips,) array
        One standard deviation of each stiffness, constant of the memory and slip, if the errors of
        all readings are independent.
    rows : (n,) array of int
        Rows of the history that the model follows.
    strain, load : (n,) arrays
        Strain of the law at each of these rows, and modelled load, N.
    rms : float
        RMS error of the loads that were fitted, N.
    law : HypoelasticLaw
        The fitted law.
    """

    knots: Array
    stiffness: Array
    memory: Array
    slip: Mapping[int, float]
    sigma: Array
    rows: NDArray[np.intp]
    strain: Array
    load: Array
    rms: float
    law: HypoelasticLaw

    @property
    def remembered(self) -> list[tuple[str, float, float]]:
        """Return name, value and one standard deviation of each constant of the memory."""
        sigma = self.sigma[len(self.knots) :].tolist()
        return list(zip(QUANTITIES, self.memory.tolist(), sigma, strict=False))

    def driven(self, preceding: int, peak: float, level: float) -> tuple[Array, ...]:
        """Predict a loading up to a peak load and the unloading after it, by the fitted law.

        Parameters
        ----------
        preceding : int
            How many of the `rows` precede the loading; the law follows their strains first.
        peak : float
            Load at which the loading ends, N.
        level : float
            Reference load, N, from which strains and loads of the law count.

        Returns
        -------
        strain_up, load_up, strain_down, load_down : arrays
            Strains and loads (N) along the loading and along the unloading.
        """
        path = self.strain[:preceding]
        branches: list[Array] = []
        for end in (self.law.strain_range[0], 0.0):
            strain = np.linspace(path[-1], end, CYCLE_FIT.driven_points)
            load = _stress(self.law, np.r_[path, strain[1:]])[len(path) - 1 :] + level
            i, strain_at_peak = passage(load, strain, peak if end else -np.inf)
            if i >= 0:
                strain = np.r_[strain[: i + 1], strain_at_peak]
                load = np.r_[load[: i + 1], peak]
            branches += [strain, load]
            path = np.r_[path, strain[1:]]
        return tuple(branches)


def _stress(law: HypoelasticLaw, strain: Array) -> Array:
    """Return the stress (n,) of a law along a history of strain (n,) of the warp."""
    return own_stress(law.compiled, 0, strain, law_slopes(law, [], 1.0))[0]


class CycleFit:
    """The least squares problem for a loading curve, a memory and slips of an extensometer.

    The unknowns x are, in this order: the tangent at each knot over the mean stiffness; the set;
    the unloading U; (R - 1) / (U - 1), which keeps the reloading R below U; the saturation; and
    each slip over the largest strain. Readings between the first and the last crossing of the
    reference load are fitted, each branch with the same weight.

    Parameters
    ----------
    evaluated : EvaluatedHistory
        History that is fitted.
    knots : int
        Number of knots of the tangent of the loading curve.
    leave : int
        Number of a cycle that is not fitted, or 0; it shares its slip with the next cycle.
    """

    def __init__(self, evaluated: EvaluatedHistory, knots: int, leave: int) -> None:
        history = evaluated.history
        start, end = matched_rows(evaluated)
        self.rows = np.arange(start, end + 1)
        self.strain = history.strain[self.rows] - evaluated.zero
        self.load = history.load[self.rows] - evaluated.reference
        cycle_starts = [v.cycle.start for v in evaluated.values]
        number = np.searchsorted(cycle_starts, self.rows, "right")
        self.weight = self._branch_weights(evaluated, number, leave)
        cycle_count = len(evaluated.values)
        with_next = leave if leave == cycle_count else leave + 1
        self.slipped = [k for k in range(2, cycle_count + 1) if k != with_next]
        self.has_slipped = (number[:, None] >= self.slipped).astype(float)
        self.top = float(self.strain[self.weight > 0].max())
        # The history strains the warp alone: E2 and G12 are constant.
        end_knots = [0.0, 1.0]
        strains = np.linspace(0.0, self.top, knots).tolist()
        self.form = Spline.at([strains, end_knots, end_knots])
        self.knots = knots
        #: Place of the first slip among the unknowns.
        self.first_slip = knots + len(QUANTITIES)
        self.mean = float(self.load.max()) / self.top
        tangents = range(self.form.size - knots, self.form.size)  # E1 comes last
        self.names = [*(f"beta_{i}" for i in tangents), *NAMES[: len(QUANTITIES)]]

    def _branch_weights(
        self, evaluated: EvaluatedHistory, number: NDArray[np.intp], leave: int
    ) -> Array:
        """Return the weight (n,) of each reading by its branch; 0 in the cycle that is left out.

        `number` (n,) is the number of each reading's cycle.
        """
        weight = np.zeros(len(self.rows))
        for v in evaluated.values:
            for side in (self.rows < v.cycle.peak, self.rows >= v.cycle.peak):
                is_branch = side & (number == v.cycle.number) & (v.cycle.number != leave)
                weight[is_branch] = 1.0 / (v.peak * math.sqrt(max(int(is_branch.sum()), 1)))
        return weight

    def law_at(self, x: Array) -> HypoelasticLaw:
        """Return the law that the unknowns x (unknowns,) define."""
        permanent, unloading, share, saturation = x[self.knots : self.first_slip]
        reloading = 1.0 + share * (unloading - 1.0)
        without_memory = [0, 1, 1, 0] * 2  # `QUANTITIES` of fill and shear
        constants = [permanent, unloading, reloading, saturation / self.top]
        memory = Memory.of([*constants, *without_memory])
        constant_moduli = np.full(self.form.size - self.knots, self.mean)
        beta = np.r_[constant_moduli, self.mean * x[: self.knots]]
        strain_range = np.array([self.top, 1, 1])
        return HypoelasticLaw(beta, 0.0, strain_range, form=self.form, memory=memory)

    def strain_at(self, x: Array) -> Array:
        """Return the strains (n,) of the law: those measured and what slips have lost."""
        return np.maximum(self.strain + self.top * self.has_slipped @ x[self.first_slip :], 0.0)

    def residual(self, x: Array) -> Array:
        """Return the weighted residuals (n,) of the loads at unknowns x."""
        return self.weight * (_stress(self.law_at(x), self.strain_at(x)) - self.load)

    def jacobian(self, x: Array) -> Array:
        """Return the derivatives (n, unknowns) of the residuals; central differences for slips."""
        knots = self.knots
        law = self.law_at(x)
        strain = self.strain_at(x)
        slopes = law_slopes(law, self.names, 1.0)
        by_constants = own_stress(law.compiled, 0, strain, slopes)[1]
        unloading, share = x[knots + 1 : knots + 3]
        chain = np.diag([*[self.mean] * knots, 1.0, 1.0, unloading - 1.0, 1.0 / self.top])
        chain[knots + 2, knots + 1] = share
        by_slip = []
        step = CYCLE_FIT.slip_step
        for direction in np.eye(len(x))[self.first_slip :]:
            forward = _stress(law, self.strain_at(x + step * direction))
            backward = _stress(law, self.strain_at(x - step * direction))
            by_slip.append((forward - backward) / (2 * step))
        return self.weight[:, None] * np.column_stack([by_constants @ chain, *by_slip])

    def solve(self) -> Any:
        """Return the result of `scipy.optimize.least_squares`."""
        settings = CYCLE_FIT
        count = len(self.slipped)
        low_tangent, high_tangent = settings.tangent_bounds
        low_slip, high_slip = settings.slip_bounds
        low = [*[low_tangent] * self.knots, 0.0, 1.0, 0.0, 0.0, *[low_slip] * count]
        largest = settings.largest_set, settings.largest_unloading, 1.0, settings.largest_saturation
        high = [*[high_tangent] * self.knots, *largest, *[high_slip] * count]
        begin = [*[1.0] * self.knots, *settings.initial_memory, *[0.0] * count]
        return scipy.optimize.least_squares(
            self.residual,
            begin,
            self.jacobian,
            bounds=(low, high),
            xtol=settings.tolerance,
            ftol=settings.tolerance,
            gtol=settings.tolerance,
            max_nfev=settings.max_evaluations,
        )

    def sigma(self, best: Any) -> Array:
        """Return one standard deviation (unknowns,) of each, if errors of readings are independent.

        `best` is the result of `solve`.
        """
        freedom = max(int((self.weight > 0).sum()) - len(best.x), 1)
        variance = 2 * best.cost / freedom
        unloading = best.x[self.knots + 1]
        scale = np.r_[
            np.full(self.knots, self.mean),
            1.0,
            1.0,
            unloading - 1.0,
            1.0 / self.top,
            np.full(len(self.slipped), self.top),
        ]
        covariance = np.linalg.pinv(best.jac.T @ best.jac)
        return scale * np.sqrt(variance * np.diag(covariance))


def fit_cycles(
    evaluated: EvaluatedHistory, knots: int = CYCLE_FIT.knots, leave: int = 0
) -> FittedCycles:
    """Fit a loading curve and a memory to the cycles of a history.

    Parameters
    ----------
    evaluated : EvaluatedHistory
        History that is fitted.
    knots : int
        Number of knots of the tangent of the loading curve.
    leave : int
        Number of a cycle that is not fitted; 0 if all are fitted.

    Returns
    -------
    FittedCycles
        The fit, with the strain that the extensometer lost by slip before each cycle from the
        second on. A cycle that is left out shares its slip with the next one.
    """
    problem = CycleFit(evaluated, knots, leave)
    best = problem.solve()
    law = problem.law_at(best.x)
    strain = problem.strain_at(best.x)
    load = _stress(law, strain)
    is_fitted = problem.weight > 0
    slips = (problem.top * best.x[problem.first_slip :]).tolist()
    constants = law.memory.constants[: len(QUANTITIES)] if law.memory else ()
    return FittedCycles(
        knots=np.array(problem.form.knots[0]),
        stiffness=problem.mean * best.x[:knots],
        memory=np.array(constants),
        slip=dict(zip(problem.slipped, slips, strict=True)),
        sigma=problem.sigma(best),
        rows=problem.rows,
        strain=strain,
        load=load + evaluated.reference,
        rms=float(np.sqrt(np.mean((load - problem.load)[is_fitted] ** 2))),
        law=law,
    )


def left_out(evaluated: EvaluatedHistory, knots: int = CYCLE_FIT.knots) -> pd.DataFrame:
    """Return stiffness and permanent strain of each cycle beside a prediction by the others.

    The prediction follows the loads of the cycle, as a machine under load control would, and has no
    slip.

    Parameters
    ----------
    evaluated : EvaluatedHistory
        History whose cycles are left out one by one.
    knots : int
        Number of knots of the tangent of the loading curve.

    Returns
    -------
    DataFrame
        A row for each cycle, except the first and any that alone reaches its load, which others
        cannot predict, and any without a permanent strain.
    """
    rows = []
    for v in evaluated.values:
        number = v.cycle.number
        other_peaks = [w.peak for w in evaluated.values if w is not v]
        if (
            number == 1
            or v.peak > (1 + CRITERIA.same_peak) * max(other_peaks)
            or math.isnan(v.permanent)
        ):
            continue
        fitted = fit_cycles(evaluated, knots, leave=number)
        preceding = int(np.searchsorted(fitted.rows, v.cycle.start))
        strain_up, load_up, strain_down, load_down = fitted.driven(
            preceding, v.peak, evaluated.reference
        )
        row: dict[str, Any] = {"file": evaluated.history.path.name, "cycle": number}
        branches = {"EA_loading": (load_up, strain_up), "EA_unloading": (load_down, strain_down)}
        for name, (load, strain) in branches.items():
            measured = getattr(v, name)
            predicted = tangent_stiffness(load, strain, v.peak)
            row |= {f"{name}_N": measured, f"{name}_predicted_N": predicted}
            row[f"{name}_off_percent"] = 100 * (predicted / measured - 1)
        permanent = passage(load_down, strain_down, evaluated.reference)[1]
        row |= {
            "permanent_strain": v.permanent,
            "permanent_strain_predicted": permanent,
            "permanent_strain_off": permanent - v.permanent,
        }
        rows.append(row)
    return pd.DataFrame(rows)
