"""Arguments and options that several commands have, each described once."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from ..errors import InputError
from .exits import exits

Command = Callable[..., Any]
Decorator = Callable[[Command], Command]

PATH = click.Path(path_type=Path)
PROJECT: Decorator = click.argument("project", type=PATH)
TESTS: Decorator = click.option(
    "--test", "tests", multiple=True, help="A test by its name; several [all]."
)
DATA: Decorator = click.option(
    "--data", multiple=True, metavar="[TEST=]DIR",
    help="Folder of the measured data, of all tests or of one; several.",
)  # fmt: skip
TRUST: Decorator = click.option(
    "--trust", multiple=True, metavar="NAME", help="Let a doubt of the data pass; several."
)
CARD_OF_FIT: Decorator = click.option(
    "--card", help="Of the fit: a card's file or name [that of the project's fit]."
)
JOBS: Decorator = click.option("--jobs", type=click.IntRange(min=1), help="Processes [all cores].")
SCHEDULER: Decorator = click.option(
    "--scheduler", envvar="BUBBLEFIT_SCHEDULER", metavar="ADDRESS",
    help="Dask scheduler whose workers do the runs [this machine].",
)  # fmt: skip
RESUME: Decorator = click.option(
    "--resume", is_flag=True, help="Keep the analyses that the output folder holds."
)
OVERWRITE: Decorator = click.option(
    "--overwrite", is_flag=True, help="Replace what the output folder holds."
)
AS_JSON: Decorator = click.option(
    "--json", "as_json", is_flag=True, help="Print result.json on stdout."
)
NO_CACHE = "Run another program also where its run is kept (see `bubblefit cache`)."
QUIET: Decorator = click.option("--quiet", is_flag=True, help="No progress.")


def out_option(usual: str = "out/NAME") -> Decorator:
    """--out, and where the output goes without it."""
    return click.option("--out", type=PATH, help=f"Output folder [{usual}].")


def with_options(command: Command, decorators: Sequence[Decorator]) -> Command:
    """A command with its options; its help lists them in this order."""
    for decorate in reversed(decorators):
        command = decorate(command)
    return command


def with_checks(command: Command, decorators: Sequence[Decorator]) -> Command:
    """The same, errors handled, with --resume, --overwrite and --fail-above checked."""

    @functools.wraps(command)
    def checked(*args: Any, resume: bool, overwrite: bool, **kwargs: Any) -> Any:
        above = kwargs.get("fail_above")
        if resume and overwrite:
            raise InputError(None, "--resume, --overwrite", "give one of them, not both")
        if above is not None and not above >= 0:
            raise InputError(None, "--fail-above", f"expected 0 or more, got {above:g}")
        return command(*args, resume=resume, overwrite=overwrite, **kwargs)

    return with_options(exits(checked), decorators)


def solver_choice(command: Command) -> Command:
    """The options that pick a solver; the command is given them as one dict, `solver_given`."""
    from ..solvers.registry import ANY, command_line

    known = command_line()

    @functools.wraps(command)
    def wrapped(
        *args: Any, solver: str | None, solver_option: Sequence[str], cache: bool, **kwargs: Any
    ) -> Any:
        given = {"solver": solver, "settings": solver_option, "cache": cache}
        given |= {one.name: kwargs.pop(one.name) for one in known}
        return command(*args, solver_given=given, **kwargs)

    cached = click.option("--no-cache", "cache", flag_value=False, default=True, help=NO_CACHE)
    words = "A setting of the solver as in [solver.NAME]; may be given more than once."
    decorated = click.option(f"--{ANY}", metavar="KEY=VALUE", multiple=True, help=words)(
        cached(wrapped)
    )
    for one in reversed(known):
        kind = PATH if one.path else str
        option = click.option(f"--{one.name}", metavar=one.metavar, type=kind, help=one.what)
        decorated = option(decorated)
    return click.option("--solver", metavar="NAME", help="Solver that runs the model.")(decorated)
