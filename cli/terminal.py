"""Common behaviour of all commands: usage errors, exit codes, events, logs and printed results.

A command is declared with `command` (or `group`); its function prints its result with `show`.
`main` parses and runs every command within `in_one_line`, and adds --events and --verbose to it.
"""

import errno
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
from ..storage.writing import json_text, output_errors, unwritable_reason
from ..version import __version__

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


class OutputPath(click.Path):
    """Type of an option whose value is a path, of a file or an output folder.

    Parameters
    ----------
    is_folder : bool
        Whether it is an output folder: it, or else its nearest parent that exists, has to be a
        folder that can be written to.
    """

    def __init__(self, *, is_folder: bool = False) -> None:
        super().__init__(path_type=Path)
        self.is_folder = is_folder

    def convert(self, value: Any, param: Any, ctx: Any) -> Any:
        """Return the path, or raise a usage error for a path that cannot be used."""
        try:
            problem = self._problem(Path(value)) if str(value) else "expected a path, got nothing"
        except OSError as error:  # a name that is too long, a folder that may not be read
            problem = f"no path: {error.strerror}"
        if problem:
            self.fail(problem, param, ctx)
        return super().convert(value, param, ctx)

    def _problem(self, path: Path) -> str:
        """Return what is wrong with a path, "" if nothing is.

        Raises
        ------
        OSError
            The path cannot be examined.
        """
        existing = next(place for place in (path, *path.absolute().parents) if place.exists())
        if self.is_folder and not existing.is_dir():
            return f"{existing} is a file; name a folder"
        if self.is_folder and not os.access(existing, os.W_OK):
            return f"{existing} is Read-only, or not yours to write; name another folder"
        return ""


FILE = OutputPath()
FOLDER = OutputPath(is_folder=True)
PAGE = "report.html"
#: Key in the `meta` of click's context under which the typed command line is kept.
COMMAND_LINE = "bubblefit.command_line"
#: Heading of the examples in the help of a command.
HEAD = "Examples:"


def command(name: str, *lines: str) -> Callable[[Callable[..., Any]], click.Command]:
    """Return a decorator that declares a command.

    Parameters
    ----------
    name : str
        Name of the command.
    *lines : str
        Examples that stand below the help.
    """

    def declare(function: Callable[..., Any]) -> click.Command:
        return click.command(name, epilog=examples(*lines))(function)

    return declare


def group(name: str, *lines: str) -> Callable[[Callable[..., Any]], click.Group]:
    """Return a decorator that declares a group of commands with examples below its help."""
    return click.group(name, cls=Suggesting, epilog=examples(*lines))


def examples(*lines: str) -> str:
    """Return the end of a command's help: one example on each line, which click does not wrap."""
    typed = "".join(f"  {line}\n" for line in lines)
    return f"\b\n{HEAD}\n{typed}"


#: Exit codes: interrupted by Ctrl-C, output that nobody reads any more, and above --fail-above.
INTERRUPTED = 130
UNREAD = 141
WORSE = 1


def complain(message: object) -> None:
    """Print an error message on stderr, unless it is empty or stderr cannot be written."""
    with suppress(OSError):
        if message:
            click.echo(f"bubblefit: {message}", err=True)


def check_stdout() -> None:
    """End the command where stdout is closed, as the next file opened would become stdout."""
    if sys.stdout is None:
        complain("standard output is closed; redirect it into a file, or to /dev/null")
        sys.exit(OutputError.exit_code)


def end_of_output(error: OSError) -> tuple[int, str] | None:
    """Return exit code and message if an error came from printing to stdout, else None.

    stdout is then replaced, so that Python does not fail again when it ends.
    """
    *_, (frame, _) = traceback.walk_tb(error.__traceback__)  # the innermost one, that raised it
    if frame.f_code is not click.echo.__code__:
        return None
    # Python flushes stdout once more when it ends.
    sys.stdout = open(os.devnull, "w", encoding="utf-8")
    if error.errno == errno.EPIPE:
        return UNREAD, ""
    return OutputError.exit_code, f"standard output {unwritable_reason(error)} another place"


def end_of(error: BaseException) -> tuple[int, str] | None:
    """Return exit code and message of an error that is shown in one line, None for a mistake."""
    if isinstance(error, BubblefitError):
        return error.exit_code, str(error)
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, "interrupted"
    return end_of_output(error) if isinstance(error, OSError) else None


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Print a hint at --resume if the block is interrupted and `folder` holds work to resume.

    The interruption itself is raised again.
    """
    try:
        yield
    except KeyboardInterrupt:
        # The folder of a run that can be resumed contains one of these files.
        if any((folder / name).exists() for name in ("run.json", "analyses")):
            click.echo(f"interrupted; go on with --resume (kept in {folder})", err=True)
        raise


def written_to(folder: Path) -> str:
    """Return a line that names the report page of a folder, or the folder where it has none."""
    page = folder / PAGE
    if page.exists():
        return f"page:{TOGETHER}{page} (tables and figures beside it)"
    return f"written to{TOGETHER}{folder}"


def show(result: Mapping[str, Any], lines: Sequence[str], as_json: bool) -> None:
    """Print the result of a command on stdout.

    Parameters
    ----------
    result : mapping
        Content of result.json.
    lines : sequence of str
        Result in words; long lines are wrapped.
    as_json : bool
        Whether `result` is printed as JSON instead of the lines.
    """
    text = json_text(result) if as_json else "".join(f"{wrapped(line)}\n" for line in lines)
    click.echo(text, nl=False)


#: Number of letters in a line, and the pattern of rows of tables, which may be longer: their cells
#: are two blanks apart.
WIDTH = 80
TABLE = re.compile(r"\S {2,}\S")
#: Pattern of the blank between a number and its unit, at which no line is broken.
UNIT = re.compile(r"(?<=\d) (?=%|(?:m?m|k?N|[kM]Pa|s)\b)")
#: Blank at which no line is broken, a no-break space.
TOGETHER = "\u00a0"


def wrapped(text: str) -> str:
    """Return text wrapped to lines of `WIDTH`; continued lines are indented by four blanks."""
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


#: Usage error that shows the whole help instead of a line; not every version of click has it.
HELP = getattr(click.exceptions, "NoArgsIsHelpError", ())
#: Pattern of click's messages that name an option: "Option '--starts' requires an argument."
NAMED = re.compile(r"^Option '(--?[\w-]+)' (.*?)\.?$", re.DOTALL)


class UsageLine(click.ClickException):
    """Usage error that is shown as one line: which command, what is wrong, what to do."""

    exit_code = 2

    def show(self, file: Any = None) -> None:
        """Print one line on stderr."""
        complain(self.message)


@contextmanager
def in_one_line() -> Iterator[None]:
    """Turn errors within the block into one line on stderr and an exit code; end the events.

    Ctrl-C becomes exit code 130. The event of the end of the command is written in any case.
    """
    code = 0
    message = None
    try:
        yield
    except click.UsageError as error:
        code = error.exit_code
        message = line_of(error)
        if isinstance(error, HELP):
            raise
        raise UsageLine(message) from None
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
        raise
    except (Exception, KeyboardInterrupt) as error:
        end = end_of(error)
        code, message = end or (1, f"{type(error).__name__}: {error}")
        if end is None:
            raise
        complain(message)
        sys.exit(code)
    finally:
        EVENTS.end(code, message)


def line_of(error: click.UsageError) -> str:
    """Return a usage error as a line: option or argument, what is wrong, which help to read."""
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
    """Group of commands that suggests the most similar command for an unknown name."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return a command and its arguments, as click does.

        Raises
        ------
        UsageLine
            There is no such command; the line suggests the most similar one.
        """
        name = args[0]
        commands = self.list_commands(ctx)
        if name not in commands and not name.startswith("-") and not ctx.resilient_parsing:
            words = f"no such command{did_you_mean(name, commands)}"
            raise UsageLine(f"{name}: {words} ({ctx.command_path} --help lists every command)")
        return super().resolve_command(ctx, args)


# Events of --events: one JSON object on each line, written when it happens, such as
#
#   {"event": "begin", "seconds": 0.0, "command": "bubblefit fit", "version": "0.2.0"}
#   {"event": "progress", "seconds": 3.1, "what": "starts", "done": 2, "total": 8, "note": "..."}
#   {"event": "end", "seconds": 9.8, "exit_code": 0, "error": null}
#
# The last line is always an end, unless the process was killed. The file may be a pipe.


class Events:
    """Write the events of --events, by which programs follow a command, to a file.

    Nothing is written while no file is open.

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
        """Open the file and write the event of the command's begin.

        A file that exists is replaced, but devices below /dev are appended to.

        Raises
        ------
        OutputError
            The file cannot be opened.
        """
        with output_errors(path):
            # A device or a redirected stdout is appended to.
            mode = "a" if path.is_char_device() or path.is_relative_to("/dev") else "w"
            self._file = open(path, mode, encoding="utf-8")
        self._start_time = time.monotonic()
        self._progress = None
        self.write("begin", command=command, version=__version__)

    def write(self, event: str, **facts: Any) -> None:
        """Write an event with its facts as one line; stop for good if the file takes no more."""
        if self._file is None:
            return
        seconds = round(time.monotonic() - self._start_time, 3)
        try:
            self._file.write(json.dumps({"event": event, "seconds": seconds, **facts}) + "\n")
            self._file.flush()
        except OSError:
            self._file = None

    def progress(self, counted: str, count: float, total: float | None, note: str) -> None:
        """Write an event of progress if the count has changed or `repeated_after` has passed.

        Parameters
        ----------
        counted : str
            Plural noun for what is counted.
        count : float
            Number that is done.
        total : float or None
            Number to be reached, None where it is not known.
        note : str
            Further words, such as the best objective so far.
        """
        time_s = time.monotonic()
        progress = (counted, count, total)
        if self._progress == progress and time_s - self._progress_time < self.repeated_after:
            return
        self._progress_time = time_s
        self._progress = progress
        self.write("progress", what=counted, done=count, total=total, note=note)

    def end(self, exit_code: int, error: str | None = None) -> None:
        """Write the event of the command's end and close the file."""
        self.write("end", exit_code=exit_code, error=error)
        if self._file is not None:
            self._file.close()
        self._file = None


EVENTS = Events()


def _begin(ctx: click.Context, _: click.Parameter, path: Path | None) -> None:
    """Begin to write the events of a command to a file; callback of its option."""
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
    """Handler of logs that writes to the present `sys.stderr`, above a live bar of progress."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a record, warnings without the time."""
        formatter = WARNING if record.levelno >= logging.WARNING else TIMED
        print(formatter.format(record), file=sys.stderr, flush=True)


def listen(verbose: bool = False) -> None:
    """Print what the library logs on stderr: warnings or, with `verbose`, everything.

    A further call changes only how much is printed.
    """
    if not any(isinstance(handler, Stderr) for handler in LOGGER.handlers):
        LOGGER.addHandler(Stderr())
    LOGGER.setLevel(logging.INFO if verbose else logging.WARNING)


def verbose() -> bool:
    """Return whether everything that the library logs is printed."""
    return LOGGER.isEnabledFor(logging.INFO)


def _louder(ctx: click.Context, _: click.Parameter, verbose: bool) -> None:
    """Show the messages of the log; callback of --verbose."""
    if verbose and not ctx.resilient_parsing:
        listen(True)


def with_common_options(command: click.Command) -> click.Command:
    """Add --verbose and --events to a command, or to each command of a group.

    Both work by callbacks; the command's function does not receive them.
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
