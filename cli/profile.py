"""`bubblefit profile PROJECT.toml`: between what does a modulus lie, if nothing is linearised?"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ..errors import InputError
from .arguments import (
    AS_JSON,
    CARD_OF_FIT,
    DATA,
    JOBS,
    OVERWRITE,
    PROJECT,
    QUIET,
    SCHEDULER,
    TESTS,
    Decorator,
    out_option,
    solver_choice,
    with_options,
)
from .ending import tell, written_to
from .examples import examples
from .exits import exits
from .options import numbers, read_to_refit, result_folder
from .progress import NamedProgress


def _options(command: Any) -> Any:
    decorators: list[Decorator] = [
        PROJECT,
        click.option(
            "--modulus", "moduli", multiple=True, metavar="NAME[=STRAINS]",
            help="E1, E2 or G12, and at which strains; several [all, at half the strain reached].",
        ),
        click.option(
            "--strain", metavar="STRAINS", help="Of every --modulus that has none of its own."
        ),
        CARD_OF_FIT,
        TESTS,
        out_option("out/NAME-profile"),
        DATA,
        solver_choice,
        JOBS,
        SCHEDULER,
        OVERWRITE,
        AS_JSON,
        QUIET,
    ]  # fmt: skip
    return with_options(exits(command), decorators)


@click.command(
    "profile",
    epilog=examples(
        "bubblefit profile fabric.toml",
        "bubblefit profile fabric.toml --modulus G12=0.02,0.05 --modulus E1=0",
        "bubblefit profile fabric.toml --modulus G12 --strain 0.05 --card other/material.toml",
    ),
)
@_options
def command(moduli: tuple[str, ...], strain: str | None, card: str | None, **options: Any) -> None:
    """Profile likelihood of moduli: between what does each lie with 95 %?

    Holds a modulus of the fit of PROJECT.toml away from its best, fits everything else anew, and
    goes on until the data contradict or a bound is met. Writes profile.csv, profile.png,
    report.html and result.json.
    """
    from ..runs.profile import profile

    path: Path = options["project"]
    project = read_to_refit(path, options)
    asked = _asked(moduli, strain)
    folder = result_folder(path, "profile", options["out"], options["overwrite"])
    with NamedProgress("sides", options["quiet"] or options["as_json"]) as progress:
        found = profile(project, asked, card, options["tests"] or None, progress=progress.saw)
    found.write(folder)
    tell(found.result, [*found.lines(), written_to(folder)], options["as_json"])


def _asked(moduli: Sequence[str], strain: str | None) -> dict[str, list[float]] | None:
    """Strains by modulus; one that is named twice has those of both."""
    common = [] if strain is None else numbers(strain, "--strain")
    if common and not moduli:
        raise InputError(None, "--strain", "goes with --modulus NAME")
    asked: dict[str, list[float]] = {}
    for given in moduli:
        name, equals, strains = given.partition("=")
        own = numbers(strains, "--modulus") if equals else common
        asked.setdefault(name, []).extend(own)
    return asked or None
