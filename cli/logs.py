"""What the library says of its work, on stderr: warnings always, everything with --verbose."""

from __future__ import annotations

import logging
import sys

import click

LOGGER = logging.getLogger("bubblefit")
WARNING = logging.Formatter("warning: %(message)s")
TIMED = logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S")


class Stderr(logging.Handler):
    """Writes to stderr as it is now: a live line of progress moves out of the way."""

    def emit(self, record: logging.LogRecord) -> None:
        """One line a record."""
        own = WARNING if record.levelno >= logging.WARNING else TIMED
        print(own.format(record), file=sys.stderr, flush=True)


def listen(verbose: bool = False) -> None:
    """Tell what the library logs; called again with `verbose` it tells more."""
    if not any(isinstance(handler, Stderr) for handler in LOGGER.handlers):
        LOGGER.addHandler(Stderr())
    LOGGER.setLevel(logging.INFO if verbose else logging.WARNING)


def verbose() -> bool:
    """Whether everything is told."""
    return LOGGER.isEnabledFor(logging.INFO)


def _louder(ctx: click.Context, _: click.Parameter, verbose: bool) -> None:
    if verbose and not ctx.resilient_parsing:
        listen(True)


def verbose_option() -> click.Option:
    """--verbose of a command; the command is not given it."""
    return click.Option(
        ["--verbose"],
        is_flag=True,
        expose_value=False,
        callback=_louder,
        help="Tell each analysis, solver files and times, on stderr.",
    )


def with_verbose(command: click.Command) -> click.Command:
    """A command that takes --verbose; of a group, each of its commands."""
    if isinstance(command, click.Group):
        for below in command.commands.values():
            with_verbose(below)
    elif not any(param.name == "verbose" for param in command.params):
        command.params.append(verbose_option())
    return command
