"""The end of a command: what it found, as lines or as JSON, and where what it wrote is."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

PAGE = "report.html"


def written_to(folder: Path) -> str:
    """The page to open where there is one, else the folder."""
    page = folder / PAGE
    if page.exists():
        return f"page: {page} (tables and figures beside it)"
    return f"written to {folder}"


def tell(result: Mapping[str, Any], lines: Sequence[str], as_json: bool) -> None:
    """Print the lines, or with --json what result.json says."""
    click.echo(json.dumps(result, indent=1) if as_json else "\n".join(lines))
