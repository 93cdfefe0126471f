"""A fit's problem at a law that is given: only the nuisance is fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..materials.law import HypoelasticLaw
from .bounds import LawBounds
from .comparison import Comparison
from .methods.descent import descend
from .problem import Evaluation, FitProblem
from .unknowns import Unknowns

Array = NDArray[np.float64]

#: MPa: the law is given and not looked for; bounds only size the unknowns.
ANY = {"E1": (1e-3, 1e6), "E2": (1e-3, 1e6), "G12": (1e-3, 1e6)}

#: Analyses in which what is no law (offsets, the sheet's surface) is fitted to the tests.
MOST = 40
TOLERANCE = 1e-9


def problem_at(law: HypoelasticLaw, comparisons: Sequence[Comparison]) -> tuple[FitProblem, Array]:
    """Comparisons with a law that is given, and its unknowns (count,), nuisance at its start."""
    ends = law.strain_range.tolist()
    unknowns = Unknowns.of(law.form, law.nu12, ends, LawBounds.of_moduli(ANY), comparisons)
    y = unknowns.at(law.beta[list(unknowns.free)])
    return FitProblem(tuple(comparisons), law, unknowns), y


def evaluate_law(problem: FitProblem, y: Array, with_jacobian: bool = False) -> Evaluation | None:
    """At the law of unknowns y, the nuisance where it fits best; None where an analysis failed.

    The nuisance stays as in y where the problem's solver gives no derivatives.
    """
    if not problem.unknowns.nuisance.all or not problem.differentiates:
        return problem.evaluate(y, with_jacobian, warm=False)
    first = problem.evaluate(y, True)
    if first is None:
        return None
    free = np.arange(problem.unknowns.count) >= problem.unknowns.size
    best, _ = descend(problem, first, TOLERANCE, MOST, norms=True, only=free)
    return best
