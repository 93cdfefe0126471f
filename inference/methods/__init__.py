"""Optimisers of a fit: each module here defines one as `METHOD`, named as its file."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Literal, Protocol

from ...errors import InputError
from ...light_dataclasses import dataclass
from ...materials.forms.base import Array

if TYPE_CHECKING:  # the names of the optimisers are asked for by commands that only print help
    from ..problem import FitProblem, Optimum


@dataclass(frozen=True)
class FitOptions:
    """Options of the fit from each start.

    Attributes
    ----------
    method : str
        Name of the optimiser.
    gradient : {"exact", "differences"}
        Gradient of the objective e: from the exact Jacobian or from finite differences.
    constraints : {"margin", "boolean"}
        Positivity of the moduli: linear inequalities, or flags without a gradient.
    tolerance : float
        Value of the objective e at which the fit ends.
    max_analyses : int
        Value of `problem.analyses` at which the fit ends; it counts those before it as well.
    max_runs : int
        Largest number of runs of a solver without derivatives, which a surrogate leads.
    leads : bool
        Whether the fit only finds the start of another one, for which a rough least squares fit is
        enough.
    """

    method: str = "lm"
    gradient: Literal["exact", "differences"] = "exact"
    constraints: Literal["margin", "boolean"] = "margin"
    tolerance: float = 1e-7
    max_analyses: int = 100
    max_runs: int = 10
    leads: bool = False


class Method(Protocol):
    """An optimiser, which goes from a start to the minimum of a problem's objective e.

    It uses of a `FitProblem` its `evaluate` (residual, exact Jacobian and e, or None where the
    analysis failed), its `blocks`, and the linear `inequalities` and the `box` of its `unknowns`.
    It must not end at an equilibrium that is not `stable`.

    Attributes
    ----------
    needs_slope : bool
        Whether it needs derivatives, from a surrogate if the solver gives none.
    boolean : bool
        Whether it also takes boolean constraints.
    max_analyses : int
        Largest number of analyses from one start, by default.
    """

    needs_slope: bool
    boolean: bool
    max_analyses: int

    def minimise(self, problem: FitProblem, start: Array, options: FitOptions) -> Optimum | None:
        """Fit from one start.

        Parameters
        ----------
        problem : FitProblem
        start : (unknowns,) array
        options : FitOptions

        Returns
        -------
        Optimum or None
            None when the analysis at the start fails.
        """


@cache
def method_names() -> tuple[str, ...]:
    """Return the names of all optimisers, the default first."""
    names = sorted(module.name for module in iter_modules([str(Path(__file__).parent)]))
    return tuple(sorted(names, key=lambda name: name != FitOptions.method))


def method_named(name: str) -> Method:
    """Return the optimiser of that name; raise InputError where there is none."""
    if name not in method_names():
        raise InputError(None, "method", f"{name!r} is not one of {', '.join(method_names())}")
    return import_module(f".{name}", __package__).METHOD
