"""The last line of a command: where what it wrote is."""

from __future__ import annotations

from pathlib import Path

PAGE = "report.html"


def written_to(folder: Path) -> str:
    """The page to open where there is one, else the folder."""
    page = folder / PAGE
    if page.exists():
        return f"page: {page} (tables and figures beside it)"
    return f"written to {folder}"
