"""What was typed and cannot be understood: one line, as every other error of ours, exit code 2."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import click

#: Shows the whole help instead of a line, in the versions of click that have it.
HELP = getattr(click.exceptions, "NoArgsIsHelpError", ())
#: "Option '--starts' requires an argument.": click names the option in the words only.
NAMED = re.compile(r"^Option '(--?[\w-]+)' (.*?)\.?$", re.DOTALL)


class UsageLine(click.ClickException):
    """An error of click's in our form: where, what, what to do."""

    exit_code = 2

    def show(self, file: Any = None) -> None:
        """One line on stderr."""
        click.echo(f"bubblefit: {self.message}", err=True)


@contextmanager
def in_one_line() -> Iterator[None]:
    """Complaints of click within the block become one line.

    Raises
    ------
    UsageLine : instead of click.UsageError.
    """
    try:
        yield
    except click.UsageError as error:
        if isinstance(error, HELP):
            raise
        raise UsageLine(line_of(error)) from None


def line_of(error: click.UsageError) -> str:
    """Which option or argument, what is wrong, where to look."""
    command = "" if error.ctx is None else error.ctx.command_path
    where, problem = _parts(error, command or "bubblefit")
    look = f" ({command} --help tells what it takes)" if command else ""
    return f"{where and f'{where}: '}{' '.join(problem.rstrip('.').split())}{look}"


def _parts(error: click.UsageError, command: str) -> tuple[str, str]:
    if isinstance(error, click.NoSuchOption):
        meant = did_you_mean(error.option_name, error.possibilities or ())
        return error.option_name, f"no such option of {command}{meant}"
    if isinstance(error, click.MissingParameter):
        return _name(error.param), "is missing"
    if isinstance(error, click.BadParameter):
        return _name(error.param), error.message
    if (named := NAMED.match(error.message)) is not None:
        return named[1], named[2]
    return "", error.message[:1].lower() + error.message[1:]


def _name(param: click.Parameter | None) -> str:
    """As it is typed: the long name of an option, the capitals of an argument."""
    if param is None:
        return ""
    if isinstance(param, click.Option):
        return max((*param.opts, *param.secondary_opts), key=len)
    return (param.metavar or param.name or "").upper()


def did_you_mean(typed: str, known: Sequence[str]) -> str:
    """A question with the nearest of the names known; nothing where none is near."""
    near = difflib.get_close_matches(typed, known, n=1, cutoff=0.5)
    return f"; did you mean {near[0]!r}?" if near else ""


class Suggesting(click.Group):
    """A group that knows what was meant by a command that it has not."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click's own.

        Raises
        ------
        UsageLine : there is no such command; with the nearest one there is.
        """
        name = args[0]
        known = self.list_commands(ctx)
        if name not in known and not name.startswith("-") and not ctx.resilient_parsing:
            words = f"no such command{did_you_mean(name, known)}"
            raise UsageLine(f"{name}: {words} ({ctx.command_path} --help lists every command)")
        return super().resolve_command(ctx, args)


def every_command(group: click.Group) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Every command below a group, groups included, by what is typed."""
    ctx = click.Context(group)
    for name in group.list_commands(ctx):
        command = group.get_command(ctx, name)
        assert command is not None
        yield (name,), command
        if isinstance(command, click.Group):
            for path, below in every_command(command):
                yield (name, *path), below
