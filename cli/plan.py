"""`bubblefit plan PROJECT.toml`: which test next?"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..errors import InputError
from .arguments import (
    AS_JSON,
    DATA,
    OVERWRITE,
    PROJECT,
    QUIET,
    TESTS,
    Decorator,
    out_option,
    solver_choice,
    with_options,
)
from .ending import tell, written_to
from .examples import examples
from .exits import exits
from .options import data_folders, numbers, read_with_solver, result_folder
from .progress import NamedProgress


def _plan_options(command: Any) -> Any:
    decorators: list[Decorator] = [
        PROJECT,
        click.option(
            "--card", help="The present optimum: a card's file or name [that of the project's fit]."
        ),
        TESTS,
        click.option(
            "--strain", metavar="WARP,FILL,SHEAR",
            help="Strains up to which moduli are asked for [the card's valid range].",
        ),
        click.option(
            "--rank", metavar="NAME", default="worst", show_default=True,
            help="By E1, E2, G12, or the least certain of them.",
        ),
        click.option(
            "--specimens", type=click.IntRange(min=1),
            help="Of every candidate [1 bubble, 3 strips].",
        ),
        click.option(
            "--noise", "noises", multiple=True, metavar="KIND=VALUE",
            help="Of measured values, mm or N [that of the project's own test]; several.",
        ),
        out_option("out/NAME-plan"),
        DATA,
        solver_choice,
        OVERWRITE,
        AS_JSON,
        QUIET,
    ]  # fmt: skip
    return with_options(exits(command), decorators)


@click.command(
    "plan",
    epilog=examples(
        "bubblefit plan fabric.toml",
        "bubblefit plan fabric.toml --card out/fabric/material.toml --rank G12",
        "bubblefit plan fabric.toml --specimens 5 --noise strips=20 --strain 0.1,0.1,0.05",
    ),
)
@_plan_options
def command(
    card: str | None, strain: str | None, rank: str, noises: tuple[str, ...], **options: Any
) -> None:
    """Which test should be made next, beside those of PROJECT.toml?

    Predicts one standard deviation of E1, E2 and G12 for tests that could be made, from
    derivatives at the fit's card, and ranks them. Writes plan.csv, report.html and result.json.
    """
    from ..runs.plan import plan

    path: Path = options["project"]
    project = read_with_solver(path, options["solver_given"], data_folders(options["data"]))
    folder = result_folder(path, "plan", options["out"], options["overwrite"])
    with NamedProgress("tests", options["quiet"] or options["as_json"]) as progress:
        made = plan(
            project,
            card,
            options["tests"] or None,
            strain=None if strain is None else numbers(strain, "--strain"),
            rank=rank,
            specimens=options["specimens"],
            noise=dict(map(_noise, noises)),
            progress=progress.saw,
        )
    made.write(folder)
    tell(made.result, [*made.lines(), written_to(folder)], options["as_json"])


def _noise(given: str) -> tuple[str, float]:
    kind, _, value = given.partition("=")
    try:
        return kind, float(value)
    except ValueError:
        problem = f"expected KIND=VALUE, such as strips=20, got {given!r}"
        raise InputError(None, "--noise", problem) from None
