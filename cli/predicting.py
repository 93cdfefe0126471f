"""What the commands that predict share: options, progress, words for the terminal, exit code."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError, SolverFailure
from .arguments import (
    AS_JSON,
    JOBS,
    OVERWRITE,
    QUIET,
    SCHEDULER,
    Decorator,
    out_option,
    solver_choice,
    with_checks,
)
from .ending import tell, written_to
from .exits import WORSE, resumable
from .options import command_line, with_solver
from .progress import RunsProgress

if TYPE_CHECKING:
    from ..materials.card import MaterialCard
    from ..project.project import Project
    from ..runs.predictions import Predictions


def prediction_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of every series of predictions; the command gets them by name."""
    decorators: list[Decorator] = [
        out_option(),
        click.option(
            "--samples",
            type=click.IntRange(min=0),
            metavar="N",
            help="Spread by N laws drawn from the card's certainty; 0: none.  [few directions]",
        ),
        JOBS,
        SCHEDULER,
        solver_choice,
        click.option(
            "--fail-above",
            type=float,
            metavar="E",
            help="Exit 1 when an RMS error is above E of the largest measured load.",
        ),
        click.option("--resume", is_flag=True, help="Keep the runs that the output folder holds."),
        OVERWRITE,
        AS_JSON,
        QUIET,
    ]
    return with_checks(command, decorators)


def run_predictions(
    project: Project,
    folder: Path,
    options: Mapping[str, Any],
    tests: Sequence[str] | None = None,
    cards: Sequence[str] | Mapping[str, MaterialCard] | None = None,
) -> None:
    """Predict, write the folder, tell; exits as asked.

    Raises
    ------
    InputError, OutputError, SolverFailure : as `bubblefit.predict`; nothing was measured that
        --fail-above could be about.
    KeyboardInterrupt : after saying how to go on.
    """
    from ..runs.predictions import measured_tests, predict

    project = with_solver(project, options["solver_given"])
    if options["fail_above"] is not None and not measured_tests(project, tests):
        problem = "no test has measured loads to compare with; leave it out"
        raise InputError(project.path, "--fail-above", problem)
    quiet = options["quiet"] or options["as_json"]
    with resumable(folder), RunsProgress(quiet) as progress:
        predictions = predict(
            project,
            tests,
            cards,
            samples=options["samples"],
            jobs=options["jobs"],
            scheduler=options["scheduler"],
            out=folder,
            resume=options["resume"],
            overwrite=options["overwrite"],
            progress=progress.saw,
            command_line=command_line(),
        )
    predictions.report(folder)
    _end(predictions, folder, options["fail_above"], options["as_json"])


def _end(predictions: Predictions, folder: Path, fail_above: float | None, as_json: bool) -> None:
    """Print the outcome; exit 4 when a run failed, 1 when one is further from its measurement."""
    lines = [*predictions.lines(), written_to(folder)]
    tell(predictions.result, lines, as_json)
    failed = predictions.failed()
    if failed:
        run = predictions.each[failed[0]]
        words = f"{len(failed)} of {len(predictions.each)} runs failed ({run.title}: "
        words += f"{run.record.failure}); --resume tries again"
        click.echo(f"bubblefit: {words}", err=True)
    if fail_above is not None:
        _compare(predictions, fail_above)
    if failed:
        sys.exit(SolverFailure.exit_code)


def _compare(predictions: Predictions, fail_above: float) -> None:
    """Exit 1 when a run is further from its measurement than `fail_above`, or says nothing."""
    words, worst, silent = "", predictions.worst, predictions.silent()
    if worst is not None and worst > fail_above:
        words = f"an RMS error of {worst:.4g} of the largest load is above {fail_above:g}"
    elif silent:
        run = predictions.each[silent[0]]
        words = f"{run.title} gave nothing to compare"
    if words:
        click.echo(f"bubblefit: {words} (--fail-above)", err=True)
        sys.exit(WORSE)
