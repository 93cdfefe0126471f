"""Licences of a program as `[solver.NAME]` of a project says them, for every external solver."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from ..errors import InputError
from ..section_errors import first_error
from ..sections import Section, beside
from .settings import SolverSettings

#: s, that a denied licence is asked for again where licences are counted.
WAIT_S = 600.0


class LicenceSettings(Section):
    """How many runs there may be at once, and what is done where one gets no licence.

    licences : runs at once, of all processes and users that lock the same files; not counted unless
    given. licence_folder : of these files, one for the machine unless given. licence_wait : s to go
    on trying after a licence was denied; 600 where they are counted, else 0. licence_retry : s
    until the first further try; later pauses are longer, each a little by chance.
    licence_denied : words in the program's log that mean a denied licence, beside what the solver
    itself knows.
    """

    licences: Annotated[int, Field(ge=1, le=100_000)] | None = None
    licence_folder: str | None = None
    licence_wait: Annotated[float, Field(ge=0, le=1e9)] | None = None
    licence_retry: Annotated[float, Field(gt=0, le=1e9)] = 30.0
    licence_denied: list[Annotated[str, Field(min_length=1)]] = Field(default=[])

    @property
    def wait(self) -> float:
        """s, that a denied licence is asked for again."""
        if self.licence_wait is not None:
            return self.licence_wait
        return 0.0 if self.licences is None else WAIT_S


KEYS = tuple(LicenceSettings.model_fields)
#: Among the options of a solver, never in a project: address of the Dask scheduler that counts
#: licences for its whole cluster as well.
SCHEDULER = "licence_scheduler"


class ExternalSettings(SolverSettings, LicenceSettings):
    """What every program of its own has in its table [solver.NAME]."""


def split(options: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """What options say of licences (None: not given), and the others."""
    known = (*KEYS, SCHEDULER)
    own = {key: options[key] for key in known if options.get(key) is not None}
    return own, {key: value for key, value in options.items() if key not in known}


def licence_settings(
    name: str, given: Mapping[str, Any], path: Path | None = None
) -> LicenceSettings:
    """Checked settings of the solver `name`; paths are beside the project file `path`.

    Raises
    ------
    InputError : a value that cannot be meant.
    """
    plain = {key: str(v) if isinstance(v, Path) else v for key, v in given.items()}
    try:
        settings = LicenceSettings.model_validate(plain)
    except ValidationError as error:
        found = first_error(path or Path(), error, LicenceSettings)
        raise InputError(path, f"solver.{name}.{found.field}", found.problem) from None
    if settings.licence_folder is not None and path is not None:
        folder = str(beside(path.parent, settings.licence_folder))
        settings = settings.model_copy(update={"licence_folder": folder})
    return settings
