"""`bubblefit study`: what refinement, and Poisson's ratio, change in analyses with a card."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import click

from .arguments import (
    AS_JSON,
    DATA,
    OVERWRITE,
    PROJECT,
    RESUME,
    Decorator,
    out_option,
    solver_choice,
    with_checks,
)
from .ending import tell, written_to
from .examples import examples
from .exits import resumable
from .live_line import SeriesProgress
from .options import data_folders, read_with_solver, result_folder
from .usage import Suggesting

What = Literal["elements", "increments"]


def card_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """PROJECT, --card and the options of every study of a card; errors are handled."""
    decorators: list[Decorator] = [
        PROJECT,
        click.option(
            "--card", required=True,
            help="The material card's file, or the name of a card of the project.",
        ),
        click.option(
            "--test", "--case", "tests", multiple=True,
            help="A test by its name, or a kind of tests; several [all].",
        ),
        out_option("out/NAME-STUDY"),
        DATA,
        solver_choice,
        RESUME,
        OVERWRITE,
        AS_JSON,
    ]  # fmt: skip
    return with_checks(command, decorators)


def run_study(name: str, study: Callable[..., Any], options: dict[str, Any], **given: Any) -> None:
    """Read the project, run the study, write its folder, tell."""
    from ..runs.folder import KeptAnalyses

    path: Path = options["project"]
    project = read_with_solver(
        path, options["solver_given"], data_folders(options["data"]), need_data=False
    )
    resume, overwrite = options["resume"], options["overwrite"]
    folder = result_folder(path, name, options["out"], overwrite, resume)
    kept = KeptAnalyses(folder, resume)
    with resumable(folder), SeriesProgress(options["as_json"]) as progress:
        done = study(
            project, options["card"], tests=options["tests"], progress=progress.saw, kept=kept,
            **given,
        )  # fmt: skip
    done.write(folder)
    tell(done.result, [*done.lines(), written_to(folder)], options["as_json"])


@click.group(
    "study",
    cls=Suggesting,
    epilog=examples(
        "bubblefit study mesh project.toml --card out/project/material.toml",
        "bubblefit study nu12 project.toml --card out/project/material.toml",
    ),
)
def command() -> None:
    """What refinement, or nu12, changes in the analyses of a project."""


@command.command(
    "mesh",
    epilog=examples(
        "bubblefit study mesh project.toml --card out/project/material.toml",
        "bubblefit study mesh project.toml --card material.toml --what increments --levels 3",
    ),
)
@card_options
@click.option(
    "--what",
    type=click.Choice(["elements", "increments"]),
    default="elements",
    show_default=True,
    help="What is refined.",
)
@click.option(
    "--levels", type=click.IntRange(2, 8), default=4, show_default=True,
    help="Refinements, all told.",
)  # fmt: skip
@click.option(
    "--factor", type=click.IntRange(2, 10), default=2, show_default=True,
    help="Between levels: edges, or increments, are divided by it.",
)  # fmt: skip
@click.option(
    "--coarser", type=click.IntRange(min=0),
    help="Levels coarser than the project's own [1 of elements, 0 of increments].",
)  # fmt: skip
def study_mesh(what: What, levels: int, factor: int, coarser: int | None, **options: Any) -> None:
    """Run PROJECT.toml with a card on finer and finer meshes (or increments).

    Reports the quantities of interest and the cost of each level, the observed order of
    convergence and Richardson's limit. A level whose analysis fails is named and left out; when
    fewer than two end well the exit code is 4.
    """
    from ..runs.refinement import refine

    study = functools.partial(refine, what=what, levels=levels, factor=factor, coarser=coarser)
    run_study(what if what == "increments" else "mesh", study, options)


@command.command(
    "nu12",
    epilog=examples(
        "bubblefit study nu12 project.toml --card material.toml",
        "bubblefit study nu12 project.toml --card material.toml --nu12 0.1 --nu12 0.4",
    ),
)
@card_options
@click.option(
    "--nu12", "values", type=float, multiple=True,
    help="A value to run, as often as wanted [0.05 0.15 0.25 0.35 0.45].",
)  # fmt: skip
def study_nu12(values: tuple[float, ...], **options: Any) -> None:
    """Run PROJECT.toml with a card whose Poisson's ratio is changed, the moduli as they are.

    Reports every response relative to that at the card's own nu12 and relative to the mean of the
    values. A value whose analysis fails is named and left out; when the card's own fails, or all
    others do, the exit code is 4.
    """
    from ..runs.poisson import NU12, vary_nu12

    run_study("nu12", functools.partial(vary_nu12, values=values or NU12), options)
