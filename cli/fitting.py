"""What the commands that fit share: their options, the starts, the exit code."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import click

from ..errors import NoFeasibleStart
from ..identification.methods import METHODS, FitOptions
from ..identification.problem import FitProblem
from ..projects.fit import FitProject
from ..runs.folder import OutputFolder
from ..runs.processes import run_starts
from ..runs.start import StartRecord
from .options import cores, default_folder, solver_choice, with_checks, with_solver
from .progress import StudyProgress

WORSE = 1  # exit code of --fail-above
Project = TypeVar("Project", bound=FitProject)


def study_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """PROJECT and the options of every fit; the command gets them by name, errors are handled."""
    path = click.Path(path_type=Path)
    decorators: list[Callable[..., Any]] = [
        click.argument("project", type=path),
        click.option("--out", type=path, help="Output folder [out/NAME]."),
        click.option("--data", type=path, help="Folder of the measured data."),
        click.option("--starts", type=click.IntRange(min=1), help="Random feasible starts."),
        click.option("--seed", type=click.IntRange(min=0), help="Seed of the starts."),
        click.option("--jobs", type=click.IntRange(min=1), help="Processes [all cores]."),
        click.option("--method", type=click.Choice(METHODS), help="Optimiser."),
        solver_choice,
        click.option("--fail-above", type=float, metavar="E", help="Exit 1 when e is above E."),
        click.option("--resume", is_flag=True, help="Go on with an interrupted study."),
        click.option("--overwrite", is_flag=True, help="Replace what the output folder holds."),
        click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout."),
        click.option("--quiet", is_flag=True, help="No progress."),
    ]

    return with_checks(command, decorators)


def with_options(project: Project, options: dict[str, Any]) -> Project:
    """The project with the options of the command line in the place of its own settings."""
    given = {k: options[k] for k in ("starts", "seed", "method") if options[k] is not None}
    return replace(with_solver(project, options["solver_given"]), **given)


def run_study(
    project: FitProject,
    problem: FitProblem,
    build: Callable[[], FitProblem],
    fingerprint: str,
    options: dict[str, Any],
) -> tuple[OutputFolder, list[StartRecord]]:
    """Run (or go on with) every start; the output folder then holds all of them.

    Raises
    ------
    NoFeasibleStart : of all starts. KeyboardInterrupt : after saying how to go on.
    """
    folder = OutputFolder(
        options["out"] or default_folder(options["project"]),
        project.modulus_unit,
        project.modulus_scale,
    )
    columns = [f"beta_{i}" for i in project.free] + list(problem.parameters.nuisance)
    done = folder.begin(fingerprint, columns, options["resume"], options["overwrite"])
    quiet = options["quiet"] or options["as_json"]
    try:
        records = _starts(project, build, folder, done, options["jobs"] or cores(), quiet)
    except KeyboardInterrupt:
        folder.close()
        click.echo(f"interrupted; go on with --resume (kept in {folder.path})", err=True)
        raise
    finally:
        folder.close()
    folder.finish()
    if all(r.objective is None for r in records):
        raise NoFeasibleStart(f"{options['project']}: no feasible start: {records[0].status}")
    return folder, records


def tell(result: dict[str, Any], summary: str, fail_above: float | None, as_json: bool) -> None:
    """Print the outcome; exit 1 when the best fit is worse than asked for."""
    click.echo(json.dumps(result, indent=1) if as_json else summary)
    best = result["objective"]
    if fail_above is not None and best > fail_above:
        click.echo(f"bubblefit: e = {best:.4g} is above --fail-above {fail_above:g}", err=True)
        sys.exit(WORSE)


def _starts(
    project: FitProject,
    build: Callable[[], FitProblem],
    folder: OutputFolder,
    done: dict[int, StartRecord],
    jobs: int,
    quiet: bool,
) -> list[StartRecord]:
    finished = {n: r for n, r in done.items() if n < project.starts}
    missing = [n for n in range(project.starts) if n not in finished]
    known = [r.objective for r in finished.values() if r.objective is not None]
    best = min(known, default=None)
    with StudyProgress(project.starts, len(finished), quiet, best) as progress:
        for record in run_starts(build, fit_options(project), project.seed, missing, jobs):
            if record is not None:
                folder.add(record)
            if isinstance(record, StartRecord):
                finished[record.number] = record
            progress.saw(record)
    return [finished[n] for n in sorted(finished)]


def fit_options(project: FitProject) -> FitOptions:
    """How each start of a project is fitted."""
    return FitOptions(
        project.method,
        project.gradient,
        project.constraints,
        project.tolerance,
        project.max_analyses,
    )
