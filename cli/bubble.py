"""`bubblefit bubble PROJECT.toml`: fit a material to a bubble inflation test."""

from __future__ import annotations

import functools
import json
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ..errors import InputError, NoFeasibleStart
from ..experiments.fields import DisplacementField
from ..identification.methods import METHODS, FitOptions
from ..runs.folder import OutputFolder
from ..runs.processes import run_starts
from ..runs.start import StartRecord
from .bubble_figures import report
from .bubble_results import assess, summary, write_numbers, write_result
from .bubble_setup import bubble_problem, bubble_setup
from .fingerprint import fingerprint
from .options import cores, default_folder, exits, solver_choice, with_solver
from .progress import StudyProgress
from .project import BubbleProject, read_project

WORSE = 1  # exit code of --fail-above


@click.command("bubble")
@click.argument("project", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help="Output folder [out/NAME].")
@click.option("--data", type=click.Path(path_type=Path), help="Folder of the measured data.")
@click.option("--starts", type=click.IntRange(min=1), help="Random feasible starts.")
@click.option("--seed", type=click.IntRange(min=0), help="Seed of the starts.")
@click.option("--jobs", type=click.IntRange(min=1), help="Processes [all cores].")
@click.option("--method", type=click.Choice(METHODS), help="Optimiser.")
@solver_choice
@click.option("--fail-above", type=float, metavar="E", help="Exit 1 when e is above E.")
@click.option("--resume", is_flag=True, help="Go on with an interrupted study.")
@click.option("--overwrite", is_flag=True, help="Replace what the output folder holds.")
@click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout.")
@click.option("--quiet", is_flag=True, help="No progress.")
@exits
def command(
    project: Path,
    out: Path | None,
    data: Path | None,
    starts: int | None,
    seed: int | None,
    jobs: int | None,
    method: str | None,
    solver_given: dict[str, Any],
    fail_above: float | None,
    resume: bool,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Fit the moduli of PROJECT.toml to its bubble inflation test, from many starts.

    Writes result.json, material.toml, history.csv, surfaces.csv, figures, report.html and
    bubble.vtu into the output folder.
    """
    begun = time.perf_counter()
    if resume and overwrite:
        raise InputError(None, "--resume, --overwrite", "give one of them, not both")
    if fail_above is not None and not fail_above >= 0:
        raise InputError(None, "--fail-above", f"expected 0 or more, got {fail_above:g}")
    settings = _with_options(
        with_solver(read_project(project, data), solver_given), starts, seed, method
    )
    setup = bubble_setup(settings)
    folder = OutputFolder(
        out or default_folder(project), settings.modulus_unit, settings.modulus_scale
    )
    columns = [f"beta_{i}" for i in settings.free] + list(setup.problem.parameters.nuisance)
    done = folder.begin(fingerprint(settings, setup), columns, resume, overwrite)
    try:
        records = _study(settings, setup.fields, folder, done, jobs or cores(), quiet or as_json)
    except KeyboardInterrupt:
        folder.close()
        click.echo(f"interrupted; go on with --resume (kept in {folder.path})", err=True)
        raise
    finally:
        folder.close()
    folder.finish()
    ranked = sorted(
        (r for r in records if r.objective is not None), key=lambda r: (r.objective, r.number)
    )
    if not ranked:
        raise NoFeasibleStart(f"{project}: no feasible start: {records[0].status}")
    assessment = assess(settings, setup, records, ranked, time.perf_counter() - begun)
    write_numbers(settings, setup, assessment, folder)
    report(settings, setup, assessment, folder)
    write_result(assessment, folder)
    if as_json:
        click.echo(json.dumps(assessment.result, indent=1))
    else:
        click.echo(summary(assessment, folder.path))
    best = ranked[0].objective
    if fail_above is not None and best is not None and best > fail_above:
        click.echo(f"bubblefit: e = {best:.4g} is above --fail-above {fail_above:g}", err=True)
        sys.exit(WORSE)


def _with_options(
    project: BubbleProject,
    starts: int | None,
    seed: int | None,
    method: str | None,
) -> BubbleProject:
    given: dict[str, Any] = {"starts": starts, "seed": seed, "method": method}
    return replace(project, **{k: v for k, v in given.items() if v is not None})


def _study(
    project: BubbleProject,
    fields: tuple[DisplacementField, ...],
    folder: OutputFolder,
    done: dict[int, StartRecord],
    jobs: int,
    quiet: bool,
) -> list[StartRecord]:
    options = FitOptions(
        project.method,
        project.gradient,
        project.constraints,
        project.tolerance,
        project.max_analyses,
    )
    finished = {n: r for n, r in done.items() if n < project.starts}
    missing = [n for n in range(project.starts) if n not in finished]
    build = functools.partial(bubble_problem, project, fields)
    known = [r.objective for r in finished.values() if r.objective is not None]
    best = min(known, default=None)
    with StudyProgress(project.starts, len(finished), quiet, best) as progress:
        for record in run_starts(build, options, project.seed, missing, jobs):
            if record is not None:
                folder.add(record)
            if isinstance(record, StartRecord):
                finished[record.number] = record
            progress.saw(record)
    return [finished[n] for n in sorted(finished)]
