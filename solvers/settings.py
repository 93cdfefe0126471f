"""What the settings of every solver have in common: `[solver.NAME]` of a project file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from ..sections import Section, beside


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
    but a bare name is a program on the PATH. overrides : what the command line may say instead.
    """

    paths: ClassVar[tuple[str, ...]] = ()
    programs: ClassVar[tuple[str, ...]] = ()
    overrides: ClassVar[tuple[Override, ...]] = ()

    def given(self, folder: Path) -> dict[str, Any]:
        """What the solver is made with; paths from `folder`, that of the file with the table."""
        values = self.model_dump()
        for name in (*self.paths, *self.programs):
            value = values[name]
            if value is not None and (name in self.paths or os.sep in value):
                values[name] = beside(folder, value)
        return values
