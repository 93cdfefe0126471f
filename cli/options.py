"""What the commands share: errors to exit codes, the output folder's default, cores."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from ..errors import BubblefitError

INTERRUPTED = 130


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


def cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def default_folder(project: Path) -> Path:
    """out/NAME below the current folder, after the project's folder and file."""
    name = project.resolve().parent.name
    return Path("out") / (name if project.stem == "project" else f"{name}-{project.stem}")
