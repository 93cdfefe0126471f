"""Arguments and options that several commands share, their evaluation, and display of progress.

Progress is a live bar on a terminal, elsewhere one line in a minute, and events for programs.
"""

from __future__ import annotations

import functools
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import click

from ..errors import InputError, OutputError
from ..lazy_modules import rich_console, rich_progress
from ..runs.in_use import used_alone
from ..runs.progress import Count
from .terminal import COMMAND_LINE, EVENTS, FILE, FOLDER, Decorator

if TYPE_CHECKING:
    from rich.progress import Progress

    from ..project.project import Project
    from ..solvers.base import Announcement

Command = Callable[..., Any]


def _project_file(_: click.Context, __: click.Parameter, path: Path) -> Path:
    """Return the project.toml of a folder, or the path itself, of a file."""
    if not path.is_dir():
        return path
    if (path / "project.toml").is_file():
        return path / "project.toml"
    names = ", ".join(str(file) for file in sorted(path.glob("*.toml"))[:5])
    advice = f"name one of its files: {names}" if names else f"write one: bubblefit init {path}"
    raise click.BadParameter(f"{path} is a folder without project.toml; {advice}")


PROJECT = click.argument("project", type=FILE, callback=_project_file)
TESTS = click.option("--test", "tests", multiple=True, help="A test by its name; several [all].")
DATA = click.option(
    "--data",
    multiple=True,
    metavar="[TEST=]DIR",
    help="Folder of the measured data, of all tests or of one; several.",
)
TRUST = click.option(
    "--trust", multiple=True, metavar="NAME", help="Accept a doubt about the data; several."
)
CARD_OF_FIT = click.option(
    "--card", help="Card of the fit: a file or a name [that of the project's fit]."
)
JOBS = click.option("--jobs", type=click.IntRange(min=1), help="Processes [all cores].")
SCHEDULER = click.option(
    "--scheduler",
    envvar="BUBBLEFIT_SCHEDULER",
    metavar="ADDRESS",
    help="Dask scheduler whose workers do the runs [this machine].",
)
OVERWRITE = click.option(
    "--overwrite", is_flag=True, help="Replace the results in the output folder."
)
AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout.")
QUIET = click.option("--quiet", is_flag=True, help="No progress.")


def resume_option(words: str = "Keep the analyses that the output folder holds.") -> Decorator:
    """Return the option --resume with this help text."""
    return click.option("--resume", is_flag=True, help=words)


def fail_above_option(words: str) -> Decorator:
    """Return the option --fail-above with this help text."""
    return click.option("--fail-above", type=float, metavar="E", help=words)


def out_option(usual: str = "out/NAME") -> Decorator:
    """Return the option --out, whose help names the usual output folder."""
    return click.option("--out", type=FOLDER, help=f"Output folder [{usual}].")


def with_options(*decorators: Decorator) -> Decorator:
    """Return a decorator that adds options; the help lists them in this order."""

    def decorate(command: Command) -> Command:
        for add in reversed(decorators):
            command = add(command)
        return command

    return decorate


def with_checks(*decorators: Decorator) -> Decorator:
    """Return a decorator that adds options, and checks --resume, --overwrite and --fail-above.

    The options have to contain --resume and --overwrite, which exclude each other.
    """

    def decorate(command: Command) -> Command:
        @functools.wraps(command)
        def checked(*args: Any, resume: bool, overwrite: bool, **kwargs: Any) -> Any:
            limit = kwargs.get("fail_above")
            if resume and overwrite:
                raise InputError(None, "--resume, --overwrite", "give one of them, not both")
            if limit is not None and not limit >= 0:
                raise InputError(None, "--fail-above", f"expected 0 or more, got {limit:g}")
            return command(*args, resume=resume, overwrite=overwrite, **kwargs)

        return with_options(*decorators)(checked)

    return decorate


def command_line() -> list[str]:
    """Return the program and the arguments as typed, for the record of a run."""
    return list(click.get_current_context().meta[COMMAND_LINE])


def data_folders(values: Sequence[str]) -> Path | dict[str, Path] | None:
    """Return the folders of measured data that --data names.

    Parameters
    ----------
    values : sequence of str
        Values of the option: one "DIR" for all tests, or "TEST=DIR" for each.

    Returns
    -------
    Path, dict of str to Path, or None
        A folder for all tests, a folder by test, or None without the option.

    Raises
    ------
    InputError
        Both forms are mixed, or a test is named twice.
    """
    if not values:
        return None
    named = [value for value in values if "=" in value and not os.path.exists(value)]
    if not named:
        if len(values) > 1:
            raise InputError(None, "--data", "is given twice; TEST=DIR tells tests apart")
        return Path(values[0])
    if len(named) < len(values):
        raise InputError(None, "--data", "give one DIR for all tests, or TEST=DIR for each")
    folders = {}
    for value in named:
        test, _, folder = value.partition("=")
        folders[test] = Path(folder)
    if len(folders) < len(named):
        raise InputError(None, "--data", "names a test twice")
    return folders


def folder_of(options: Mapping[str, Any], suffix: str) -> Path:
    """Return the output folder of a command other than a fit, and reserve it for the command.

    It is that of --out, else out/NAME-SUFFIX, where out/NAME is the usual folder of the project's
    fits.

    Raises
    ------
    OutputError
        Another command is writing into it.
    """
    from ..project.schema import usual_folder

    of_fits = usual_folder(options["project"])
    return reserved_folder(options["out"] or of_fits.with_name(f"{of_fits.name}-{suffix}"))


def reserved_folder(folder: Path) -> Path:
    """Reserve an output folder until the command ends, and return it.

    Raises
    ------
    OutputError
        Another command is writing into it.
    """
    click.get_current_context().with_resource(used_alone(folder))
    return folder


def result_folder(options: Mapping[str, Any], suffix: str) -> Path:
    """Return the output folder of `folder_of`, and check that it has no results already.

    With --overwrite or --resume it may have results.
    """
    from ..runs.folder import check_unused

    folder = folder_of(options, suffix)
    check_unused(folder, options.get("resume", False), options["overwrite"])
    return folder


def read_with_solver(options: Mapping[str, Any], need_data: bool = True) -> Project:
    """Read the project of a command; options that choose a solver replace those of the file.

    `need_data` : whether measured data have to be there.
    """
    from ..project.project import read_project

    project = read_project(options["project"], data_folders(options["data"]), need_data)
    return with_solver(project, options["solver_given"])


def read_to_refit(options: Mapping[str, Any]) -> Project:
    """Read a project for a study that fits again, with solver, jobs and scheduler as given."""
    project = read_with_solver(options).with_fit(jobs=options["jobs"])
    return project.with_scheduler(options["scheduler"])


def quiet(options: Mapping[str, Any]) -> bool:
    """Return whether no progress is shown: with --quiet or --json."""
    return bool(options["quiet"] or options["as_json"])


def with_solver(project: Project, choice: Mapping[str, Any]) -> Project:
    """Return the project with the solver and its options as `solver_choice` collects them."""
    programs = {k: v for k, v in choice.items() if k not in ("solver", "settings", "cache")}
    if not choice.get("cache", True):
        project = project.with_fit(cache=False)
    return project.with_solver(choice["solver"], programs, choice.get("settings", ()))


def numbers(text: str, option: str) -> list[float]:
    """Return the numbers of a text such as "20,60,100", which is the value of an option.

    Raises
    ------
    InputError
        The text has another form; the error names the option.
    """
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        problem = f"expected numbers with commas between them, got {text!r}"
        raise InputError(None, option, problem) from None


def check_out(out: Path, inputs: Sequence[Path | None], overwrite: bool) -> None:
    """Check that an output file may be written.

    Parameters
    ----------
    out : Path
        File to write.
    inputs : sequence of Path or None
        Files that the command reads.
    overwrite : bool
        Whether a file that exists is replaced.

    Raises
    ------
    OutputError
        It is a file that is read, or exists.
    """
    if out.resolve() in [file.resolve() for file in inputs if file is not None]:
        raise OutputError(f"{out}: is one of the files to be read; choose another --out")
    if out.exists() and not overwrite:
        raise OutputError(f"{out}: is already there; use --overwrite or another --out")


def columns_named(text: str | None) -> dict[str, str] | None:
    """Return the names of columns by quantity (x, y, z, dx, dy, dz), from "x=X,dz=W".

    Raises
    ------
    InputError
        The text has another form, or one column for two quantities.
    """
    columns: dict[str, str] = {}
    for part in [] if text is None else text.split(","):
        quantity, equals, column = (piece.strip() for piece in part.partition("="))
        if not (equals and column):
            problem = f"expected such as x=X,y=Y,z=Z,dx=U,dy=V,dz=W, got {part.strip()!r}"
            raise InputError(None, "columns", problem)
        for first, name in columns.items():
            if name == column and first != quantity:
                problem = f"column {column!r} is named for {first} and for {quantity}"
                raise InputError(None, "columns", problem)
        columns[quantity] = column
    return columns or None


COMPILING = (
    "compiling for this machine: the first run takes some tens of seconds more, later ones do not"
)


class LiveLine(Count):
    """Show progress on stderr: a bar on a terminal, elsewhere one line in a minute.

    Announcements of solvers are printed on lines of their own. The state of a process, such as
    waiting for a licence, is shown at the bar, or on a line where there is no bar.

    Parameters
    ----------
    counted : str
        Plural noun for what is counted, such as "starts" or "runs".
    quiet : bool
        Whether only announcements are shown.
    total : int
        Number to be reached; 0 where it is not known.
    """

    #: Seconds between lines of progress, and between lines about one state.
    line_interval = 60.0

    def __init__(self, counted: str, quiet: bool, total: int = 0) -> None:
        super().__init__(counted, total)
        self.bar: Progress | None = None
        self.quiet = quiet
        self._hearing = ExitStack()
        self._line_time = time.monotonic()
        self._states: dict[str, str] = {}
        self._state_times: dict[str, float] = {}
        if not quiet and sys.stderr.isatty():
            self.bar = rich_progress.Progress(
                rich_progress.TextColumn("{task.description}"),
                rich_progress.BarColumn(),
                rich_progress.MofNCompleteColumn(),
                rich_progress.TextColumn("{task.fields[note]}"),
                rich_progress.TimeElapsedColumn(),
                console=rich_console.Console(stderr=True),
                transient=True,
            )
            self.task = self.bar.add_task(counted, total=total or None, note="")

    def __enter__(self) -> Self:
        from ..compilation import kernels_are_compiled
        from ..solvers.base import hearing

        if not self.quiet and not kernels_are_compiled():
            print(COMPILING, file=sys.stderr, flush=True)
        self._hearing.enter_context(hearing(self.heard))
        if self.bar is not None:
            self.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._hearing.close()
        if self.bar is not None:
            self.bar.stop()

    def heard(self, announcement: Announcement) -> None:
        """Show an announcement of a solver, or record the state of a process."""
        words = announcement.words
        is_state = bool(announcement.of)
        if is_state and not self._record_state(announcement):
            return
        if not words or (self.quiet and is_state):  # a state is progress
            return
        if self.bar is None:
            print(words, file=sys.stderr, flush=True)
        elif not is_state:
            self.bar.console.print(words, markup=False, highlight=False, soft_wrap=True)

    def _record_state(self, announcement: Announcement) -> bool:
        """Record the state of a process; return whether a line about it is due."""
        words = announcement.words
        self._states.pop(announcement.of, None)
        if words:
            self._states[announcement.of] = words
        time_s = time.monotonic()
        if time_s - self._state_times.get(words, -self.line_interval) < self.line_interval:
            return False
        self._state_times[words] = time_s
        return True

    def __call__(self, *event: Any) -> None:
        """Print the name of a fit that begins, and show the progress of an event."""
        if isinstance(event[0], str) and not self.quiet:
            print(event[0], file=sys.stderr, flush=True)
        super().__call__(*event)

    def show(self) -> None:
        """Write an event, and update the bar, or print a line if the last one is a minute old."""
        waits = "".join(f", {n} {words}" for words, n in Counter(self._states.values()).items())
        note = self.note + waits
        total = self.total or None
        if total is not None and self.done >= total:  # the page is near
            from ..reports.converter import convert

            convert.prepare()
        EVENTS.progress(self.counted, self.done, total, note)
        if self.bar is not None:
            self.bar.update(
                self.task, description=self.counted, completed=self.done, total=total, note=note
            )
        elif not self.quiet and time.monotonic() - self._line_time >= self.line_interval:
            self._line_time = time.monotonic()
            print(f"{self.line}{waits}", file=sys.stderr, flush=True)
