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
from .events import EVENTS

INTERRUPTED = 130
WORSE = 1  # exit code of --fail-above


def exits(command: Callable[..., Any]) -> Callable[..., Any]:
    """Deliberate errors become one line on stderr and their exit code; Ctrl-C becomes 130."""

    @functools.wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        code, said = 1, None
        try:
            done = command(*args, **kwargs)
            code = 0
            return done
        except BubblefitError as error:
            code, said = error.exit_code, str(error)
            click.echo(f"bubblefit: {error}", err=True)
            sys.exit(error.exit_code)
        except KeyboardInterrupt:
            code, said = INTERRUPTED, "interrupted"
            click.echo("bubblefit: interrupted", err=True)
            sys.exit(INTERRUPTED)
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
            raise
        except Exception as error:
            said = f"{type(error).__name__}: {error}"
            raise
        finally:
            EVENTS.end(code, said)

    return wrapped


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Work that is kept in a folder: an interruption says how to go on, and passes."""
    try:
        yield
    except KeyboardInterrupt:
        click.echo(f"interrupted; go on with --resume (kept in {folder})", err=True)
        raise
