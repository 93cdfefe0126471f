"""`bubblefit uniaxial PROJECT.toml`: fit a material to warp, fill and bias strip tests."""

from __future__ import annotations

from typing import Any

import click

from .fitting import fit_options, run_fit


@click.command("uniaxial")
@fit_options
def command(**options: Any) -> None:
    """Fit the moduli of PROJECT.toml to its strip tests only.

    Writes what `bubblefit fit` writes, with the load curves and the deformed bias strip.
    """
    run_fit(options, "strips")
