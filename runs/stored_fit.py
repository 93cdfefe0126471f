"""One fit of a series, in a folder of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..project.project import Project
from .fit import fit
from .folder import Store
from .result import Fit


def stored_fit(
    project: Project,
    tests: Sequence[str],
    place: Path | None,
    *,
    resume: bool,
    overwrite: bool,
    progress: Callable[[Any], None],
    command_line: Sequence[str] | None,
) -> Fit:
    """Fit and write the page; nothing is written without a place.

    Parameters
    ----------
    place : folder of this fit. resume : go on with what it holds, begin where it holds nothing.

    Raises
    ------
    InputError, OutputError, NoFeasibleStart, SolverFailure : as `fit`.
    """
    found = fit(
        project,
        tests,
        out=place,
        resume=resume and place is not None and Store(place).used,
        overwrite=overwrite,
        progress=progress,
        command_line=command_line,
    )
    if place is not None:
        found.report(place)
    return found
