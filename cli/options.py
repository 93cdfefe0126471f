"""What the commands share: errors to exit codes, the output folder's default, cores."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from ..errors import BubblefitError, InputError, OutputError

if TYPE_CHECKING:
    from ..materials.card import MaterialCard
    from ..projects.bend import BendProject
    from ..projects.fit import FitProject

Project = TypeVar("Project", bound="FitProject | BendProject")
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


def cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def default_folder(project: Path) -> Path:
    """out/NAME below the current folder, after the project's folder and file."""
    name = project.resolve().parent.name
    return Path("out") / (name if project.stem == "project" else f"{name}-{project.stem}")


def result_folder(project: Path, suffix: str, out: Path | None, overwrite: bool) -> Path:
    """The output folder of one analysis or study: `out`, or out/NAME-`suffix`.

    Raises
    ------
    OutputError : it holds a result already and may not be written over.
    """
    own = default_folder(project)
    folder = out or own.with_name(f"{own.name}-{suffix}")
    if (folder / "result.json").exists() and not overwrite:
        raise OutputError(f"{folder}: already holds a result; use --overwrite or another --out")
    return folder


def solver_choice(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options that pick a solver; the command is given them as one dict, `solver_given`."""

    @click.option("--solver", metavar="NAME", help="Solver that runs the model.")
    @click.option("--ccx", metavar="PATH", help="The CalculiX to run.")
    @click.option("--marc", metavar="PATH", help="The Marc to run: run_marc, or a site's .toml.")
    @click.option(
        "--templates", type=click.Path(path_type=Path), help="Folder of your own input decks."
    )
    @click.option(
        "--element",
        metavar="NAME",
        help="Shell element: S8R or S4 (CalculiX), 139, 75 or 18 (Marc).",
    )
    @functools.wraps(command)
    def wrapped(
        *args: Any,
        solver: str | None,
        ccx: str | None,
        marc: str | None,
        templates: Path | None,
        element: str | None,
        **kwargs: Any,
    ) -> Any:
        given = {
            "solver": solver, "ccx": ccx, "marc": marc, "templates": templates, "element": element
        }  # fmt: skip
        return command(*args, solver_given=given, **kwargs)

    return wrapped


def with_solver(project: Project, given: Mapping[str, Any]) -> Project:
    """The project with the solver and the solver's options of the command line.

    Raises
    ------
    InputError : an option of a solver that does not run.
    """
    name = given["solver"] or project.solver
    mine = {k: v for k, v in given.items() if k != "solver" and v is not None}
    known = project.solver_options.get(name, {})
    for option in mine:
        if option not in known:
            raise InputError(None, f"--{option}", f"means nothing to the solver {name!r}")
    options = {**project.solver_options, name: {**known, **mine}}
    return replace(project, solver=name, solver_options=options)


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
