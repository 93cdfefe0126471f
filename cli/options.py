"""What commands make of their options: folders, projects with a solver, cards, numbers."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError, OutputError

if TYPE_CHECKING:
    from ..materials.card import MaterialCard
    from ..project.project import Project

#: Where click keeps what was typed, while a command runs.
COMMAND_LINE = "bubblefit.command_line"


def command_line() -> list[str]:
    """What was typed: the program and its arguments, for the record of a run."""
    return list(click.get_current_context().meta[COMMAND_LINE])


def data_folders(given: Sequence[str]) -> Path | dict[str, Path] | None:
    """Folders of measured data: one for all tests, or one by the name of a test ("NAME=DIR").

    Raises
    ------
    InputError : some of both, or a test named twice.
    """
    named = [name.partition("=") for name in given if "=" in name and not os.path.exists(name)]
    if named and len(named) < len(given):
        raise InputError(None, "--data", "give one DIR for all tests, or TEST=DIR for each")
    if len(given) > 1 and not named:
        raise InputError(None, "--data", "is given twice; TEST=DIR tells tests apart")
    folders = {name: Path(folder) for name, _, folder in named}
    if len(folders) < len(named):
        raise InputError(None, "--data", "names a test twice")
    return folders or (Path(given[0]) if given else None)


def folder_beside(project: Path, suffix: str) -> Path:
    """The usual output folder of what is no fit: out/NAME-`suffix`."""
    from ..project.cards import usual_folder

    own = usual_folder(project)
    return own.with_name(f"{own.name}-{suffix}")


def result_folder(
    project: Path, suffix: str, out: Path | None, overwrite: bool, resume: bool = False
) -> Path:
    """The output folder of one analysis or study: `out`, or out/NAME-`suffix`.

    Raises
    ------
    OutputError : it holds a result already and may not be written over.
    """
    folder = out or folder_beside(project, suffix)
    if (folder / "result.json").exists() and not (overwrite or resume):
        raise OutputError(f"{folder}: already holds a result; use --overwrite or another --out")
    return folder


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
    from ..project.project import read_project

    return with_solver(read_project(path, data, need_data), given)


def read_to_refit(path: Path, options: Mapping[str, Any]) -> Project:
    """The project of a file for a study that fits again: `read_with_solver`, jobs, scheduler.

    options : of the command, by name.

    Raises
    ------
    InputError : as `read_with_solver`; a scheduler's address that is none.
    """
    project = read_with_solver(path, options["solver_given"], data_folders(options["data"]))
    return project.with_fit(jobs=options["jobs"]).with_scheduler(options["scheduler"])


def with_solver(project: Project, given: Mapping[str, Any]) -> Project:
    """The project with the solver and the solver's options of the command line.

    Raises
    ------
    InputError : an option of a solver that does not run.
    """
    mine = {k: v for k, v in given.items() if k not in ("solver", "settings", "cache")}
    if not given.get("cache", True):
        project = project.with_fit(cache=False)
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
