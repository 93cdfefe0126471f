"""What the commands that fit share: options, progress, words for the terminal, the exit code."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError
from ..inference.methods import method_names
from .arguments import (
    AS_JSON,
    DATA,
    JOBS,
    OVERWRITE,
    PATH,
    PROJECT,
    QUIET,
    SCHEDULER,
    TESTS,
    TRUST,
    Decorator,
    out_option,
    solver_choice,
    with_checks,
)
from .ending import tell
from .exits import WORSE, resumable
from .fit_words import lines_of
from .logs import verbose
from .options import command_line, data_folders, read_with_solver
from .progress import StudyProgress

if TYPE_CHECKING:
    from ..project.project import Project
    from ..runs.result import Fit


def fit_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """PROJECT and the options of every fit; the command gets them by name, errors are handled."""
    decorators: list[Decorator] = [
        PROJECT,
        TESTS,
        out_option(),
        DATA,
        click.option("--starts", type=click.IntRange(min=1), help="Random feasible starts."),
        click.option("--seed", type=click.IntRange(min=0), help="Seed of the starts."),
        click.option(
            "--starts-from",
            type=click.Choice(["random", "sobol", "proposed"]),
            help="Where starts begin: drawn, spread evenly, or by an earlier fit.",
        ),
        click.option("--earlier", type=PATH, metavar="DIR", help="That fit's output folder."),
        JOBS,
        SCHEDULER,
        click.option(
            "--method", metavar="NAME", help="Optimiser: " + ", ".join(method_names()) + "."
        ),
        solver_choice,
        click.option(
            "--fail-above",
            type=float,
            metavar="E",
            help="Exit 1 when more than E is left of the objective.",
        ),
        TRUST,
        click.option("--resume", is_flag=True, help="Go on with an interrupted fit."),
        OVERWRITE,
        AS_JSON,
        QUIET,
    ]
    return with_checks(command, decorators)


def settings_given(project: Project, options: Mapping[str, Any]) -> Project:
    """The project with what the command line says of starts, and of who runs them."""
    names = ("seed", "method", "jobs", "starts_from")
    given = {name: options[name] for name in names}
    earlier: Path | None = options["earlier"]
    given["earlier"] = None if earlier is None else str(earlier.absolute())
    return project.with_fit(**given).with_scheduler(options["scheduler"])


def run_fit(options: dict[str, Any], kind: str | None = None) -> None:
    """Read the project, fit the chosen tests (of a kind), write the folder, tell; exits as asked.

    Raises
    ------
    InputError, OutputError, NoFeasibleStart, SolverFailure : as `bubblefit.fit`.
    KeyboardInterrupt : after saying how to go on.
    """
    from ..project.cards import usual_folder
    from ..runs.fit import fit
    from ..runs.starts import timed

    path: Path = options["project"]
    project = read_with_solver(path, options["solver_given"], data_folders(options["data"]))
    project = settings_given(project, options)
    folder: Path = options["out"] or usual_folder(path)
    quiet = options["quiet"] or options["as_json"]
    starts = options["starts"] or project.fit.starts
    with resumable(folder), StudyProgress(starts, quiet) as progress:
        result = fit(
            project,
            _tests(options["tests"], kind, project.tests, path),
            starts=options["starts"],
            trust=options["trust"],
            out=folder,
            resume=options["resume"],
            overwrite=options["overwrite"],
            progress=progress.saw,
            command_line=command_line(),
        )
    with timed(f"card, tables and figures in {folder}"):
        result.report(folder)
    _end(result, folder, options["fail_above"], options["as_json"])


def _tests(
    names: Sequence[str], kind: str | None, tests: Any, path: Path
) -> Sequence[str] | str | None:
    """The tests that a command fits: those named, else those of its kind, else all."""
    for name in names:
        if kind is not None and name in tests and tests[name].kind != kind:
            problem = f"{name!r} is no test of this command's kind; use `bubblefit fit`"
            raise InputError(path, "--test", problem)
    return names or kind


def _end(fit: Fit, folder: Path, fail_above: float | None, as_json: bool) -> None:
    """Print the outcome; exit 1 when the best fit is worse than asked for."""
    tell(fit.result, lines_of(fit, folder, every=verbose()), as_json)
    if fail_above is not None and fit.objective > fail_above:
        said = f"{fit.objective:.4g} is left of the objective, above {fail_above:g}"
        click.echo(f"bubblefit: --fail-above: {said}", err=True)
        sys.exit(WORSE)
