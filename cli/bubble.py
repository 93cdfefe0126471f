"""`bubblefit bubble PROJECT.toml`: fit a material to bubble inflation tests."""

from __future__ import annotations

from typing import Any

import click

from .examples import examples
from .fitting import fit_options, run_fit


@click.command(
    "bubble",
    epilog=examples(
        "bubblefit bubble project.toml",
        "bubblefit bubble project.toml --starts 4 --jobs 2",
        "bubblefit bubble project.toml --data measured --resume",
    ),
)
@fit_options
def command(**options: Any) -> None:
    """Fit the moduli of PROJECT.toml to its bubble inflation tests only.

    Writes what `bubblefit fit` writes, with surfaces.csv, cuts, heights and bubble.pvd.
    """
    run_fit(options, "bubble")
