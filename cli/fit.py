"""`bubblefit fit PROJECT.toml`: fit a material to all tests of a fabric together."""

from __future__ import annotations

from typing import Any

import click

from .examples import examples
from .fitting import fit_options, run_fit


@click.command(
    "fit",
    epilog=examples(
        "bubblefit fit project.toml",
        "bubblefit fit project.toml --test bubble --test strips --out out/both",
        "bubblefit fit project.toml --solver calculix --starts 1 --verbose",
    ),
)
@fit_options
def command(**options: Any) -> None:
    """Fit the moduli of PROJECT.toml to all its tests together, or to those named.

    Writes result.json, material.toml, moduli.csv, residuals.csv, history.csv, figures, report.html
    and what belongs to each test into the output folder; says what each test pins down.
    """
    run_fit(options)
