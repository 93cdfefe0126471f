"""What the commands share: errors to exit codes, options, projects with a solver, cards."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import BubblefitError, InputError, OutputError

if TYPE_CHECKING:
    from ..fits.project import Project
    from ..materials.card import MaterialCard

INTERRUPTED = 130
#: Where click keeps what was typed, while a command runs.
COMMAND_LINE = "bubblefit.command_line"


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


def with_checks(
    command: Callable[..., Any], decorators: Sequence[Callable[..., Any]]
) -> Callable[..., Any]:
    """A study's command with its options, --resume, --overwrite and --fail-above checked."""

    @functools.wraps(command)
    def checked(*args: Any, resume: bool, overwrite: bool, **kwargs: Any) -> Any:
        above = kwargs["fail_above"]
        if resume and overwrite:
            raise InputError(None, "--resume, --overwrite", "give one of them, not both")
        if above is not None and not above >= 0:
            raise InputError(None, "--fail-above", f"expected 0 or more, got {above:g}")
        return command(*args, resume=resume, overwrite=overwrite, **kwargs)

    wrapped = exits(checked)
    for decorate in reversed(decorators):
        wrapped = decorate(wrapped)
    return wrapped


def command_line() -> list[str]:
    """What was typed: the program and its arguments, for the record of a run."""
    return list(click.get_current_context().meta[COMMAND_LINE])


def data_folders(given: Sequence[str]) -> Path | dict[str, Path] | None:
    """Folders of measured data: one for all tests, or one by the name of a test ("NAME=DIR").

    Raises
    ------
    InputError : some of both, or a test named twice.
    """
    named = [name.partition("=") for name in given if "=" in name and not Path(name).exists()]
    if named and len(named) < len(given):
        raise InputError(None, "--data", "give one DIR for all tests, or TEST=DIR for each")
    if len(given) > 1 and not named:
        raise InputError(None, "--data", "is given twice; TEST=DIR tells tests apart")
    folders = {name: Path(folder) for name, _, folder in named}
    if len(folders) < len(named):
        raise InputError(None, "--data", "names a test twice")
    return folders or (Path(given[0]) if given else None)


def result_folder(project: Path, suffix: str, out: Path | None, overwrite: bool) -> Path:
    """The output folder of one analysis or study: `out`, or out/NAME-`suffix`.

    Raises
    ------
    OutputError : it holds a result already and may not be written over.
    """
    from ..fits.store import usual_folder

    own = usual_folder(project)
    folder = out or own.with_name(f"{own.name}-{suffix}")
    if (folder / "result.json").exists() and not overwrite:
        raise OutputError(f"{folder}: already holds a result; use --overwrite or another --out")
    return folder


def solver_choice(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options that pick a solver; the command is given them as one dict, `solver_given`."""
    from ..solvers.overrides import ANY, command_line

    known = command_line()

    @functools.wraps(command)
    def wrapped(*args: Any, solver: str | None, solver_option: Sequence[str], **kwargs: Any) -> Any:
        given = {"solver": solver, "settings": solver_option}
        given |= {one.name: kwargs.pop(one.name) for one in known}
        return command(*args, solver_given=given, **kwargs)

    words = "A setting of the solver as in [solver.NAME]; may be given more than once."
    decorated = click.option(f"--{ANY}", metavar="KEY=VALUE", multiple=True, help=words)(wrapped)
    for one in reversed(known):
        kind = click.Path(path_type=Path) if one.path else str
        option = click.option(f"--{one.name}", metavar=one.metavar, type=kind, help=one.what)
        decorated = option(decorated)
    return click.option("--solver", metavar="NAME", help="Solver that runs the model.")(decorated)


def read_with_solver(
    path: Path,
    given: Mapping[str, Any],
    data: Path | Mapping[str, Path] | None = None,
    need_data: bool = True,
) -> Project:
    """The project of a file, with the solver and the solver's options of the command line.

    Raises
    ------
    InputError : in the project, or an option of a solver that does not run.
    """
    from ..fits.project import read_project

    return with_solver(read_project(path, data, need_data), given)


def with_solver(project: Project, given: Mapping[str, Any]) -> Project:
    """The project with the solver and the solver's options of the command line.

    Raises
    ------
    InputError : an option of a solver that does not run.
    """
    mine = {k: v for k, v in given.items() if k not in ("solver", "settings")}
    return project.with_solver(given["solver"], mine, given.get("settings", ()))


def named_cards(cards: Sequence[Path]) -> dict[str, MaterialCard]:
    """Cards by a name each: the card's own, else its file's, told apart where they agree.

    Raises
    ------
    InputError : what is no card; one that is given twice.
    """
    from ..materials.card import read_card

    named: dict[str, MaterialCard] = {}
    for path in cards:
        card = read_card(path)
        name = card.name or path.stem
        if name in named:
            name = f"{name} ({path})"
        if name in named:
            raise InputError(path, "--card", "is given twice")
        named[name] = card
    return named


def numbers(text: str, option: str) -> list[float]:
    """Numbers with commas between them.

    Raises
    ------
    InputError : naming the option.
    """
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        problem = f"expected numbers with commas between them, got {text!r}"
        raise InputError(None, option, problem) from None
