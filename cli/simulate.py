"""`bubblefit simulate`: forward analyses of tests with material cards."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from .arguments import (
    AS_JSON,
    DATA,
    OVERWRITE,
    PROJECT,
    RESUME,
    TESTS,
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
from .simulate_bend import simulate_bend
from .usage import Suggesting


def card_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """PROJECT, cards and the options of every simulation; errors are handled."""
    decorators: list[Decorator] = [
        PROJECT,
        click.option(
            "--card", "cards", multiple=True, required=True,
            help="A material card's file, or a card of the project; several side by side.",
        ),
        TESTS,
        out_option("out/NAME-simulated"),
        DATA,
        solver_choice,
        click.option(
            "--within-range", is_flag=True, help="End each curve where the card's valid range ends."
        ),
        RESUME,
        OVERWRITE,
        AS_JSON,
    ]  # fmt: skip
    return with_checks(command, decorators)


def run_simulation(command: str, options: dict[str, Any], kind: str | None = None) -> None:
    """Read the project, run its tests (of a kind, or those named) with the cards, tell."""
    from ..project.project import chosen_cards
    from ..runs.folder import KeptAnalyses
    from ..runs.simulation import simulate_cards

    path: Path = options["project"]
    data = data_folders(options["data"])
    project = read_with_solver(path, options["solver_given"], data, need_data=False)
    tests = project.chosen(options["tests"] or kind)
    cards = chosen_cards(project, options["cards"])
    resume = options["resume"]
    folder = result_folder(path, "simulated", options["out"], options["overwrite"], resume)
    kept = KeptAnalyses(folder, resume)
    with resumable(folder), SeriesProgress(options["as_json"]) as progress:
        done = simulate_cards(
            project, tests, cards, folder, options["within_range"], progress.saw, command, kept
        )
    tell(done.numbers, [*done.lines, written_to(folder)], options["as_json"])


@click.group(
    "simulate",
    cls=Suggesting,
    epilog=examples(
        "bubblefit simulate bubble project.toml --card out/project/material.toml",
        "bubblefit simulate bend --diameter 150 --pressure 140 --card material.toml",
    ),
)
def command() -> None:
    """Forward analyses with material cards, one or several side by side."""


@command.command(
    "test",
    epilog=examples(
        "bubblefit simulate test project.toml --card out/project/material.toml",
        "bubblefit simulate test project.toml --test bubble --card one.toml --card two.toml",
    ),
)
@card_options
def simulate_test(**options: Any) -> None:
    """Run the tests of PROJECT.toml with the materials of one or several cards.

    What was measured is drawn beside them where it is there. A card whose analysis fails in a test
    is left out there, and named; when nothing ends well the exit code is 4.
    """
    run_simulation("simulate test", options)


@command.command(
    "bubble",
    epilog=examples(
        "bubblefit simulate bubble project.toml --card material.toml",
        "bubblefit simulate bubble project.toml --card material.toml --within-range",
    ),
)
@card_options
def simulate_bubble(**options: Any) -> None:
    """Inflate the bubbles of PROJECT.toml with the materials of one or several cards."""
    run_simulation("simulate bubble", options, "bubble")


@command.command(
    "uniaxial",
    epilog=examples(
        "bubblefit simulate uniaxial project.toml --card material.toml",
        "bubblefit simulate uniaxial project.toml --card a.toml --card b.toml --out out/both",
    ),
)
@card_options
def simulate_uniaxial(**options: Any) -> None:
    """Pull the strips of PROJECT.toml with the materials of one or several cards.

    Measured curves are drawn beside them where they are there. A card whose analysis fails on a
    strip is left out there, and named; when nothing ends well the exit code is 4.
    """
    run_simulation("simulate uniaxial", options, "strips")


command.add_command(simulate_uniaxial, "strips")
command.add_command(simulate_bend)
