"""What the settings of every solver have in common: `[solver.NAME]` of a project file."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from ..errors import InputError
from ..sections import Section, beside

#: Folders, as in PATH, below which a project may say what is run.
PROGRAMS_FROM = "BUBBLEFIT_PROGRAMS_FROM"
#: Names of solvers' own programs, which are looked up on the user's PATH.
_KNOWN = re.compile(r"(ccx|run_marc)[\w.-]*")


@dataclass(frozen=True)
class Override:
    """An option of the command line that takes the place of one of a solver's settings.

    Parameters
    ----------
    name : of the setting, and of the option without its dashes.
    what : for the help; solvers that share an option share this. values : which there are.
    metavar : what stands for the value in the help.
    path : whether it is a file or folder, which the command line gives as such.
    look : for an option that names the solver's program: what it is for when solvers are looked
        at.
    """

    name: str
    what: str
    values: str = ""
    metavar: str = "NAME"
    path: bool = False
    look: str = ""


class SolverSettings(Section):
    """A table [solver.NAME] of a project file.

    paths : keys whose values are files or folders beside the project file. programs : likewise,
    but a bare name is a program on the PATH. started : keys that say what is run, and how: see
    `check_programs`. overrides : what the command line may say instead. uncounted : keys that
    change no result; nor do where files lie, which count by what is in them.
    """

    paths: ClassVar[tuple[str, ...]] = ()
    programs: ClassVar[tuple[str, ...]] = ()
    started: ClassVar[tuple[str, ...]] = ()
    overrides: ClassVar[tuple[Override, ...]] = ()
    uncounted: ClassVar[tuple[str, ...]] = ("timeout", "keep")

    @classmethod
    def counted(cls, options: Mapping[str, Any]) -> dict[str, Any]:
        """Of what a solver is made with, what may change a result and is no file."""
        others = {
            *cls.uncounted,
            *cls.paths,
            *cls.programs,
            *(o.name for o in cls.overrides if o.look),
        }
        return {key: value for key, value in options.items() if key not in others}

    def given(self, folder: Path) -> dict[str, Any]:
        """What the solver is made with; paths from `folder`, that of the file with the table."""
        values = self.model_dump()
        for name in (*self.paths, *self.programs):
            value = values[name]
            if value is not None and (name in self.paths or os.sep in value):
                values[name] = beside(folder, value)
        return values


def check_programs(
    path: Path, solver: str, table: Mapping[str, Any], started: Iterable[str], advice: str = ""
) -> None:
    """That a project says what is run only where its user lets it.

    A bare name of a solver's own program (ccx_2.20, run_marc2023) may always be said: it is looked
    up on the user's PATH.

    Parameters
    ----------
    path : of the project. table : [solver.NAME] as it is written. started : its keys that say what
    is run, and how. advice : what else the user may do.

    Raises
    ------
    InputError : such a key is there, and the file is in none of the folders of `PROGRAMS_FROM`.
    """
    said = [key for key in started if key in table and not _is_known(table[key])]
    if not said or _below_allowed(path):
        return
    problem = (
        "says what is run, and a project may come from somebody else; "
        f"{advice}{PROGRAMS_FROM}={path.absolute().parent} lets the projects there say it"
    )
    raise InputError(path, f"solver.{solver}.{said[0]}", problem)


def _is_known(value: Any) -> bool:
    return isinstance(value, str) and bool(_KNOWN.fullmatch(value))


def _below_allowed(path: Path) -> bool:
    folders = [
        Path(f).expanduser() for f in os.environ.get(PROGRAMS_FROM, "").split(os.pathsep) if f
    ]
    return any(path.resolve().is_relative_to(folder.resolve()) for folder in folders)
