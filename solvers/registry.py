"""Solvers by name: the one place where a name becomes a solver."""

import inspect
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

from pydantic import ValidationError

from ..errors import BubblefitError, InputError, PlugInFailure, SolverFailure
from ..plugins import Group, PlugIn, names_with_plug_ins, plug_in_named, plug_ins
from ..readers.sections import first_error
from .bars import TOLERANCE, difference, strip_stresses
from .base import Diagnosis, Solver, SolverCheck
from .licences import licensed
from .run_cache import RunCache, with_cache
from .scratch import sweep_left
from .settings import (
    SCHEDULER,
    Override,
    SolverOffer,
    SolverSettings,
    check_programs,
    licence_settings,
    split,
)

GROUP: Group = "bubblefit.solvers"
#: The solver that leads a fit by its derivatives where the program of that gives none.
SURROGATE = "membrane"
#: What makes each of our own solvers from its options.
SOLVERS: dict[str, Callable[..., Solver]] = {
    offer.name: offer
    for offer in (
        SolverOffer(
            "calculix", "calculix.solver:CalculixSolver", "calculix.executable:CalculixSettings"
        ),
        SolverOffer("command", "command:CommandSolver", "command:CommandSettings"),
        SolverOffer("marc", "marc.solver:MarcSolver", "marc.settings:MarcSettings"),
        SolverOffer(
            "membrane", "membrane.solver:MembraneSolver", "membrane.settings:MembraneSettings"
        ),
    )
}
#: Attributes of a solver.
NEEDED = ("name", "external", "progress", "identity", "run", "check")
#: Option for any setting of any solver, those of plug-ins among them, as KEY=VALUE.
ANY = "solver-option"


def _plug_in_named(name: str) -> PlugIn | None:
    """Return the plug-in of that name, or None; SolverFailure where two distributions offer it."""
    with _failing(name):
        return plug_in_named(GROUP, name)


@contextmanager
def _failing(name: str) -> Iterator[None]:
    """Turn a failure of a plug-in within the block into one of an analysis."""
    try:
        yield
    except PlugInFailure as error:
        raise SolverFailure(str(error).removeprefix(f"{name}: "), name) from error.__cause__


def _factory(plug_in: PlugIn) -> Callable[..., Any]:
    """Import the factory; SolverFailure where it cannot be imported or called."""
    with _failing(plug_in.name):
        factory = plug_in.load()
        if not callable(factory):
            raise plug_in.failure(f"is no factory: {plug_in.entry.value} cannot be called")
    return cast(Callable[..., Any], factory)


def _made(plug_in: PlugIn, options: Mapping[str, Any]) -> Solver:
    """Return a new solver of the factory; SolverFailure: it is none or fails; InputError."""
    factory = _factory(plug_in)
    try:
        inspect.signature(factory).bind(**options)
    except TypeError as error:
        problem = f"{error} (of {plug_in.distribution}); see its documentation"
        raise InputError(None, f"solver.{plug_in.name}", problem) from None
    except ValueError:  # compiled code has no signature
        pass
    with _failing(plug_in.name):
        with plug_in.calling("fails when it is made"):
            solver = factory(**options)
        if not isinstance(solver, Solver):
            missing = ", ".join(name for name in NEEDED if not hasattr(solver, name))
            raise plug_in.failure(f"gives no solver: {type(solver).__name__} has no {missing}")
    return solver


def solver_names() -> list[str]:
    """Return the names of all solvers, ours and those of plug-ins."""
    return sorted(names_with_plug_ins(GROUP, SOLVERS))


def solver_sections() -> dict[str, type[SolverSettings]]:
    """Return the schemas of the tables [solver.NAME] of our solvers."""
    return {name: make.settings for name, make in SOLVERS.items() if isinstance(make, SolverOffer)}


def settings_section(name: str) -> type[SolverSettings] | None:
    """Return the schema of the table [solver.NAME] of one of our solvers, else None."""
    offer = SOLVERS.get(name)
    return offer.settings if isinstance(offer, SolverOffer) else None


class SolverOptions(Mapping[str, dict[str, Any]]):
    """Options of each solver by name; defaults of ours are read when they are needed.

    Parameters
    ----------
    folder : Path
        Of the project.
    options : mapping
        Of the solvers that have a table in it.
    """

    def __init__(self, folder: Path, options: Mapping[str, dict[str, Any]]) -> None:
        self._folder = folder
        self._options = dict(options)

    def __getitem__(self, name: str) -> dict[str, Any]:
        if name not in self._options:
            section = settings_section(name)
            if section is None:
                raise KeyError(name)
            self._options[name] = section().given(self._folder)
        return self._options[name]

    def __iter__(self) -> Iterator[str]:
        ours = [name for name, offer in SOLVERS.items() if isinstance(offer, SolverOffer)]
        return iter([*ours, *(name for name in self._options if name not in ours)])

    def __len__(self) -> int:
        return sum(1 for _ in self)


def solver_settings(path: Path, tables: Mapping[str, Any]) -> SolverOptions:
    """Return the options of each solver by name, of ours also without a table.

    Parameters
    ----------
    path : Path
        Of the project.
    tables : mapping
        [solver]. Of a plug-in's only keys of licences are checked here.

    Raises
    ------
    InputError
        An unknown solver or key, or a wrong value.
    """
    options: dict[str, dict[str, Any]] = {}
    for name in sorted(tables, key=lambda name: (name not in SOLVERS, name)):
        section = settings_section(name)
        if section is not None:
            options[name] = _options_of_ours(path, name, tables[name], section)
        else:
            options[name] = _options_of_plug_in(path, name, tables[name])
    return SolverOptions(path.parent, options)


def _options_of_ours(
    path: Path,
    name: str,
    table: Any,
    section: type[SolverSettings],
) -> dict[str, Any]:
    """Return the options of one of our solvers; InputError."""
    try:
        settings = section.model_validate(table)
    except ValidationError as error:
        raise first_error(path, error, section, f"solver.{name}") from None
    advice = " or ".join(f"--{override.name}" for override in section.overrides if override.look)
    advice = advice and f"say it on the command line ({advice}), or "
    check_programs(path, name, table, section.started, advice)
    return settings.given(path.parent)


def _options_of_plug_in(path: Path, name: str, table: Any) -> dict[str, Any]:
    """Return the options of a plug-in, of which only keys of licences are checked; InputError."""
    if name not in SOLVERS:
        names = solver_names()
        if name not in names:
            problem = f"no solver of this name is installed; there are: {', '.join(names)}"
            raise InputError(path, f"solver.{name}", problem)
    if not isinstance(table, Mapping):
        raise InputError(path, f"solver.{name}", "expected a table of the solver's settings")
    check_programs(path, name, table, _started(name))
    licences, solver_options = split(table)
    if SCHEDULER in licences:  # who answers there can run code here: only the user may name it
        raise InputError(path, f"solver.{name}.{SCHEDULER}", "say --scheduler instead")
    counts = licence_settings(name, licences, path)
    return solver_options | counts.model_dump(exclude_unset=True)


def _started(name: str) -> tuple[str, ...]:
    """Return a plug-in's options that name a program: attribute `started` of its factory."""
    with suppress(SolverFailure):  # reported when the solver is made
        plug_in = _plug_in_named(name)
        if plug_in is not None:
            return tuple(getattr(_factory(plug_in), "started", ()))
    return ()


def solver_named(name: str, cache: RunCache | None = None, /, **options: Any) -> Solver:
    """Return a new solver, ours or that of a plug-in, which waits for licences.

    Parameters
    ----------
    name : str
    cache : RunCache or None
        Without one, everything is run.
    options : object
        Options of the solver.

    Raises
    ------
    InputError
        There is none of that name, or an option is wrong.
    SolverFailure
        A plug-in does not work; the message names its distribution.
    """
    licences, solver_options = split(options)
    if name in SOLVERS:  # a plug-in cannot take the place of one of ours
        solver_alone = SOLVERS[name](**solver_options)
    elif (plug_in := _plug_in_named(name)) is not None:
        solver_alone = _made(plug_in, solver_options)
    else:
        raise InputError(None, "solver", f"{name!r} is not one of: {', '.join(solver_names())}")
    # The project's settings override the site's.
    solver = licensed(
        solver_alone, name, {**getattr(solver_alone, "site_licences", {}), **licences}
    )
    return solver if cache is None else with_cache(solver, cache, counted(name, solver_options))


def counted(name: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of a solver that may change a result; of a plug-in all but licences."""
    _, solver_options = split(options)
    section = settings_section(name)
    return dict(solver_options) if section is None else section.counted(solver_options)


def usable_solver(
    name: str,
    options: Mapping[str, Any] | None = None,
    path: Path | None = None,
    key: str = "fit.solver",
    cache: RunCache | None = None,
) -> Solver:
    """Return a solver that is installed and carries the law.

    Parameters
    ----------
    name : str
    options : mapping, optional
        Options of the solver.
    path, key : Path or None, str
        File and key where it is named, for messages.
    cache : RunCache, optional
    """
    try:
        solver = solver_named(name, cache, **(options or {}))
    except InputError as error:
        raise _at_its_place(error, name, path, key) from None
    if solver.external:
        place = (options or {}).get("scratch")
        sweep_left(None if place is None else Path(place))
        check = checked(name, solver)
        if not (check.available and check.carries_law):
            raise SolverFailure(check.advice or "is not usable", name)
    return solver


def _at_its_place(error: InputError, name: str, path: Path | None, key: str) -> InputError:
    """Return the error of a solver's name or options with the file and key that they are from."""
    if error.field == "solver":
        return InputError(path, f"{key} (or --solver)", error.problem)
    # Options of ours may also come from the command line.
    if name not in SOLVERS and error.path is None and error.field.startswith(f"solver.{name}"):
        return InputError(path, error.field, error.problem)
    return error


def checked(name: str, solver: Solver) -> SolverCheck:
    """Return the solver's `check`; SolverFailure where that of a plug-in fails; InputError."""
    plug_in = None if name in SOLVERS else _plug_in_named(name)
    if plug_in is None:
        return solver.check()
    with _failing(name), plug_in.calling("fails its check"):
        return solver.check()


def command_line() -> list[Override]:
    """Return every solver's options, each once, with the values of each solver in its help."""
    overrides: dict[str, Override] = {}
    values: dict[str, list[str]] = {}
    for name, section in solver_sections().items():
        for override in section.overrides:
            overrides.setdefault(override.name, override)
            if override.values:
                values.setdefault(override.name, []).append(f"{override.values} ({name})")
    return [
        replace(override, what=f"{override.what}: {', '.join(values[override.name])}.")
        if override.values
        else override
        for override in overrides.values()
    ]


def overridden(
    name: str,
    options: Mapping[str, Any],
    command_options: Mapping[str, Any],
    settings: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the options of the solver `name`, overridden by the command line; InputError.

    Parameters
    ----------
    command_options : mapping of str to Any
        By the name of an option of `command_line`.
    settings : sequence of str
        Each "KEY=VALUE", the value as in a project file (text needs no quotes); paths are relative
        to the current folder.
    """
    changes = {option: value for option, value in command_options.items() if value is not None}
    for option in changes:
        if option not in options:
            raise InputError(None, f"--{option}", f"means nothing to the solver {name!r}")
    section = settings_section(name)
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not (key and equals):
            raise InputError(None, f"--{ANY}", f"expected KEY=VALUE, got {setting!r}")
        key = key.strip()
        try:
            changes[key] = tomllib.loads(f"value = {text}")["value"]
        except (ValueError, RecursionError):  # beside its own, tomllib lets these through
            changes[key] = text
        if section is None:
            continue
        try:
            changes[key] = section.model_validate({key: changes[key]}).given(Path.cwd())[key]
        except ValidationError as error:
            problem = first_error(None, error, section)
            raise InputError(None, f"--{ANY} {problem.field}", problem.problem) from None
    return {**options, **changes}


def diagnose(**programs: Path | str | None) -> list[Diagnosis]:
    """Diagnose the embedded solver, our others (programs : by option), then every plug-in."""
    ours = [make for make in SOLVERS.values() if isinstance(make, SolverOffer)]
    ours.sort(key=lambda offer: offer.program is not None)  # the embedded ones have no program
    diagnoses = []
    for offer in ours:
        diagnoses += offer.diagnose(programs.get(offer.program.name) if offer.program else None)
    return [*diagnoses, *(_plug_in(plug_in) for plug_in in plug_ins(GROUP))]


def _plug_in(plug_in: PlugIn) -> Diagnosis:
    """Diagnose a plug-in, on the bars where it runs strips; never raises on its account."""
    origin = f"plug-in of {plug_in.distribution}"
    make_diagnosis = partial(Diagnosis, name=plug_in.name, origin=origin, expected=False)
    if plug_in.name in SOLVERS:
        advice = f"{plug_in.name} is bubblefit's own: the plug-in needs another name"
        return make_diagnosis(advice=f"{advice}; tell those who make it")
    try:
        solver = solver_named(plug_in.name)
        check = checked(plug_in.name, solver)
    except BubblefitError as error:
        return make_diagnosis(advice=str(error).splitlines()[0])
    make_diagnosis = partial(make_diagnosis, version=check.version)
    if not (check.available and check.carries_law):
        return make_diagnosis(advice=check.advice or "says that it is not usable, and not why")
    try:
        stresses = strip_stresses(solver)
    except BubblefitError as error:
        # It may be for bubbles only, or have failed: the reader knows which.
        return make_diagnosis(
            usable=True, advice=f"its law was not tried: {str(error).splitlines()[0]}"
        )
    except Exception as error:
        failure = plug_in.failure("fails on a strip", error)
        return make_diagnosis(advice=f"{plug_in.name}: {failure}")
    off = difference(stresses)
    advice = "" if off < TOLERANCE else f"does not carry the law: {off:.2g} from Marc's end stress"
    return make_diagnosis(usable=off < TOLERANCE, stresses=stresses, difference=off, advice=advice)
