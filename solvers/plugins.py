"""Solvers of other distributions: entry points of the group `bubblefit.solvers`.

Names are looked up without importing anything; a plug-in is imported when its name is asked for.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from ..errors import BubblefitError, InputError, SolverFailure
from .base import Solver

GROUP = "bubblefit.solvers"


@dataclass(frozen=True)
class PlugIn:
    """One solver that another distribution offers: its name, and who offers it ("NAME VERSION")."""

    name: str
    distribution: str
    entry: EntryPoint

    def make(self, **options: Any) -> Solver:
        """A new solver from the factory that the entry point names.

        Raises
        ------
        SolverFailure : it cannot be imported, is no factory, fails, or gives no solver; the
            distribution is named.
        InputError : an option that the factory does not take, or does not like.
        """
        factory = self._factory()
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
            raise self.failure("fails when it is made", error) from error
        if not isinstance(solver, Solver):
            missing = [n for n in ("name", "external", "run", "check") if not hasattr(solver, n)]
            raise self.failure(f"gives no solver: {type(solver).__name__} has no "
                               f"{', '.join(missing)}")  # fmt: skip
        return solver

    def failure(self, what: str, error: BaseException | None = None) -> SolverFailure:
        """The plug-in is at fault: one line that names the distribution."""
        cause = ""
        if error is not None:
            first = (str(error).splitlines() or [""])[0]
            cause = f" ({type(error).__name__}{': ' if first else ''}{first})"
        problem = f"the plug-in {self.name!r} of {self.distribution} {what}{cause}"
        return SolverFailure(f"{problem}; repair or uninstall it", self.name)

    def _factory(self) -> Callable[..., Any]:
        try:
            factory = self.entry.load()
        # A module may do anything when it is imported, sys.exit included.
        except (Exception, SystemExit) as error:
            raise self.failure("cannot be imported", error) from error
        if not callable(factory):
            raise self.failure(f"is no factory: {self.entry.value} cannot be called")
        return factory


def plug_ins() -> list[PlugIn]:
    """Every plug-in that is installed, by name; two of one name are both there."""
    found = {}
    for entry in entry_points(group=GROUP):
        # An editable install may be listed twice.
        found[entry.name, entry.value] = PlugIn(entry.name, _distribution(entry), entry)
    return [found[key] for key in sorted(found)]


def plug_in_named(name: str) -> PlugIn | None:
    """The plug-in of that name, or None.

    Raises
    ------
    SolverFailure : two distributions offer it.
    """
    offers = [plug_in for plug_in in plug_ins() if plug_in.name == name]
    if len(offers) > 1:
        both = " and ".join(offer.distribution for offer in offers)
        raise SolverFailure(f"is offered by {both}; uninstall one of them", name)
    return offers[0] if offers else None


def _distribution(entry: EntryPoint) -> str:
    try:
        if entry.dist is not None:
            return f"{entry.dist.name} {entry.dist.version}"
    except Exception:  # a damaged installation: what it is called is only for the message
        pass
    return f"an unknown distribution ({entry.value})"
