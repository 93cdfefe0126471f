"""The page of a fit or of predictions that failed: that there is no result, and why."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import NoFeasibleStart, OutputError, SolverFailure
from ..reports import Report, write_report

FAILED = "This failed, and there is no result."


@contextmanager
def failure_page(folder: Path | None, title: str) -> Iterator[list[str]]:
    """Where what is done within fails, report.html of the folder says so, and nothing else does.

    Parameters
    ----------
    folder : None: nothing is written. title : of the project.

    Returns
    -------
    What else the page is to say, line by line, to be filled.

    Raises
    ------
    What is raised within.
    """
    more: list[str] = []
    try:
        yield more
    except (SolverFailure, NoFeasibleStart) as failure:
        if folder is not None:
            said = str(failure).splitlines()[0]
            with suppress(OutputError):  # the failure itself says more
                write_report(folder, Report(title, f"{FAILED} {said}", warnings=more))
        raise
