"""Settings that every solver has in common: `[solver.NAME]` of a project file."""

import os
import re
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field, ValidationError

from ..errors import InputError
from ..light_dataclasses import dataclass
from ..readers.sections import Section, first_error, path_beside
from .base import Diagnosis, Solver

#: Folders, as in PATH, whose projects may name programs to run.
PROGRAMS_FROM = "BUBBLEFIT_PROGRAMS_FROM"
#: Names of solvers' own programs, which are looked up on the user's PATH.
_KNOWN = re.compile(r"(ccx|run_marc)[\w.-]*")
#: s, for which a denied licence is requested again where licences are counted.
WAIT_S = 600.0
#: Option of a solver, never in a project: address of the Dask scheduler that counts licences for
#: its whole cluster as well.
SCHEDULER = "licence_scheduler"


@dataclass(frozen=True)
class Override:
    """A command-line option of a setting.

    Attributes
    ----------
    path : bool
        A file or folder.
    look : str
        Its help in `doctor`.
    """

    name: str
    what: str
    values: str = ""
    metavar: str = "NAME"
    path: bool = False
    look: str = ""


class SolverSettings(Section):
    """A table [solver.NAME] of a project file.

    paths : keys of files or folders beside the project. programs : likewise, or on the PATH.
    started : keys that name a program to run. uncounted : keys that change no result, as paths.
    """

    paths: ClassVar[tuple[str, ...]] = ()
    programs: ClassVar[tuple[str, ...]] = ()
    started: ClassVar[tuple[str, ...]] = ()
    overrides: ClassVar[tuple[Override, ...]] = ()
    uncounted: ClassVar[tuple[str, ...]] = ("timeout", "keep")

    @classmethod
    def counted(cls, options: Mapping[str, Any]) -> dict[str, Any]:
        """Return the options that may change a result and are no files."""
        looks = (override.name for override in cls.overrides if override.look)
        uncounted = {*cls.uncounted, *cls.paths, *cls.programs, *looks}
        return {key: value for key, value in options.items() if key not in uncounted}

    def given(self, folder: Path) -> dict[str, Any]:
        """Return the solver's options; paths are relative to `folder`, that of the project."""
        values = self.model_dump()
        for name in (*self.paths, *self.programs):
            value = values[name]
            if value is not None and (name in self.paths or os.sep in value):
                values[name] = path_beside(folder, value)
        return values


def check_programs(
    path: Path,
    solver: str,
    table: Mapping[str, Any],
    started: Iterable[str],
    advice: str = "",
) -> None:
    """Check that a project names programs only where its user permits that; InputError.

    A bare name of a solver's own program (ccx_2.20, run_marc2023) is looked up on the user's PATH.

    Parameters
    ----------
    table : mapping of str to Any
        [solver.NAME].
    started : iterable of str
        Its keys of programs.
    advice : str
        What else the user may do.
    """

    def known(value: Any) -> bool:
        return isinstance(value, str) and bool(_KNOWN.fullmatch(value))

    program_keys = [key for key in started if key in table and not known(table[key])]
    problem = programs_problem(path, advice) if program_keys else ""
    if problem:
        raise InputError(path, f"solver.{solver}.{program_keys[0]}", problem)


def programs_problem(path: Path, advice: str = "") -> str:
    """Return why the project of this path may not name programs, "" where its user permits that.

    Parameters
    ----------
    advice : str
        What else the user may do.
    """
    allowed = [
        Path(f).expanduser() for f in os.environ.get(PROGRAMS_FROM, "").split(os.pathsep) if f
    ]
    if any(path.resolve().is_relative_to(folder.resolve()) for folder in allowed):
        return ""
    return (
        "says what is run, and a project may come from somebody else; "
        f"{advice}{PROGRAMS_FROM}={path.absolute().parent} lets the projects there say it"
    )


class LicenceSettings(Section):
    """Number of simultaneous runs, and what is done where one gets no licence.

    licences : of all that lock the files in licence_folder (one for the machine unless given).
    licence_wait : s of further tries; 600 where counted, else 0. licence_retry : s until the first;
    later pauses are longer. licence_denied : words in the program's log, beside known ones.
    """

    licences: Annotated[int, Field(ge=1, le=100_000)] | None = None
    licence_folder: str | None = None
    licence_wait: Annotated[float, Field(ge=0, le=1e9)] | None = None
    licence_retry: Annotated[float, Field(gt=0, le=1e9)] = 30.0
    licence_denied: list[Annotated[str, Field(min_length=1)]] = Field(default=[])

    @property
    def wait(self) -> float:
        """Return for how long (s) a denied licence is requested again."""
        if self.licence_wait is not None:
            return self.licence_wait
        return 0.0 if self.licences is None else WAIT_S


KEYS = tuple(LicenceSettings.model_fields)


class ExternalSettings(SolverSettings, LicenceSettings):
    """Settings of every external program in its table [solver.NAME]."""


def split(options: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the options of licences (None: not given), and the others."""
    licence_keys = (*KEYS, SCHEDULER)
    licence_options = {key: options[key] for key in licence_keys if options.get(key) is not None}
    return licence_options, {
        key: value for key, value in options.items() if key not in licence_keys
    }


def licence_settings(
    name: str, options: Mapping[str, Any], path: Path | None = None
) -> LicenceSettings:
    """Return checked settings of solver `name`, folders beside the project `path`; InputError."""
    plain = {key: str(v) if isinstance(v, Path) else v for key, v in options.items()}
    try:
        settings = LicenceSettings.model_validate(plain)
    except ValidationError as error:
        problem = first_error(path or Path(), error, LicenceSettings)
        raise InputError(path, f"solver.{name}.{problem.field}", problem.problem) from None
    if settings.licence_folder is not None and path is not None:
        folder = str(path_beside(path.parent, settings.licence_folder))
        settings = settings.model_copy(update={"licence_folder": folder})
    return settings


@dataclass(frozen=True)
class SolverOffer:
    """A solver by name, made when it is called with its options.

    Attributes
    ----------
    name : str
    solver, settings_class : str
        "module:class" of the solver and of its settings, imported when they are needed. The module
        of the solver has `diagnose(named)`, which returns a list of `Diagnosis`.
    """

    name: str
    solver: str
    settings_class: str

    @property
    def settings(self) -> type[SolverSettings]:
        """Return the class of its settings."""
        module, _, name = self.settings_class.partition(":")
        return getattr(import_module(f".{module}", __package__), name)

    def __call__(self, **options: Any) -> Solver:
        """Return a new solver."""
        return getattr(self._module, self.solver.partition(":")[2])(**options)

    @property
    def _module(self) -> Any:
        """Return the module of the solver."""
        return import_module(f".{self.solver.partition(':')[0]}", __package__)

    @property
    def program(self) -> Override | None:
        """Return the option that names its program, where it has one."""
        return next((override for override in self.settings.overrides if override.look), None)

    def diagnose(self, named: Path | str | None = None) -> list[Diagnosis]:
        """Diagnose every installation of it on this machine, each on the bars."""
        return self._module.diagnose(named)
