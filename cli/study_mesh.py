"""`bubblefit study mesh`: is the mesh, or are the increments, fine enough?"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import click

from ..errors import InputError, SolverFailure
from ..reports import plot_convergence
from ..studies.refinement import LevelRun, run_level, warm_up
from .progress import run_progress
from .study_convergence import HEADER, panels, result_of, rows
from .study_kinds import What, levels
from .study_options import Study, card_options, finish
from .study_words import convergence_lines


@click.command("mesh")
@card_options
@click.option(
    "--what",
    type=click.Choice(["elements", "increments"]),
    default="elements",
    show_default=True,
    help="What is refined.",
)
@click.option(
    "--levels", "count", type=click.IntRange(2, 8), default=4, show_default=True,
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
def study_mesh(
    open_study: Callable[[str], Study],
    what: What,
    count: int,
    factor: int,
    coarser: int | None,
    as_json: bool,
) -> None:
    """Run PROJECT.toml with a card on finer and finer meshes (or increments).

    Reports the quantities of interest and the cost of each level, the observed order of
    convergence and Richardson's limit. A level whose analysis fails is named and left out; when
    fewer than two end well the exit code is 4.
    """
    below = (1 if what == "elements" else 0) if coarser is None else coarser
    if below >= count:
        problem = f"expected fewer than the {count} levels, got {below}"
        raise InputError(None, "--coarser", problem)
    study = open_study(what if what == "increments" else "mesh")
    factors = [float(factor) ** (k - below) for k in range(count)]
    runs = _run(study, what, factors, as_json)
    result = result_of(study, what, runs)
    finish(
        study,
        "convergence",
        HEADER,
        rows(runs, what),
        lambda path: plot_convergence(path, panels(runs), what),
        result,
        convergence_lines(result),
        as_json,
    )


def _run(study: Study, what: What, factors: list[float], quiet: bool) -> dict[str, list[LevelRun]]:
    """Every level of every model, coarse to fine.

    Raises
    ------
    SolverFailure : nothing can be compared, because fewer than two levels ended well everywhere.
    """
    # All before the first run: a level that cannot be meshed is a mistake in the options.
    planned = [levels(study.kind, study.project, what, f, study.card.thickness) for f in factors]
    law, kind = study.card.law, study.kind
    runs: dict[str, list[LevelRun]] = {name: [] for name in planned[0]}
    for name in runs:
        _distinct(study, [p[name].size for p in planned])
        warm_up(study.solver, planned[0][name].model, law)
        for level in (p[name] for p in planned):
            with run_progress(study.solver, level.increments, quiet):
                run = run_level(study.solver, level, law, kind.quantities, kind.curve, study.notes)
            runs[name].append(run)
    if all(sum(r.values is not None for r in several) < 2 for several in runs.values()):
        reason = next(r.failure for several in runs.values() for r in several if r.failure)
        raise SolverFailure(f"fewer than two levels ended well: {reason}", study.solver.name)
    return runs


def _distinct(study: Study, sizes: list[float]) -> None:
    for coarse, fine in pairwise(sizes):
        if not fine < coarse * (1 - 1e-9):
            problem = "two levels come out the same: nothing is left to coarsen; use fewer"
            raise InputError(study.project.path, "--coarser", problem)
