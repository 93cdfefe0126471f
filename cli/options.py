"""Arguments and options of several commands, the objects made of them, and progress.

Progress is a live line on a terminal, a plain line a minute elsewhere, and events for machines.
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
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from ..errors import InputError, OutputError
from ..readers.sections import LENGTH_UNITS
from ..runs.in_use import used_alone
from ..runs.progress import Count
from ..solvers.registry import ANY
from ..solvers.registry import command_line as solver_options
from .terminal import COMMAND_LINE, EVENTS, FILE, FOLDER, Decorator

if TYPE_CHECKING:
    from ..project.project import Project
    from ..solvers.base import Announcement

Command = Callable[..., Any]

PROJECT: Decorator = click.argument("project", type=FILE)
TESTS: Decorator = click.option(
    "--test", "tests", multiple=True, help="A test by its name; several [all]."
)
DATA: Decorator = click.option(
    "--data",
    multiple=True,
    metavar="[TEST=]DIR",
    help="Folder of the measured data, of all tests or of one; several.",
)
TRUST: Decorator = click.option(
    "--trust", multiple=True, metavar="NAME", help="Accept a doubt about the data; several."
)
CARD_OF_FIT: Decorator = click.option(
    "--card", help="Card of the fit: a file or a name [that of the project's fit]."
)
JOBS: Decorator = click.option("--jobs", type=click.IntRange(min=1), help="Processes [all cores].")
SCHEDULER: Decorator = click.option(
    "--scheduler",
    envvar="BUBBLEFIT_SCHEDULER",
    metavar="ADDRESS",
    help="Dask scheduler whose workers do the runs [this machine].",
)
OVERWRITE: Decorator = click.option(
    "--overwrite", is_flag=True, help="Replace the results in the output folder."
)
AS_JSON: Decorator = click.option(
    "--json", "as_json", is_flag=True, help="Print result.json on stdout."
)
QUIET: Decorator = click.option("--quiet", is_flag=True, help="No progress.")


def resume_option(words: str = "Keep the analyses that the output folder holds.") -> Decorator:
    return click.option("--resume", is_flag=True, help=words)


def fail_above_option(words: str) -> Decorator:
    return click.option("--fail-above", type=float, metavar="E", help=words)


def out_option(usual: str = "out/NAME") -> Decorator:
    return click.option("--out", type=FOLDER, help=f"Output folder [{usual}].")


def with_options(*decorators: Decorator) -> Decorator:
    """Return a decorator that adds options; the help lists them in this order."""
    return lambda command: functools.reduce(lambda one, add: add(one), decorators[::-1], command)


def with_checks(*decorators: Decorator) -> Decorator:
    """Return `with_options` where --resume, --overwrite and --fail-above are checked."""

    def decorate(command: Command) -> Command:
        @functools.wraps(command)
        def checked(*args: Any, resume: bool, overwrite: bool, **kwargs: Any) -> Any:
            above = kwargs.get("fail_above")
            if resume and overwrite:
                raise InputError(None, "--resume, --overwrite", "give one of them, not both")
            if above is not None and not above >= 0:
                raise InputError(None, "--fail-above", f"expected 0 or more, got {above:g}")
            return command(*args, resume=resume, overwrite=overwrite, **kwargs)

        return with_options(*decorators)(checked)

    return decorate


def solver_choice(command: Command) -> Command:
    """Add the options that pick a solver; the command receives them as a dict, `solver_given`."""
    known = solver_options()

    @functools.wraps(command)
    def wrapped(
        *args: Any, solver: str | None, solver_option: Sequence[str], cache: bool, **kwargs: Any
    ) -> Any:
        given = {"solver": solver, "settings": solver_option, "cache": cache}
        given |= {one.name: kwargs.pop(one.name) for one in known}
        return command(*args, solver_given=given, **kwargs)

    add = with_options(
        click.option("--solver", metavar="NAME", help="Solver that runs the model."),
        *(
            click.option(
                f"--{one.name}", metavar=one.metavar, type=FILE if one.path else str, help=one.what
            )
            for one in known
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


def command_line() -> list[str]:
    """Return the program and the arguments as typed, for the record of a run."""
    return list(click.get_current_context().meta[COMMAND_LINE])


def data_folders(given: Sequence[str]) -> Path | dict[str, Path] | None:
    """Return the folder of measured data for all tests, or a folder by test ("NAME=DIR").
    Raises InputError for some of both, or a test named twice."""
    named = [name.partition("=") for name in given if "=" in name and not os.path.exists(name)]
    if named and len(named) < len(given):
        raise InputError(None, "--data", "give one DIR for all tests, or TEST=DIR for each")
    if len(given) > 1 and not named:
        raise InputError(None, "--data", "is given twice; TEST=DIR tells tests apart")
    folders = {name: Path(folder) for name, _, folder in named}
    if len(folders) < len(named):
        raise InputError(None, "--data", "names a test twice")
    return folders or (Path(given[0]) if given else None)


def folder_of(options: Mapping[str, Any], suffix: str) -> Path:
    """Return and hold the output folder of a command that does not fit: --out, or
    out/NAME-`suffix`."""
    from ..project.schema import usual_folder

    own = usual_folder(options["project"])
    return held_folder(options["out"] or own.with_name(f"{own.name}-{suffix}"))


def held_folder(folder: Path) -> Path:
    """Return an output folder, which this command alone writes until it ends; OutputError."""
    click.get_current_context().with_resource(used_alone(folder))
    return folder


def result_folder(options: Mapping[str, Any], suffix: str) -> Path:
    """Return `folder_of`, where no result may be without --overwrite or --resume."""
    from ..runs.folder import check_unused

    folder = folder_of(options, suffix)
    check_unused(folder, options.get("resume", False), options["overwrite"])
    return folder


def read_with_solver(options: Mapping[str, Any], need_data: bool = True) -> Project:
    """Read the project of a command; its solver options replace those of the file.
    options : of the command, by name."""
    from ..project.project import read_project

    project = read_project(options["project"], data_folders(options["data"]), need_data)
    return with_solver(project, options["solver_given"])


def read_to_refit(options: Mapping[str, Any]) -> Project:
    """Read a project for a study that fits again, with solver, jobs and scheduler as given."""
    project = read_with_solver(options).with_fit(jobs=options["jobs"])
    return project.with_scheduler(options["scheduler"])


def quiet(options: Mapping[str, Any]) -> bool:
    """Return True where no progress is shown."""
    return bool(options["quiet"] or options["as_json"])


def with_solver(project: Project, given: Mapping[str, Any]) -> Project:
    """Return the project with the solver and the solver's options of the command line."""
    mine = {k: v for k, v in given.items() if k not in ("solver", "settings", "cache")}
    if not given.get("cache", True):
        project = project.with_fit(cache=False)
    return project.with_solver(given["solver"], mine, given.get("settings", ()))


def numbers(text: str, option: str) -> list[float]:
    """Return the numbers of a text that has commas between them."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        problem = f"expected numbers with commas between them, got {text!r}"
        raise InputError(None, option, problem) from None


#: Options for reading frames.
frame_options = with_options(
    click.option("--format", metavar="NAME", help="Of the frames; found by their content."),
    click.option("--columns", metavar="x=..,..", help="Names in the files, where not found."),
    click.option("--flag-column", metavar="NAME", help="Rows where it is not 0 are lost."),
    click.option(
        "--length-unit",
        type=click.Choice(list(LENGTH_UNITS)),
        default="mm",
        help="Of the files [mm].",
    ),
)


def check_out(out: Path, inputs: Sequence[Path | None], overwrite: bool) -> None:
    """Check that a file may be written: not one that is read, nor one that exists."""
    if out.resolve() in [file.resolve() for file in inputs if file is not None]:
        raise OutputError(f"{out}: is one of the files to be read; choose another --out")
    if out.exists() and not overwrite:
        raise OutputError(f"{out}: is already there; use --overwrite or another --out")


def columns_named(given: str | None) -> dict[str, str] | None:
    """Return the columns of some of x, y, z, dx, dy, dz, given as in "x=X,dz=W".
    Raises InputError for another form, or one column for two quantities."""
    names: dict[str, str] = {}
    for part in [] if given is None else given.split(","):
        quantity, equals, name = (piece.strip() for piece in part.partition("="))
        problem = ""
        if not (equals and name):
            problem = f"expected such as x=X,y=Y,z=Z,dx=U,dy=V,dz=W, got {part.strip()!r}"
        elif name in (other := {n: q for q, n in names.items() if q != quantity}):
            problem = f"column {name!r} is named for {other[name]} and for {quantity}"
        if problem:
            raise InputError(None, "columns", problem)
        names[quantity] = name
    return names or None


PLAIN_EVERY_S = 60.0
COMPILING = (
    "compiling for this machine: the first run takes some tens of seconds more, later ones do not"
)


class LiveLine(Count):
    """Show a bar on a terminal, on stderr, so that stdout stays for results; elsewhere none.
    Announcements meanwhile get a line of their own; a state (a process that waits for a licence)
    is shown on the bar, and without a bar on a line, a minute apart."""

    def __init__(self, what: str, quiet: bool, total: int = 0) -> None:
        super().__init__(what, total)
        self.bar: Progress | None = None
        self.said = time.monotonic()
        self.quiet, self._hearing = quiet, ExitStack()
        self._states: dict[str, str] = {}
        self._stated: dict[str, float] = {}
        if not quiet and sys.stderr.isatty():
            self.bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[note]}"),
                TimeElapsedColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self.task = self.bar.add_task(what, total=total or None, note="")

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

    def heard(self, said: Announcement) -> None:
        """Record a state, or print an announcement."""
        if said.of:
            self._states.pop(said.of, None)
            if said.words:
                self._states[said.of] = said.words
            last = self._stated.get(said.words, -PLAIN_EVERY_S)
            if time.monotonic() - last < PLAIN_EVERY_S:
                return
            self._stated[said.words] = time.monotonic()
        if not said.words or (self.quiet and said.of):  # a state is progress
            return
        if self.bar is None:
            print(said.words, file=sys.stderr, flush=True)
        elif not said.of:
            self.bar.console.print(said.words, markup=False, highlight=False, soft_wrap=True)

    def __call__(self, *event: Any) -> None:
        """Print the name of a fit that begins, and show what was told."""
        if isinstance(event[0], str) and not self.quiet:
            print(event[0], file=sys.stderr, flush=True)
        super().__call__(*event)

    def show(self) -> None:
        """Update the bar, or elsewhere print a plain line a minute; write events as they come."""
        waits = "".join(f", {n} {words}" for words, n in Counter(self._states.values()).items())
        note = self.note + waits
        total = self.total or None
        EVENTS.progress(self.what, self.done, total, note)
        if self.bar is not None:
            self.bar.update(
                self.task, description=self.what, completed=self.done, total=total, note=note
            )
        elif not self.quiet and time.monotonic() - self.said >= PLAIN_EVERY_S:
            self.said = time.monotonic()
            print(f"{self.line}{waits}", file=sys.stderr, flush=True)
