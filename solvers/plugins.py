"""Solvers of other distributions: entry points of the group `bubblefit.solvers`."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from .. import plugins
from ..errors import BubblefitError, InputError, PlugInFailure, SolverFailure
from .base import Solver

#: What makes a thing a solver.
NEEDED = ("name", "external", "progress", "identity", "run", "check")


class PlugIn(plugins.PlugIn):
    """One solver that another distribution offers; what is wrong with it is a `SolverFailure`."""

    def make(self, **options: Any) -> Solver:
        """A new solver from the factory that the entry point names.

        Raises
        ------
        SolverFailure : it cannot be imported, is no factory, fails, or gives no solver; the
            distribution is named.
        InputError : an option that the factory does not take, or does not like.
        """
        factory = self.factory()
        try:
            inspect.signature(factory).bind(**options)
        except TypeError as error:
            problem = f"{error} (of {self.distribution}); see its documentation"
            raise InputError(None, f"solver.{self.name}", problem) from None
        except ValueError:  # compiled code tells no signature
            pass
        try:
            solver = factory(**options)
        except BubblefitError:
            raise
        except Exception as error:
            raise self.solver_failure("fails when it is made", error) from error
        if not isinstance(solver, Solver):
            missing = [name for name in NEEDED if not hasattr(solver, name)]
            what = f"gives no solver: {type(solver).__name__} has no {', '.join(missing)}"
            raise self.solver_failure(what)
        return solver

    def solver_failure(self, what: str, error: BaseException | None = None) -> SolverFailure:
        """As `failure`, for those who run analyses."""
        return SolverFailure(str(self.failure(what, error)), self.name)

    def factory(self) -> Callable[..., Any]:
        """What the entry point names.

        Raises
        ------
        SolverFailure : it cannot be imported, or called.
        """
        try:
            factory = self.load()
        except PlugInFailure as error:
            raise SolverFailure(str(error), self.name) from error.__cause__
        if not callable(factory):
            raise self.solver_failure(f"is no factory: {self.entry.value} cannot be called")
        return factory


def plug_ins() -> list[PlugIn]:
    """Every solver that is installed as a plug-in, by name; two of one name are both there."""
    offers = plugins.plug_ins("bubblefit.solvers")
    return [PlugIn(one.name, one.distribution, one.entry) for one in offers]


def plug_in_named(name: str) -> PlugIn | None:
    """The plug-in of that name, or None.

    Raises
    ------
    SolverFailure : two distributions offer it.
    """
    try:
        one = plugins.plug_in_named("bubblefit.solvers", name)
    except PlugInFailure as error:
        raise SolverFailure(str(error).removeprefix(f"{name}: "), name) from None
    return None if one is None else PlugIn(one.name, one.distribution, one.entry)
