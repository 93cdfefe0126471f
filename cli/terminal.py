"""The terminal's side of every command: usage errors, exit codes, events, logs and the outcome.

A command is declared with `command` (or `group`) and its body is called within `exits`; it ends
with `show`. `--events` and `--verbose` belong to every command and are added by `main`."""

from __future__ import annotations

import errno
import functools
import json
import logging
import os
import re
import sys
import textwrap
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import click

from ..errors import BubblefitError, OutputError, did_you_mean
from ..processes import one_blas_thread
from ..storage.plain_values import json_text
from ..storage.writing import output_errors, unwritable_reason
from ..version import __version__

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


class OutputPath(click.Path):
    """Take a path that may exist.

    Parameters
    ----------
    is_folder : bool
        Whether it is an output folder, of which the part that exists has to be a writable folder.
    """

    def __init__(self, *, is_folder: bool = False) -> None:
        super().__init__(path_type=Path)
        self.is_folder = is_folder

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Return the path; what is wrong with it is said before the command begins."""
        try:
            problem = self._problem(Path(value)) if str(value) else "expected a path, got nothing"
        except OSError as error:  # a name that is too long, a folder that may not be read
            problem = f"no path: {error.strerror}"
        if problem:
            self.fail(problem, param, ctx)
        return super().convert(value, param, ctx)

    def _problem(self, path: Path) -> str:
        """Return what is wrong with a path, "" if nothing is; OSError."""
        existing = next(place for place in (path, *path.absolute().parents) if place.exists())
        if self.is_folder and not existing.is_dir():
            return f"{existing} is a file; name a folder"
        if self.is_folder and not os.access(existing, os.W_OK):
            return f"{existing} is Read-only, or not yours to write; name another folder"
        return ""


FILE = OutputPath()
FOLDER = OutputPath(is_folder=True)
PAGE = "report.html"
#: Where click keeps the words that were typed, while a command runs.
COMMAND_LINE = "bubblefit.command_line"
#: Heads the examples of a command in its help.
HEAD = "Examples:"


def command(name: str, *lines: str) -> Callable[[Callable[..., Any]], click.Command]:
    """Declare the command `name` with example lines below its help; see `exits` for its errors."""

    def declare(function: Callable[..., Any]) -> click.Command:
        return click.command(name, epilog=examples(*lines))(exits(function))

    return declare


def group(name: str, *lines: str) -> Callable[[Callable[..., Any]], click.Group]:
    """Declare a group of commands with example lines below its help."""
    return click.group(name, cls=Suggesting, epilog=examples(*lines))


def examples(*lines: str) -> str:
    """Return the epilog of a command: one example a line, not wrapped by click."""
    typed = "".join(f"  {line}\n" for line in lines)
    return f"\b\n{HEAD}\n{typed}"


#: Exit codes: of Ctrl-C, where the reader of the output has gone, and of --fail-above.
INTERRUPTED = 130
UNREAD = 141
WORSE = 1


def complain(message: object) -> None:
    """Print one line on stderr, if there is one and it can be written."""
    with suppress(OSError):
        if message:
            click.echo(f"bubblefit: {message}", err=True)


def check_stdout() -> None:
    """End the command where stdout is closed: files that it opens would take its place."""
    if sys.stdout is None:
        complain("standard output is closed; redirect it into a file, or to /dev/null")
        sys.exit(OutputError.exit_code)


def end_of_output(error: OSError) -> tuple[int, str] | None:
    """Return exit code and message of an error of printing; None of an error of anything else."""
    *_, (frame, _) = traceback.walk_tb(error.__traceback__)
    if frame.f_code is not click.echo.__code__:
        return None
    # Python tries once more at its end.
    sys.stdout = open(os.devnull, "w", encoding="utf-8")
    if error.errno == errno.EPIPE:
        return UNREAD, ""
    return OutputError.exit_code, f"standard output {unwritable_reason(error)} another place"


def exits(command: Callable[..., Any]) -> Callable[..., Any]:
    """Turn our errors into one line on stderr and their exit code, Ctrl-C into exit code 130."""

    @functools.wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        code = 1
        message = None
        try:
            with one_blas_thread():
                outcome = command(*args, **kwargs)
            code = 0
            return outcome
        except BubblefitError as error:
            code = error.exit_code
            message = str(error)
            complain(error)
            sys.exit(error.exit_code)
        except KeyboardInterrupt:
            code = INTERRUPTED
            message = "interrupted"
            complain(message)
            sys.exit(INTERRUPTED)
        except OSError as error:
            end = end_of_output(error)
            if end is None:
                message = f"{type(error).__name__}: {error}"
                raise
            code, message = end
            complain(message)
            sys.exit(code)
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
            raise
        except Exception as error:
            message = f"{type(error).__name__}: {error}"
            raise
        finally:
            EVENTS.end(code, message)

    return wrapped


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Name --resume on an interruption of work that is kept in `folder`, and let it pass."""
    try:
        yield
    except KeyboardInterrupt:
        # Of a run that can be resumed, one of these is in its folder.
        if any((folder / name).exists() for name in ("run.json", "analyses")):
            click.echo(f"interrupted; go on with --resume (kept in {folder})", err=True)
        raise


def written_to(folder: Path) -> str:
    """Return the line that names the page to open where there is one, else the folder."""
    page = folder / PAGE
    if page.exists():
        return f"page:{TOGETHER}{page} (tables and figures beside it)"
    return f"written to{TOGETHER}{folder}"


def show(result: Mapping[str, Any], lines: Sequence[str], as_json: bool) -> None:
    """Print what a command came to.

    Parameters
    ----------
    result : mapping
        Content of result.json.
    lines : sequence of str
        For people; they are wrapped.
    as_json : bool
        Whether the result is printed instead of the lines.
    """
    text = json_text(result) if as_json else "".join(f"{wrapped(line)}\n" for line in lines)
    click.echo(text, nl=False)


#: Letters of a line; rows of tables, whose cells are two blanks apart, may be wider.
WIDTH = 80
TABLE = re.compile(r"\S {2,}\S")
#: The blank between a number and its unit.
UNIT = re.compile(r"(?<=\d) (?=%|(?:m?m|k?N|[kM]Pa|s)\b)")
#: A blank at which no line is broken.
TOGETHER = "\u00a0"


def wrapped(text: str) -> str:
    """Return words in lines of `WIDTH`, of which the further ones are indented by four."""
    lines = []
    for line in text.replace(TOGETHER, " ").split("\n"):
        if len(line) <= WIDTH or TABLE.search(line):
            lines.append(line)
            continue
        lines += textwrap.wrap(
            UNIT.sub(TOGETHER, line),
            WIDTH,
            subsequent_indent=" " * (len(line) - len(line.lstrip()) + 4),
            break_long_words=False,
            break_on_hyphens=False,
        )
    return "\n".join(lines).replace(TOGETHER, " ")


#: Shows the whole help instead of a line, in the versions of click that have it.
HELP = getattr(click.exceptions, "NoArgsIsHelpError", ())
#: "Option '--starts' requires an argument.": click names the option in the words only.
NAMED = re.compile(r"^Option '(--?[\w-]+)' (.*?)\.?$", re.DOTALL)


class UsageLine(click.ClickException):
    """Show an error of click's in our form: where, what, what to do."""

    exit_code = 2

    def show(self, file: Any = None) -> None:
        """Print one line on stderr."""
        complain(self.message)


@contextmanager
def in_one_line() -> Iterator[None]:
    """Turn usage errors of click within the block into one line, as what ends it otherwise."""
    try:
        yield
    except KeyboardInterrupt:
        complain("interrupted")
        sys.exit(INTERRUPTED)
    except OSError as error:
        if (end := end_of_output(error)) is None:
            raise
        complain(end[1])
        sys.exit(end[0])
    except click.UsageError as error:
        if isinstance(error, HELP):
            raise
        raise UsageLine(line_of(error)) from None


def line_of(error: click.UsageError) -> str:
    """Return which option or argument is wrong, in what, and which help to read."""
    command = "" if error.ctx is None else error.ctx.command_path
    parameter = ""
    problem = error.message[:1].lower() + error.message[1:]
    if isinstance(error, click.NoSuchOption):
        suggestion = did_you_mean(error.option_name, error.possibilities or ())
        parameter = error.option_name
        problem = f"no such option of {command or 'bubblefit'}{suggestion}"
    elif isinstance(error, click.BadParameter):
        is_missing = isinstance(error, click.MissingParameter)
        parameter = _name(error.param)
        problem = "is missing" if is_missing else error.message
    elif (named := NAMED.match(error.message)) is not None:
        parameter = named[1]
        problem = named[2]
    advice = f" ({command} --help tells what it takes)" if command else ""
    return f"{parameter and f'{parameter}: '}{' '.join(problem.rstrip('.').split())}{advice}"


def _name(param: click.Parameter | None) -> str:
    """Return the long name of an option, or an argument in capitals, as the help has it."""
    if isinstance(param, click.Option):
        return max((*param.opts, *param.secondary_opts), key=len)
    return "" if param is None else (param.metavar or param.name or "").upper()


class Suggesting(click.Group):
    """Suggest the most similar command where a name is unknown."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return a command and its arguments; UsageLine if there is none such."""
        name = args[0]
        commands = self.list_commands(ctx)
        if name not in commands and not name.startswith("-") and not ctx.resilient_parsing:
            words = f"no such command{did_you_mean(name, commands)}"
            raise UsageLine(f"{name}: {words} ({ctx.command_path} --help lists every command)")
        return super().resolve_command(ctx, args)


# --events: one JSON object a line, as it happens
#
#   {"event": "begin", "seconds": 0.0, "command": "bubblefit fit", "version": "0.2.0"}
#   {"event": "progress", "seconds": 3.1, "what": "starts", "done": 2, "total": 8, "note": "..."}
#   {"event": "end", "seconds": 9.8, "exit_code": 0, "error": null}
#
# The last line is always an end, unless the process was killed. The file may be a pipe.


class Events:
    """Write events to a file; do nothing unless one is open.

    Parameters
    ----------
    repeated_after : float
        Seconds between two lines of progress that report the same count.
    """

    def __init__(self, repeated_after: float = 1.0) -> None:
        self.repeated_after = repeated_after
        self._file: IO[str] | None = None
        self._start_time = 0.0
        self._progress_time = 0.0
        self._progress: Any = None

    def begin(self, path: Path, command: str) -> None:
        """Open the file and write the first event; a file outside /dev is replaced."""
        with output_errors(path):
            # A device or a redirected stdout is appended to.
            mode = "a" if path.is_char_device() or path.is_relative_to("/dev") else "w"
            self._file = open(path, mode, encoding="utf-8")
        self._start_time = time.monotonic()
        self._progress = None
        self.write("begin", command=command, version=__version__)

    def write(self, event: str, **facts: Any) -> None:
        """Write one line; stop for good where the reader has gone."""
        if self._file is None:
            return
        seconds = round(time.monotonic() - self._start_time, 3)
        try:
            self._file.write(json.dumps({"event": event, "seconds": seconds, **facts}) + "\n")
            self._file.flush()
        except OSError:
            self._file = None

    def progress(self, counted: str, count: float, total: float | None, note: str) -> None:
        """Write one line where the count has changed or a second has passed."""
        time_s = time.monotonic()
        progress = (counted, count, total)
        if self._progress == progress and time_s - self._progress_time < self.repeated_after:
            return
        self._progress_time = time_s
        self._progress = progress
        self.write("progress", what=counted, done=count, total=total, note=note)

    def end(self, exit_code: int, error: str | None = None) -> None:
        """Write the last line and close the file."""
        self.write("end", exit_code=exit_code, error=error)
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


LOGGER = logging.getLogger("bubblefit")
WARNING = logging.Formatter("warning: %(message)s")
TIMED = logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S")
VERBOSE = "Report each analysis, solver files and times, on stderr."  # help of --verbose


class Stderr(logging.Handler):
    """Write to the stderr of the moment, so that a live line of progress stays below."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record, warnings without the time."""
        formatter = WARNING if record.levelno >= logging.WARNING else TIMED
        print(formatter.format(record), file=sys.stderr, flush=True)


def listen(verbose: bool = False) -> None:
    """Print warnings of the library; with `verbose`, also on a second call, everything it logs."""
    if not any(isinstance(handler, Stderr) for handler in LOGGER.handlers):
        LOGGER.addHandler(Stderr())
    LOGGER.setLevel(logging.INFO if verbose else logging.WARNING)


def verbose() -> bool:
    """Return True where everything that is logged is printed."""
    return LOGGER.isEnabledFor(logging.INFO)


def _louder(ctx: click.Context, _: click.Parameter, verbose: bool) -> None:
    if verbose and not ctx.resilient_parsing:
        listen(True)


def with_common_options(command: click.Command) -> click.Command:
    """Add --verbose and --events to a command, or to each command of a group.

    Both are eager callbacks; the command's function does not receive them.
    """
    if isinstance(command, click.Group):
        for subcommand in command.commands.values():
            with_common_options(subcommand)
    elif not any(param.name == "events" for param in command.params):
        command.params += [
            click.Option(
                ["--verbose"], is_flag=True, expose_value=False, callback=_louder, help=VERBOSE
            ),
            click.Option(
                ["--events", "events"],
                type=FILE,
                metavar="FILE",
                expose_value=False,
                callback=_begin,
                help="Write progress to FILE, one JSON object a line.",
            ),
        ]
    return command
