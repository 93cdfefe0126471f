"""Is the mesh, or are the increments, fine enough? Runs on finer and finer ones."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..experiments.base import Refined
from ..fits.analyses import Progress
from ..fits.project import Project
from ..materials.card import MaterialCard
from ..meshes.mesh import Mesh
from ..notes import Note, NoteKind, as_note
from ..notes import lines as note_lines
from ..solvers.run_cache import RunCache
from .series import (
    Part,
    Series,
    card_of,
    card_words,
    parts_of,
    studied_tests,
    thickness_notes,
    write_study,
)

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
Curve = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class Level:
    """One refinement of a part.

    factor : how much finer than the project's own. size : of what is refined, edge length (mm) or
    step (share of the whole load).
    """

    part: Part
    factor: float
    size: float

    @property
    def elements(self) -> int:
        """Quads of the mesh."""
        return len(self.part.model.mesh.quads)


@dataclass(frozen=True, eq=False)
class LevelRun:
    """What a level gave.

    values : quantities of interest by name, None where the run failed; curve : (x, y) of the
    response, where levels are compared along one; seconds : wall clock; failure : why there are
    no values; notes : what a reader of the values should know.
    """

    level: Level
    seconds: float
    iterations: int = 0
    values: Mapping[str, float] | None = None
    curve: Curve | None = None
    failure: str = ""
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True, eq=False)
class Refinement:
    """What a study of refinement gave: runs by part, coarse to fine.

    noise : relative accuracy of the solver's displacements and loads. warnings : on all
    of it, beside those of its runs.
    """

    project: Path
    card: str
    solver: str
    what: Refined
    runs: Mapping[str, Sequence[LevelRun]]
    noise: float
    warnings: tuple[Note, ...] = ()

    @property
    def result(self) -> dict[str, Any]:
        """What result.json says: cost and values of each level, orders and limits."""
        from .refinement_tables import numbers

        return numbers(self)

    def table(self) -> pd.DataFrame:
        """A row a part, level and quantity, with how far it is off the finest level's."""
        from .refinement_tables import table

        return table(self)

    def lines(self) -> list[str]:
        """The same for a terminal."""
        from .refinement_words import lines

        return [*lines(self.result), *note_lines(self.notes)]

    @property
    def notes(self) -> list[Note]:
        """What a reader of the values should know, of every level's own run."""
        notes = []
        for name, runs in self.runs.items():
            for run in runs:
                size = f"{run.level.elements} quads"
                if self.what == "increments":
                    size = f"{run.level.part.increments} increments"
                failed = [Note(NoteKind.FAILED, run.failure)] if run.failure else []
                notes += [n.about(f"{name}, {size}") for n in (*failed, *map(as_note, run.notes))]
        return [*notes, *self.warnings]

    def write(self, folder: Path | str) -> None:
        """Write convergence.csv, convergence.png, notes.csv and result.json.

        Raises
        ------
        OutputError : the folder cannot be written.
        """
        from ..reports import plot_convergence
        from ..reports.convergence_charts import convergence_charts
        from .refinement_tables import panels

        drawn, title = panels(self), f"{self.project.name}: finer and finer {self.what}"
        write_study(
            Path(folder),
            "convergence",
            self.table(),
            lambda path: plot_convergence(path, drawn, self.what),
            self.result,
            self.notes,
            title,
            self.lines(),
            [convergence_charts(drawn, self.what, title)],
        )


def refine(
    project: Project,
    card: MaterialCard | Path | str,
    tests: str | Sequence[str] | None = None,
    what: Refined = "elements",
    levels: int = 4,
    factor: int = 2,
    coarser: int | None = None,
    progress: Progress | None = None,
    kept: RunCache | None = None,
) -> Refinement:
    """Run tests with a card on finer and finer meshes, or with more and more increments.

    Parameters
    ----------
    card : itself, its file, or its name in the project. tests : names or kinds, all unless given.
    what : "elements" or "increments" is refined. levels : how many there are.
    factor : edges, or increments, are divided by it from one level to the next.
    coarser : levels coarser than the project's own; 1 of elements and 0 of increments unless given.
    progress : is told how far the study is.
    kept : where each analysis is kept as it ends, so that an interrupted study can be gone on with.

    Raises
    ------
    InputError : a level that cannot be had, or is the same as another.
    SolverFailure : nothing can be compared, because fewer than two levels ended well anywhere.
    """
    below = (1 if what == "elements" else 0) if coarser is None else coarser
    if below >= levels:
        raise InputError(None, "--coarser", f"expected fewer than the {levels} levels, got {below}")
    material = card_of(project, card)
    series = Series(project, material, progress, kept)
    factors = [float(factor) ** (k - below) for k in range(levels)]
    chosen = studied_tests(project, tests)
    # All before the first run: a level that cannot be meshed is a mistake in the options.
    planned = [_levels(project, chosen, material.thickness, what, f) for f in factors]
    names = list(planned[0])
    for name in names:
        _distinct(project, [p[name].size for p in planned])
    series.total = levels * len(names)
    runs = {name: _runs(series, [p[name] for p in planned]) for name in names}
    if all(len(ended(several)) < 2 for several in runs.values()):
        reason = next(r.failure for several in runs.values() for r in several if r.failure)
        raise SolverFailure(f"fewer than two levels ended well: {reason}", series.solver.name)
    return Refinement(
        project.path,
        card_words(card),
        series.solver.name,
        what,
        runs,
        # Result files of other programs have 6 digits.
        1e-5 if series.solver.external else 1e-7,
        tuple(thickness_notes(project, material)),
    )


def ended(runs: Sequence[LevelRun]) -> list[LevelRun]:
    """Levels that have values, coarse to fine."""
    return [run for run in runs if run.values is not None]


def run_level(series: Series, level: Level) -> LevelRun:
    """Run one level; an analysis that does not end well is a level without values."""
    part, begun = level.part, time.perf_counter()
    try:
        history = series.run(part, series.card.law)
    except SolverFailure as failure:
        return LevelRun(level, time.perf_counter() - begun, failure=failure.reason)
    # Without the keeping, and of a run that was kept earlier what it took then.
    seconds = time.perf_counter() - begun if history.seconds is None else history.seconds
    studied = part.studied
    values = studied.quantities(part.model, history)
    along = None if studied.curve is None else studied.curve(part.model, history)
    notes = tuple(series.notes(history))
    return LevelRun(level, seconds, history.iterations, values, along, notes=notes)


def edge_length(mesh: Mesh) -> float:
    """Edge (mm) of a square of the mean area of the quads, from their plane reference state."""
    a, b, c, d = (mesh.points[mesh.quads[:, i]] for i in range(4))
    area = 0.5 * np.linalg.norm(np.cross(c - a, d - b), axis=1)
    return float(np.sqrt(area.mean()))


def rms_between(coarse: Curve, fine: Curve) -> float:
    """Root mean square of the difference of two curves (x, y), at the places of the coarse one.

    The fine one is interpolated linearly where it has no point there; both start at the origin.
    Where it stopped early they are compared up to there.
    """
    (x, y), (fx, fy) = coarse, fine
    both = x <= fx[-1] * (1 + 1e-9)
    x, y = x[both], y[both]
    there = np.interp(x, np.append(0.0, fx), np.append(0.0, fy))
    return float(np.sqrt(np.mean((y - there) ** 2)))


def _levels(
    project: Project, tests: Sequence[Any], thickness: float, what: Refined, factor: float
) -> dict[str, Level]:
    return {
        name: Level(
            part,
            factor,
            edge_length(part.model.mesh) if what == "elements" else 1.0 / part.increments,
        )
        for name, part in parts_of(project, tests, thickness, what, factor).items()
    }


def _runs(series: Series, levels: Sequence[Level]) -> list[LevelRun]:
    if not series.solver.external:
        # In-process solvers compile on first use: once, untimed.
        with suppress(SolverFailure):
            series.solver.run(levels[0].part.model, series.card.law)
    return [run_level(series, level) for level in levels]


def _distinct(project: Project, sizes: Sequence[float]) -> None:
    for coarse, fine in pairwise(sizes):
        if not fine < coarse * (1 - 1e-9):
            problem = "two levels come out the same: nothing is left to coarsen; use fewer"
            raise InputError(project.path, "--coarser", problem)
