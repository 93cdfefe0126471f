"""Solvers by name: the one place where a name, with a table of settings, becomes a solver."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import BubblefitError, InputError, SolverFailure
from ..section_errors import first_error
from .base import Solver, SolverCheck
from .calculix.settings import OFFER as CALCULIX
from .licence_settings import SCHEDULER, licence_settings, split
from .licences import licensed
from .marc.settings import OFFER as MARC
from .membrane.settings import OFFER as MEMBRANE
from .offer import Offer
from .once import with_cache
from .plugins import plug_in_named, plug_ins
from .run_cache import RunCache
from .scratch import sweep_left
from .settings import SolverSettings, check_programs

#: What makes each of our own solvers from its options.
SOLVERS: dict[str, Callable[..., Solver]] = {
    "calculix": CALCULIX,
    "marc": MARC,
    "membrane": MEMBRANE,
}


def solver_names() -> list[str]:
    """Every solver that can be asked for, ours and those of plug-ins."""
    return sorted({*SOLVERS, *(plug_in.name for plug_in in plug_ins())})


def solver_sections() -> dict[str, type[SolverSettings]]:
    """What the table [solver.NAME] of a project may say, by name of a solver of ours."""
    return {name: make.settings for name, make in SOLVERS.items() if isinstance(make, Offer)}


def solver_settings(path: Path, tables: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """By name of a solver, what it is made with; ours are there without a table, too.

    Parameters
    ----------
    path : the project's file; paths in its tables are beside it.
    tables : [solver] of the project. A plug-in's is as it is written, but for licences: the plug-in
        checks it.

    Raises
    ------
    InputError : a key that there is not, a value that cannot be meant; no solver of that name.
    """
    found: dict[str, dict[str, Any]] = {}
    for name, section in solver_sections().items():
        try:
            settings = section.model_validate(tables.get(name, {}))
        except ValidationError as error:
            raise first_error(path, error, section, f"solver.{name}") from None
        advice = " or ".join(f"--{one.name}" for one in section.overrides if one.look)
        advice = advice and f"say it on the command line ({advice}), or "
        check_programs(path, name, tables.get(name, {}), section.started, advice)
        found[name] = settings.given(path.parent)
    for name in sorted(tables.keys() - found.keys()):
        if name not in SOLVERS and name not in (known := solver_names()):
            problem = f"no solver of this name is installed; there are: {', '.join(known)}"
            raise InputError(path, f"solver.{name}", problem)
        if not isinstance(tables[name], Mapping):
            raise InputError(path, f"solver.{name}", "expected a table of the solver's settings")
        check_programs(path, name, tables[name], _started(name))
        licences, own = split(tables[name])
        if SCHEDULER in licences:  # who answers there can run code here: only the user may name it
            raise InputError(path, f"solver.{name}.{SCHEDULER}", "say --scheduler instead")
        found[name] = {
            **own,
            **licence_settings(name, licences, path).model_dump(exclude_unset=True),
        }
    return found


def _started(name: str) -> tuple[str, ...]:
    """Options of a plug-in that say what is run: what its factory has as `started`."""
    with suppress(SolverFailure):  # whoever makes the solver says what is wrong with it
        plug_in = plug_in_named(name)
        if plug_in is not None:
            return tuple(getattr(plug_in.factory(), "started", ()))
    return ()


def solver_named(name: str, cache: RunCache | None = None, /, **options: Any) -> Solver:
    """A new solver with its constructor's `options`: ours, else that of a plug-in.

    What options say of licences is not the solver's matter: every external one is held to it.

    Parameters
    ----------
    cache : where runs of another program are kept; every run is made where it is None.

    Raises
    ------
    InputError : there is none of that name (says which there are), or an option is wrong.
    SolverFailure : a plug-in that does not work; names its distribution.
    """
    # A plug-in cannot take the place of one of ours.
    make: Callable[..., Solver]
    if name in SOLVERS:
        make = SOLVERS[name]
    else:
        plug_in = plug_in_named(name)
        if plug_in is None:
            raise InputError(None, "solver", f"{name!r} is not one of: {', '.join(solver_names())}")
        make = plug_in.make
    licences, own = split(options)
    made = make(**own)
    # The project's words count more than the site's.
    solver = licensed(made, name, {**getattr(made, "site_licences", {}), **licences})
    if cache is None:
        return solver
    return with_cache(solver, cache, counted(name, own))


def counted(name: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Of what the solver `name` is made with, what may change a result; of a plug-in all."""
    _, own = split(options)  # a licence changes no result
    section = solver_sections().get(name)
    return dict(own) if section is None else section.counted(own)


def usable_solver(
    name: str,
    options: Mapping[str, Any] | None = None,
    path: Path | None = None,
    key: str = "fit.solver",
    cache: RunCache | None = None,
) -> Solver:
    """A new solver that is there and carries the law: one line now, not in every analysis.

    More of them, each with what it prepares for a model of its own, are then had by
    `solver_named`.

    Parameters
    ----------
    options : what it is made with, as `solver_settings` has it.
    path, key : the project that names it, and where. cache : as of `solver_named`.

    Raises
    ------
    InputError : there is no such solver, or an option is wrong (says in which file).
    SolverFailure : it is not installed, or does not carry the law.
    """
    try:
        solver = solver_named(name, cache, **(options or {}))
    except InputError as error:
        if error.field == "solver":
            raise InputError(path, f"{key} (or --solver)", error.problem) from None
        # Ours may also have their options from the command line.
        if name not in SOLVERS and error.path is None and error.field.startswith(f"solver.{name}"):
            raise InputError(path, error.field, error.problem) from None
        raise
    if solver.external:
        place = (options or {}).get("scratch")
        sweep_left(None if place is None else Path(place))
        found = checked(name, solver)
        if not (found.available and found.carries_law):
            raise SolverFailure(found.advice or "is not usable", name)
    return solver


def checked(name: str, solver: Solver) -> SolverCheck:
    """What `check` finds of the solver `name`.

    Raises
    ------
    SolverFailure : the check of a plug-in fails; names its distribution.
    InputError : an option that the check does not like.
    """
    try:
        return solver.check()
    except BubblefitError:
        raise
    except Exception as error:
        plug_in = None if name in SOLVERS else plug_in_named(name)
        if plug_in is None:
            raise
        raise plug_in.solver_failure("fails its check", error) from error
