"""--events: what a command does, for machines; one JSON object a line, as it happens.

    {"event": "begin", "seconds": 0.0, "command": "bubblefit fit", "version": "0.2.0"}
    {"event": "progress", "seconds": 3.1, "what": "starts", "done": 2, "total": 8, "note": "..."}
    {"event": "end", "seconds": 9.8, "exit_code": 0, "error": null}

The last line is always an end, unless the process was killed. The file may be a pipe.
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import IO, Any

import click

from ..errors import OutputError
from ..files import __version__, output_errors

#: Between two lines of progress in which nothing more was done.
EVERY_S = 1.0


class Events:
    """Where events go; nowhere unless a file is open."""

    def __init__(self) -> None:
        self._file: IO[str] | None = None
        self._begun = self._told = 0.0
        self._last: Any = None

    def begin(self, path: Path, command: str) -> None:
        """Open the file, which is written over unless it is one of /dev.

        Raises
        ------
        OutputError : it cannot be written.
        """
        with output_errors(path):
            # What stdout has been sent to is nothing to write over.
            mode = "a" if path.is_char_device() or path.is_relative_to("/dev") else "w"
            self._file = open(path, mode, encoding="utf-8")
        self._begun, self._last = time.monotonic(), None
        self.tell("begin", command=command, version=__version__)

    def tell(self, event: str, **facts: Any) -> None:
        """One line; where nobody reads any more, no further ones."""
        if self._file is None:
            return
        seconds = round(time.monotonic() - self._begun, 3)
        try:
            self._file.write(json.dumps({"event": event, "seconds": seconds, **facts}) + "\n")
            self._file.flush()
        except OSError:
            self._file = None

    def progress(self, what: str, done: float, total: float | None, note: str) -> None:
        """One line where more is done than at the last one, or a second has passed."""
        now = time.monotonic()
        if self._last == (what, done, total) and now - self._told < EVERY_S:
            return
        self._told, self._last = now, (what, done, total)
        self.tell("progress", what=what, done=done, total=total, note=note)

    def end(self, exit_code: int, error: str | None = None) -> None:
        """The last line."""
        self.tell("end", exit_code=exit_code, error=error)
        if self._file is not None:
            self._file.close()
        self._file = None


EVENTS = Events()


def _begin(ctx: click.Context, _: click.Parameter, path: Path | None) -> None:
    if path is None or ctx.resilient_parsing:
        return
    try:
        EVENTS.begin(path, ctx.command_path)
    except OutputError as error:
        raise click.BadParameter(str(error)) from None


def with_events(command: click.Command) -> click.Command:
    """A command that takes --events, which it is not given; of a group, each of its commands."""
    if isinstance(command, click.Group):
        for below in command.commands.values():
            with_events(below)
    elif not any("--events" in param.opts for param in command.params):
        command.params.append(
            click.Option(
                ["--events", "events"],
                type=click.Path(path_type=Path),
                metavar="FILE",
                expose_value=False,
                callback=_begin,
                help="Tell progress and end to FILE, a JSON object a line.",
            )
        )
    return command
