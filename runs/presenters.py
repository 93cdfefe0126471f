"""Find the presenter of a result: what writes its folder and its page.

Presenters look at results from above, so that no result imports them. They are found by place, as
kinds of test, forms and readers are: one line a type of result.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

#: Module of `reports` and its function, by the type of the result.
PRESENTERS = {
    "Check": ("check_page", "write_check"),
    "Fit": ("fit_page", "write_fit"),
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
