"""Options that choose the solver of a command, and its settings."""

import functools
from collections.abc import Sequence
from typing import Any

import click

from ..solvers.registry import ANY
from ..solvers.registry import command_line as solver_options
from .options import Command, with_options
from .terminal import FILE


def solver_choice(command: Command) -> Command:
    """Add the options that choose a solver and its settings to a command.

    The command receives all of them as one dict, `solver_given` (see `with_solver`).
    """
    program_options = solver_options()

    @functools.wraps(command)
    def wrapped(
        *args: Any, solver: str | None, solver_option: Sequence[str], cache: bool, **kwargs: Any
    ) -> Any:
        choice = {"solver": solver, "settings": solver_option, "cache": cache}
        choice |= {option.name: kwargs.pop(option.name) for option in program_options}
        return command(*args, solver_given=choice, **kwargs)

    add = with_options(
        click.option("--solver", metavar="NAME", help="Solver that runs the model."),
        *(
            click.option(
                f"--{option.name}",
                metavar=option.metavar,
                type=FILE if option.path else str,
                help=option.what,
            )
            for option in program_options
        ),
        click.option(
            f"--{ANY}",
            metavar="KEY=VALUE",
            multiple=True,
            help="A setting of the solver as in [solver.NAME]; may be given more than once.",
        ),
        click.option(
            "--no-cache",
            "cache",
            flag_value=False,
            default=True,
            help="Run the solver even where the run is in the cache (see `bubblefit cache`).",
        ),
    )
    return add(wrapped)
