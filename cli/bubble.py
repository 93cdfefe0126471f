"""`bubblefit bubble PROJECT.toml`: fit a material to bubble inflation tests."""

from __future__ import annotations

from typing import Any

import click

from .fitting import fit_options, run_fit


@click.command("bubble")
@fit_options
def command(**options: Any) -> None:
    """Fit the moduli of PROJECT.toml to its bubble inflation tests only.

    Writes what `bubblefit fit` writes, with surfaces.csv, cuts, heights and bubble.vtu.
    """
    run_fit(options, "bubble")
