"""Find the presenter of a result, which writes its folder and its page.

Presenters look at results from above, so that no result imports them: one line a type of result.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import NoFeasibleStart, OutputError, SolverFailure

#: Module of `reports` and its function, by the type of the result.
PRESENTERS = {
    "Bootstrap": ("study_pages", "write_bootstrap"),
    "Check": ("run_pages", "write_check"),
    "Fit": ("fit_page", "write_fit"),
    "LawComparison": ("study_pages", "write_comparison"),
    "Nu12Study": ("study_pages", "write_nu12"),
    "Plan": ("study_pages", "write_plan"),
    "Predictions": ("run_pages", "write_predictions"),
    "Profiles": ("study_pages", "write_profiles"),
    "Refinement": ("study_pages", "write_refinement"),
    "Validation": ("study_pages", "write_validation"),
    "WeightStudy": ("study_pages", "write_weights"),
}


def write_report(result: Any, folder: Path | str) -> Path:
    """Write all files of a result into a folder, report.html among them; return the page's path.

    Raises
    ------
    OutputError : the folder cannot be written.
    """
    module, function = PRESENTERS[type(result).__name__]
    write = getattr(import_module(f"bubblefit.reports.{module}"), function)
    page: Path = write(result, Path(folder))
    return page


class Presented:
    """A result that its presenter writes."""

    def write(self, folder: Path | str) -> None:
        """Write all files and the page into a folder; raises OutputError."""
        write_report(self, folder)


@contextmanager
def failure_page(folder: Path | None, title: str) -> Iterator[list[str]]:
    """Write report.html of a failure within the block, which is raised again.

    Yields further lines of the page, to be filled. title : of the project. Without a folder nothing
    is written.
    """
    more: list[str] = []
    try:
        yield more
    except (SolverFailure, NoFeasibleStart) as failure:
        if folder is not None:
            said = str(failure).splitlines()[0]
            present = import_module("bubblefit.reports.fit_page")
            with suppress(OutputError):  # the failure itself says more
                present.write_failure(folder, title, said, more)
        raise
