"""How commands end: errors and interruptions to a line on stderr and an exit code."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from ..errors import BubblefitError

INTERRUPTED = 130
WORSE = 1  # exit code of --fail-above


def exits(command: Callable[..., Any]) -> Callable[..., Any]:
    """Deliberate errors become one line on stderr and their exit code; Ctrl-C becomes 130."""

    @functools.wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        try:
            return command(*args, **kwargs)
        except BubblefitError as error:
            click.echo(f"bubblefit: {error}", err=True)
            sys.exit(error.exit_code)
        except KeyboardInterrupt:
            click.echo("bubblefit: interrupted", err=True)
            sys.exit(INTERRUPTED)

    return wrapped


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Work that is kept in a folder: an interruption says how to go on, and passes."""
    try:
        yield
    except KeyboardInterrupt:
        click.echo(f"interrupted; go on with --resume (kept in {folder})", err=True)
        raise
