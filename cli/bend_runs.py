"""What `bend` and `simulate bend` share: options, the runs with their progress, the exit code."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from ..errors import InputError, SolverFailure
from ..projects.bend import BendProject
from ..runs.bend_folder import BendFolder
from ..runs.bend_run import BendRun
from ..runs.folder import RESULT
from ..studies.bend_page import report_bend
from ..studies.bend_results import BendOutcome, bend_result, outcome_of
from ..studies.bend_setup import KEY, Pair, pairs_of, run_pairs
from ..studies.bend_tables import write_bend_tables
from ..studies.setup import project_solver
from ..writing import replacing
from .bend_words import bend_lines
from .fitting import WORSE
from .options import cores, solver_choice, with_checks
from .progress import RunsProgress


def bend_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of every study of bending; the command gets them by name."""
    decorators: list[Callable[..., Any]] = [
        click.option("--out", type=click.Path(path_type=Path), help="Output folder [out/NAME]."),
        click.option("--jobs", type=click.IntRange(min=1), help="Processes [all cores]."),
        solver_choice,
        click.option(
            "--fail-above", type=float, metavar="E",
            help="Exit 1 when an RMS error is above E of the largest measured load.",
        ),
        click.option("--resume", is_flag=True, help="Keep the runs that the output folder holds."),
        click.option("--overwrite", is_flag=True, help="Replace what the output folder holds."),
        click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout."),
        click.option("--quiet", is_flag=True, help="No progress."),
    ]  # fmt: skip

    return with_checks(command, decorators)


def run_bend_study(name: str, project: BendProject, out: Path, options: dict[str, Any]) -> None:
    """Run (or go on with) every pair of case and card, write all, tell; exits as asked.

    Raises
    ------
    SolverFailure : no run ended well. InputError : nothing to compare for --fail-above.
    """
    begun = time.perf_counter()
    above = options["fail_above"]
    if above is not None and not any(case.measured for case in project.cases):
        problem = "no case has measured loads to compare with; leave it out"
        raise InputError(project.path, "--fail-above", problem)
    pairs = pairs_of(project)
    solver = project_solver(project, KEY)  # what is wrong with it shows here, in one line
    folder = BendFolder(out)
    folder.begin(options["resume"], options["overwrite"])
    marks = [pair.mark(project, solver) for pair in pairs]
    runs = _runs(project, pairs, marks, folder, options)
    outcome = outcome_of(project, pairs, runs)
    if not outcome.measures:
        raise SolverFailure(f"no run ended well: {runs[0].failed}", project.solver)
    result = bend_result(name, project, outcome, time.perf_counter() - begun)
    write_bend_tables(project, outcome, out)
    report_bend(project, outcome, result, out)
    text = json.dumps(result, indent=1, allow_nan=False)
    # Last: where it is, the output is complete.
    with replacing(out / RESULT) as path:
        path.write_text(text + "\n", encoding="utf-8")
    lines = [*bend_lines(result), f"written to {out} (open report.html)"]
    click.echo(text if options["as_json"] else "\n".join(lines))
    _judge(outcome, above)


def _runs(
    project: BendProject,
    pairs: list[Pair],
    marks: list[str],
    folder: BendFolder,
    options: dict[str, Any],
) -> list[BendRun]:
    """Every pair's run: those that the folder holds, and the others side by side."""
    found = {i: run for i, mark in enumerate(marks) if (run := folder.kept(mark)) is not None}
    missing = [i for i in range(len(pairs)) if i not in found]
    jobs = options["jobs"] or project.jobs or cores()
    quiet = options["quiet"] or options["as_json"]
    try:
        with RunsProgress(len(pairs), len(found), quiet) as progress:
            for ended in run_pairs(project, pairs, missing, jobs) if missing else ():
                if ended is None:
                    progress.saw(None)
                    continue
                number, run = ended
                folder.keep(marks[number], run)
                found[number] = run
                progress.saw(_words(pairs[number], run))
    except KeyboardInterrupt:
        click.echo(f"interrupted; go on with --resume (kept in {folder.path})", err=True)
        raise
    return [found[i] for i in range(len(pairs))]


def _words(pair: Pair, run: BendRun) -> str:
    how = f"failed ({run.failed})" if run.failed else f"{run.deflection[-1]:g} mm"
    return f"{pair.case.name} with {pair.name}: {how} in {run.seconds:.0f} s"


def _judge(outcome: BendOutcome, above: float | None) -> None:
    """Exit 1 when a run is further from what was measured than asked for, or says nothing of it."""
    if above is None:
        return
    compared = [i for i, pair in enumerate(outcome.pairs) if pair.case.measured]
    silent = [i for i in compared if i not in outcome.measures or not outcome.measures[i].error]
    worst = outcome.worst
    words = ""
    if worst is not None and worst > above:
        words = f"an RMS error of {worst:.4g} of the largest load is above {above:g}"
    elif silent:
        pair = outcome.pairs[silent[0]]
        words = f"{pair.case.name} with {pair.name} gave nothing to compare"
    if words:
        click.echo(f"bubblefit: {words} (--fail-above)", err=True)
        sys.exit(WORSE)
