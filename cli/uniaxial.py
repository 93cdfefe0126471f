"""`bubblefit uniaxial PROJECT.toml`: fit a material to warp, fill and bias strip tests."""

from __future__ import annotations

from typing import Any

import click

from .examples import examples
from .fitting import fit_options, run_fit


@click.command(
    "uniaxial",
    epilog=examples(
        "bubblefit uniaxial project.toml --starts 2",
        "bubblefit uniaxial project.toml --test warp-and-fill --fail-above 0.05",
    ),
)
@fit_options
def command(**options: Any) -> None:
    """Fit the moduli of PROJECT.toml to its strip tests only.

    Writes what `bubblefit fit` writes, with the load curves and the deformed bias strip.
    """
    run_fit(options, "strips")
