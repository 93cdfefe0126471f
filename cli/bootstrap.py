"""`bubblefit bootstrap PROJECT.toml`: how far do the moduli scatter if others had been tested?"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .arguments import (
    AS_JSON,
    CARD_OF_FIT,
    DATA,
    JOBS,
    OVERWRITE,
    PROJECT,
    QUIET,
    SCHEDULER,
    TESTS,
    Decorator,
    out_option,
    solver_choice,
    with_options,
)
from .ending import tell, written_to
from .examples import examples
from .exits import exits, resumable
from .options import folder_beside, read_to_refit
from .progress import NamedProgress


def _options(command: Any) -> Any:
    decorators: list[Decorator] = [
        PROJECT,
        click.option(
            "--over", required=True, metavar="SORT",
            help="What is drawn: frames, specimens, tests, directions or ratios.",
        ),
        click.option(
            "--samples", type=click.IntRange(min=2), default=100, show_default=True,
            help="How often.",
        ),
        click.option("--seed", type=click.IntRange(min=0), help="Of the draws [the project's]."),
        CARD_OF_FIT,
        TESTS,
        out_option("out/NAME-bootstrap"),
        DATA,
        solver_choice,
        JOBS,
        SCHEDULER,
        click.option("--resume", is_flag=True, help="Go on with what the output folder holds."),
        OVERWRITE,
        AS_JSON,
        QUIET,
    ]  # fmt: skip
    return with_options(exits(command), decorators)


@click.command(
    "bootstrap",
    epilog=examples(
        "bubblefit bootstrap fabric.toml --over frames",
        "bubblefit bootstrap fabric.toml --over specimens --samples 400 --jobs 4",
        "bubblefit bootstrap fabric.toml --over tests --resume",
    ),
)
@_options
def command(over: str, samples: int, seed: int | None, card: str | None, **options: Any) -> None:
    """How far do the moduli scatter if the data are drawn again?

    Draws frames, specimens or tests of PROJECT.toml with replacement and fits them from the fit's
    optimum, a hundred times. Writes percentile bands of the moduli beside those of the fit:
    bootstrap.csv, coefficients.csv, bootstrap.png, report.html and result.json.
    """
    from ..runs.bootstrap import bootstrap

    path: Path = options["project"]
    project = read_to_refit(path, options)
    folder: Path = options["out"] or folder_beside(path, "bootstrap")
    quiet = options["quiet"] or options["as_json"]
    with resumable(folder), NamedProgress("samples", quiet) as progress:
        done = bootstrap(
            project, over, samples, card, options["tests"] or None, seed=seed, out=folder,
            resume=options["resume"], overwrite=options["overwrite"], progress=progress.saw,
        )  # fmt: skip
    done.write(folder)
    tell(done.result, [*done.lines(), written_to(folder)], options["as_json"])
