"""One start of a fit, from its number to its optimum; its records, running files and log."""

from __future__ import annotations

import csv
import errno
import io
import json
import logging
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from io import FileIO
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from ..errors import InputError, NoFeasibleStart
from ..experiments.run_records import RunRecord
from ..experiments.strains import strains_of
from ..inference.methods import FitOptions
from ..inference.problem import FitProblem
from ..inference.search import feasible_start, fit_from
from ..storage.writing import output_errors, write_text
from .folder import Store

#: Mesh of a record: that of the project, or the coarse one that leads to it.
MeshName = Literal["full", "coarse"]


@dataclass(frozen=True)
class Stage:
    """The begin of a stage of a fit: what is counted in it, and how many."""

    what: str
    total: int


@dataclass(frozen=True)
class EvaluationRecord:
    """One analysis by `solver`, a row of history.csv; objective : None if it failed."""

    start: int
    analysis: int
    objective: float | None
    status: str
    coefficients: tuple[float, ...]
    nuisance: tuple[float, ...]
    solver: str = "membrane"
    mesh: MeshName = "full"


@dataclass(frozen=True)
class StartRecord:
    """The end of one start; unknowns : of the optimiser. objective : None without a fit.
    analyses : in all, of them external_runs by an external solver and cached_runs by one earlier.
    failure : of the solver, if that ended the start, which is run again on resuming. reached :
    (eps1, eps2, gamma12) at the optimum. mesh : of the objective. same_as : the start with the same
    optimum on the coarse mesh, which alone was fitted on the full one."""

    number: int
    seed: tuple[int, int]
    objective: float | None
    status: str
    analyses: int
    unknowns: tuple[float, ...]
    coefficients: tuple[float, ...]
    wall_s: float
    external_runs: int = 0
    failure: str = ""
    reached: tuple[float, ...] = ()
    mesh: MeshName = "full"
    coarse_objective: float | None = None
    coarse_analyses: int = 0
    same_as: int | None = None
    cached_runs: int = 0

    @property
    def text(self) -> str:
        """Return the record as a line of JSON, every number in full."""
        return json.dumps(asdict(self)) + "\n"

    @classmethod
    def read(cls, text: str) -> StartRecord:
        """Return the record of a line; raises ValueError if it is none."""
        return TypeAdapter(cls).validate_json(text)


Event = EvaluationRecord | StartRecord


def run_start(
    problem: FitProblem,
    options: FitOptions,
    seed: int,
    number: int,
    tell: Callable[[EvaluationRecord], None],
    mesh: MeshName = "full",
    coarse: StartRecord | None = None,
) -> StartRecord:
    """Draw feasible start `number` of `seed` and fit from it; report every evaluation to `tell`.
    coarse : its end on the coarse mesh, at whose optimum the fit begins; its analyses are included.
    """
    begun = time.perf_counter()
    problem.reset()
    size = problem.unknowns.size
    runs = 0
    before = analyses = 0 if coarse is None else coarse.analyses

    def watch(y: NDArray, value: float | None, status: str, solver: str) -> None:
        nonlocal analyses, runs
        analyses += 1
        runs += problem.solver.external and solver == problem.solver.name
        coefficients = tuple((problem.unknowns.to_coefficients @ y[:size]).tolist())
        nuisance = tuple(np.asarray(y[size:]).tolist())
        own = number, analyses, value, status, coefficients, nuisance
        tell(EvaluationRecord(*own, solver, mesh))

    watched = [p for p in (problem, problem.surrogate) if p is not None]
    for p in watched:
        p.watch = watch
    try:
        if coarse is not None and coarse.objective is not None:
            optimum = fit_from(problem, np.array(coarse.unknowns), options, True)
        else:
            optimum = fit_from(problem, feasible_start(problem, seed, number), options, False)
        # Of the project's solver, else of the one that leads it.
        failure = next((p.failure for p in watched if p.failure), "the first analysis failed")
        failure = failure if optimum is None else optimum.failure
        status = f"{problem.solver.name} failed: {failure}"
    except NoFeasibleStart as error:
        optimum = None
        status = str(error)
        failure = ""
    finally:
        for p in watched:
            p.watch = None
    cached = problem.cached if problem.solver.external else 0
    wall = time.perf_counter() - begun + (0.0 if coarse is None else coarse.wall_s)
    none = StartRecord(
        number,
        (seed, number),
        None,
        status,
        analyses,
        (),
        (),
        wall,
        runs - cached,
        failure,
        mesh=mesh,
        coarse_objective=None if coarse is None else coarse.objective,
        coarse_analyses=before,
        cached_runs=cached,
    )
    if optimum is None:
        return none
    reached = np.max([strains_of(h) for h in optimum.best.histories], axis=0)
    return replace(
        none,
        objective=optimum.value,
        status=optimum.status,
        reached=tuple(reached.tolist()),
        unknowns=tuple(optimum.best.unknowns.tolist()),
        coefficients=tuple(optimum.coefficients.tolist()),
    )


STARTS, HISTORY = "starts.jsonl", "history.csv"
#: First columns of every history.
HEADER = ("start", "analysis", "solver", "mesh", "objective", "status")
MESH = HEADER.index("mesh")


class RunningFiles:
    """The running files of a fit; columns : of the unknowns, after `HEADER`. scale : divisors."""

    def __init__(self, store: Store, columns: Sequence[str], scale: Sequence[float]) -> None:
        self.store, self.columns, self.scale = store, tuple(columns), tuple(scale)
        self._rows: FileIO | None = None
        self._starts: FileIO | None = None

    def begin(self, resume: bool) -> list[StartRecord]:
        """Open the files; return the finished starts, on either mesh, if resumed; InputError."""
        done = self.finished() if resume else []
        ended = {(str(record.number), record.mesh) for record in done}
        rows = [r for r in self._read() if (r[0], r[MESH]) in ended] if resume else []
        write_text(self.store.path / STARTS, "".join(record.text for record in done))
        write_text(self.store.path / HISTORY, _table([[*HEADER, *self.columns], *rows]))
        with output_errors(self.store.path):
            # Unbuffered: a row is the system's as soon as it is written, and closing cannot fail.
            self._starts = open(self.store.path / STARTS, "ab", buffering=0)
            self._rows = open(self.store.path / HISTORY, "ab", buffering=0)
        return done

    def add(self, record: Event) -> None:
        """Append to history.csv or starts.jsonl at once; raises OutputError."""
        assert self._rows is not None and self._starts is not None
        with output_errors(self.store.path):
            if isinstance(record, StartRecord):
                _append(self._starts, record.text)
                os.fsync(self._starts.fileno())
                return
            values = (*record.coefficients, *record.nuisance)
            numbers = [repr(v / s) for v, s in zip(values, self.scale, strict=True)]
            value = "" if record.objective is None else repr(record.objective)
            said = record.start, record.analysis, record.solver, record.mesh, value, record.status
            _append(self._rows, _table([[*said, *numbers]]))

    def __enter__(self) -> RunningFiles:
        return self

    def __exit__(self, failed: type[BaseException] | None, *_: object) -> None:
        self.close() if failed else self.finish()

    def finish(self) -> None:
        """Close the files and sort history.csv; of a start that began again the last rows count."""
        self.close()
        rows = self._read()
        last = {(int(row[0]), int(row[1])): row for row in rows[1:]}
        body = [last[number] for number in sorted(last)]
        write_text(self.store.path / HISTORY, _table([rows[0], *body]))

    def close(self) -> None:
        for stream in (self._rows, self._starts):
            if stream is not None:
                stream.close()
        self._rows = self._starts = None

    def finished(self) -> list[StartRecord]:
        """Return the starts of starts.jsonl that did not fail; raises InputError if damaged."""
        path = self.store.path / STARTS
        done: dict[tuple[int, str], StartRecord] = {}
        # A crash can leave bytes that are no text where the last line should be.
        text = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
        lines = text.splitlines()
        for i, line in enumerate(lines):
            try:
                record = StartRecord.read(line)
            except ValueError:
                if i == len(lines) - 1:
                    break  # cut off by a kill: that start is run again
                problem = "is damaged; use --overwrite"
                raise InputError(path, f"line {i + 1}", problem) from None
            done[record.number, record.mesh] = record
        return [record for record in done.values() if not record.failure]

    def _read(self) -> list[list[str]]:
        path = self.store.path / HISTORY
        text = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
        whole = text[: text.rfind("\n") + 1]  # a last line without its end was cut off
        return [row for row in csv.reader(io.StringIO(whole)) if len(row) > MESH]


def _append(stream: FileIO, text: str) -> None:
    content = text.encode()
    if stream.write(content) != len(content):
        # The rest would not fit; a last line without its end is left out when it is read.
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _table(rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


log = logging.getLogger(__name__)


def log_record(record: Event | None) -> None:
    """Log an analysis or the end of a start; nothing for None."""
    if isinstance(record, EvaluationRecord):
        left = "failed" if record.objective is None else f"objective {record.objective:.6g}"
        coarse = ", coarse mesh" if record.mesh == "coarse" else ""
        log.info(
            "start %d, analysis %d by %s%s: %s, %s",
            record.start,
            record.analysis,
            record.solver,
            coarse,
            left,
            record.status,
        )
    elif isinstance(record, StartRecord):
        left = "no fit" if record.objective is None else f"objective {record.objective:.6g}"
        log.info(
            "start %d ended: %s, %s; %d analyses in %.2f s",
            record.number,
            record.status,
            left,
            record.analyses,
            record.wall_s,
        )


def log_run(title: str, record: RunRecord, again: bool) -> None:
    """Log the end of a prediction, or that the folder held it."""
    how = record.failure or (f"stopped early, {record.early}" if record.early else "finished")
    log.info("%s: %s; %.2f s%s", title, how, record.seconds, ", kept from before" * again)


@contextmanager
def timed(what: str) -> Iterator[None]:
    """Log the seconds of a part of a command."""
    begun = time.perf_counter()
    yield
    log.info("%s: %.2f s", what, time.perf_counter() - begun)
