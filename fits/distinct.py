"""Which of many optima are distinct: those whose moduli, or what they leave, differ."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..identification.problem import FitProblem
from ..materials.forms.base import COMPONENTS
from .start import StartRecord

Array = NDArray[np.float64]

#: Optima are one where no modulus differs by more over the strains reached, relative: starts that
#: end in one and the same optimum of a real test differ by up to 0.7 % ...
SAME_MODULI = 0.02
#: ... and the objectives by no more, relative, beside the fit's tolerance.
SAME_OBJECTIVE = 0.01
#: Strains at which moduli are compared.
POINTS = 31


def distinct(
    problem: FitProblem, records: Sequence[StartRecord], tolerance: float
) -> list[list[StartRecord]]:
    """Starts that ended in the same optimum together, each group in the order of their numbers.

    Each is compared with the first of a group: by its moduli up to the strains that either of the
    two optima reached, and by what it leaves. So groups do not depend on starts of higher numbers.
    One without an optimum is a group of its own.

    tolerance : of the objective; below it objectives are the same.
    """
    groups: list[list[StartRecord]] = []
    for record in sorted(records, key=lambda r: r.number):
        same = (g for g in groups if _are_one(problem, g[0], record, tolerance))
        group = next(same, None)
        if group is None:
            groups.append([record])
        else:
            group.append(record)
    return groups


def _are_one(problem: FitProblem, a: StartRecord, b: StartRecord, tolerance: float) -> bool:
    if a.objective is None or b.objective is None:
        return False
    room = tolerance + SAME_OBJECTIVE * min(a.objective, b.objective)
    if abs(a.objective - b.objective) > room:
        return False
    return moduli_apart(problem, a, b) <= SAME_MODULI


def moduli_apart(problem: FitProblem, a: StartRecord, b: StartRecord) -> float:
    """Largest relative difference of a modulus between two optima, over the strains reached."""
    one, other = (problem.unknowns.law(problem.law, np.array(record.unknowns)) for record in (a, b))
    ends = np.maximum(a.reached, b.reached)
    apart = []
    for name, component in COMPONENTS.items():
        strain = np.linspace(0.0, ends[component], POINTS)
        apart.append(np.abs(one.modulus(name, strain) / other.modulus(name, strain) - 1.0).max())
    return float(max(apart))
