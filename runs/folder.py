"""The output folder of a run: what it keeps, how a run is resumed, its provenance and its page.

The provenance, provenance.json, has project, data files, command, date, machine and versions.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import json
import logging
import os
import platform
import re
import shutil
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..arguments import checked_arguments
from ..errors import InputError, NoFeasibleStart, OutputError, SolverFailure
from ..experiments.base import PreparedTest, Test
from ..experiments.forward import RunRecord
from ..lazy_modules import pandas as pd
from ..notes import Note, NoteKind, Verdict, note_lines, note_records
from ..presenting import DRAWINGS, PAGES
from ..processes import one_blas_thread
from ..project.project import Project
from ..project.sections import InMemory, project_text
from ..solvers.base import History, Solver
from ..solvers.run_cache import RunCache
from ..storage.writing import (
    json_text,
    output_errors,
    plain_values,
    remove_unfinished,
    replacing,
    write_csv,
    write_text,
)
from ..version import __version__
from .in_use import RUN, used_alone

#: Number of digits of a checksum that are shown.
DIGITS = 12
#: Largest number of differences of two lists that are listed singly, and of characters of a value.
MAX_LISTED = 3
MAX_VALUE_LETTERS = 60
CHECKSUM = re.compile("[0-9a-f]{64}")
log = logging.getLogger(__name__)

#: Everything on which results depend, as plain values under the names that messages use.
Facts = Mapping[str, Any]


def differences(earlier: Any, current: Any, key: str = "") -> list[str]:
    """Return the differences between the facts of two runs in words: key, old and new value."""
    if earlier == current:
        return []
    pairs = []
    if isinstance(earlier, Mapping) and isinstance(current, Mapping):
        for name in {**earlier, **current}:
            pairs.append((earlier.get(name), current.get(name), f"{key}.{name}".lstrip(".")))
    elif _are_lists_alike(earlier, current):
        for i, (a, b) in enumerate(zip(earlier, current, strict=True)):
            pairs.append((a, b, f"{key}[{i}]"))
    if not pairs:
        return [f"{key} = {_in_words(earlier)}, now {_in_words(current)}"]
    return [words for pair in pairs for words in differences(*pair)]


def _are_lists_alike(earlier: Any, current: Any) -> bool:
    """Return whether two values are lists of a length that differ in a few places only."""
    if not (isinstance(earlier, list) and isinstance(current, list)):
        return False
    if len(earlier) != len(current):
        return False
    return sum(a != b for a, b in zip(earlier, current, strict=True)) <= MAX_LISTED


def _in_words(value: Any) -> str:
    """Return a value of the facts, cut where it is long."""
    if value is None:
        return "not given"
    if isinstance(value, str) and CHECKSUM.fullmatch(value):
        return f"sha256 {value[:DIGITS]}"
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= MAX_VALUE_LETTERS else f"{text[:MAX_VALUE_LETTERS]}..."


RESULT = "result.json"
#: Origin of the results, and the project as run.
PROVENANCE = "provenance.json"
AS_RUN = "as-run.toml"
#: Folder of arrays of Python, as files.
DATA = "data"
#: Files of a complete result only: earlier ones must not stand beside a later failure.
OUTDATED = (RESULT, "report.html", "page.json", "material.toml")
#: Keys of run.json: digests of what the results depend on, and the same in plain values.
PARTS = "parts"
FACTS = "facts"


#: A job that a queue killed before its first result is started again with the same words.
NOTHING_THERE = "%s: holds nothing to go on with (--resume); beginning afresh"


@dataclass(frozen=True)
class OutputSettings:
    """Where a run or a study writes, and whether results that are there are kept or replaced.

    Attributes
    ----------
    path : Path or None
        Folder of the results; None if nothing is written.
    resume, overwrite : bool
        Whether to go on with what the folder holds, or to replace it.
    command_line : sequence of str or None
        Command to record as the origin of the results; None if called from Python.
    """

    path: Path | None = None
    resume: bool = False
    overwrite: bool = False
    command_line: Sequence[str] | None = None

    @classmethod
    def of(
        cls,
        out: Path | str | None,
        resume: bool,
        overwrite: bool,
        command_line: Sequence[str] | None = None,
    ) -> OutputSettings:
        """Return the settings of a call; raises InputError where they contradict each other."""
        if resume and overwrite:
            raise InputError(None, "resume, overwrite", "give one of them, not both")
        if out is None and (resume or overwrite):
            name = "resume" if resume else "overwrite"
            raise InputError(None, name, "means nothing without out, the folder of the results")
        return cls(None if out is None else Path(out), resume, overwrite, command_line)

    def below(self, name: str) -> OutputSettings:
        """Return the settings of one of the fits of a study, in a folder below that of the study.

        It is resumed only if its folder holds anything.
        """
        if self.path is None:
            return replace(self, resume=False)
        path = self.path / name
        return replace(self, path=path, resume=self.resume and Store(path).used)


class Store:
    """The output folder of a fit or of predictions.

    Its run.json has what the results depend on; result.json is written last.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def used(self) -> bool:
        """Return True if the folder holds anything of a fit or of predictions."""
        return (self.path / RUN).exists() or (self.path / RESULT).exists()

    def begin(
        self,
        parts: Mapping[str, str],
        resume: bool,
        overwrite: bool,
        records: Sequence[str] = (),
        facts: Facts | None = None,
    ) -> bool:
        """Make the folder ready; return whether it holds anything to go on with.

        Parameters
        ----------
        parts : dict
            Digests of what must be unchanged for the run to be resumed, by name; empty if every
            record has a digest of its own.
        resume, overwrite : bool
            Whether to go on with what the folder holds, or to replace it.
        records : sequence of str
            Files below the folder that are removed unless the run is resumed.
        facts : dict, optional
            The plain values behind the digests, with which a difference is described.

        Raises
        ------
        OutputError
            The folder cannot be written, or holds results and neither argument is True.
        InputError
            The folder holds another run than the one to resume, or cannot be read.
        """
        if self.used and not (resume or overwrite):
            problem = "already holds results; go on with --resume, replace them with --overwrite"
            raise OutputError(f"{self.path}: {problem}, or name another folder with --out")
        if resume and not self.used:
            log.warning(NOTHING_THERE, self.path)
            resume = False
        if resume:
            self._check(parts, facts or {})
        remove_unfinished(self.path)
        outdated = OUTDATED if resume else (*OUTDATED, *records)
        with output_errors(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            for name in outdated:
                (self.path / name).unlink(missing_ok=True)
        if not resume:
            content = {PARTS: dict(parts), FACTS: dict(facts or {})}
            write_text(self.path / RUN, json.dumps(content, indent=1) + "\n")
        return resume

    def finish(self, result: Mapping[str, Any]) -> None:
        """Write result.json, after everything else; raises OutputError."""
        write_text(self.path / RESULT, json_text(result))

    def _check(self, parts: Mapping[str, str], facts: Facts) -> None:
        """Raise InputError if the folder's results are of other inputs, or its record is damaged.

        `parts` maps each part of the run's input to the mark that identifies it; `facts` describes
        them, so that the message says what differs.
        """
        path = self.path / RUN
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            earlier = content[PARTS]
            earlier_facts = content.get(FACTS, {})
            changed = sorted(
                name for name in {**earlier, **parts} if earlier.get(name) != parts.get(name)
            )
            words = differences(earlier_facts, facts) if changed and earlier_facts else []
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            raise InputError(path, "", "is missing or damaged; use --overwrite") from None
        if changed:
            # Without words: of an older version, or of a difference without facts.
            problem = f"this folder's results are of another {' and '.join(changed)}"
            if words:
                problem = f"these results are of something else: {'; '.join(words)}"
            raise InputError(path, PARTS, f"{problem}; go on with the same, or use --overwrite")


CSV = ".csv"
PARQUET = ".parquet"


def write_table(table: pd.DataFrame, path: Path | str, digits: int | None = 9) -> Path:
    """Write a table by the ending of the name: .csv or .parquet.

    Parameters
    ----------
    table : DataFrame
    path : path
    digits : int or None
        Of numbers in a .csv, None for all; a .parquet is exact.

    Raises
    ------
    InputError
        Another ending, or Parquet without pyarrow.
    OutputError
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in (CSV, PARQUET):
        raise InputError(path, "", f"expected a name that ends in {CSV} or {PARQUET}")
    if kind == PARQUET and importlib.util.find_spec("pyarrow") is None:
        problem = "needs pyarrow, which is not installed: pip install 'bubblefit[parquet]'"
        raise InputError(path, PARQUET, f"{problem}, or write a {CSV}")
    with replacing(path) as temporary:
        if kind == PARQUET:
            table.to_parquet(temporary, engine="pyarrow", index=False)
        else:
            write_csv(table, temporary, digits)
    return path


def shown(table: pd.DataFrame, missing: str = "nan") -> list[str]:
    """Return a table as lines of a terminal, its index first, numbers with four digits."""
    return table.to_string(float_format="{:.4g}".format, na_rep=missing).splitlines()


RUNS = "runs"


class RunRecords:
    """The runs kept in an output folder, each under a digest of everything it depends on."""

    def __init__(self, path: Path) -> None:
        self.store = Store(path)

    def begin(self, resume: bool, overwrite: bool) -> bool:
        """Make the folder ready, without `resume` empty of runs; as `Store.begin`."""
        folder = self.store.path / RUNS
        remove_unfinished(folder)
        files = [f"{RUNS}/{path.name}" for path in folder.glob("*.npz")]
        return self.store.begin({}, resume, overwrite, files)

    def write(self, mark: str, record: RunRecord) -> None:
        """Write a run unless it failed: that is tried again next time; raises OutputError."""
        if record.failure:
            return
        words = {
            "seconds": record.seconds,
            "early": record.early,
            "iterations": record.iterations,
            "unstable": record.unstable,
            "from_cache": record.from_cache,
            "remarks": [(note.kind, note, note.of) for note in record.remarks],
            "arrays": list(record.arrays),
        }
        arrays: dict[str, Any] = {f"of_{name}": array for name, array in record.arrays.items()}
        arrays["words"] = np.array(json.dumps(words))
        arrays["strain"] = np.empty(0) if record.strain is None else record.strain
        with replacing(self._file(mark)) as path:
            np.savez_compressed(path, **arrays)

    def read(self, mark: str) -> RunRecord | None:
        """Return the run under this mark; None if there is none, or a damaged one."""
        # KeyError, TypeError: not one of ours. The rest: cut off, or not an archive at all.
        with suppress(OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
            with np.load(self._file(mark), allow_pickle=False) as content:
                words = json.loads(str(content["words"]))
                strain = np.array(content["strain"], dtype=float)
                arrays = {n: np.array(content[f"of_{n}"], dtype=float) for n in words["arrays"]}
            return RunRecord(
                float(words["seconds"]),
                early=str(words["early"]),
                strain=strain if len(strain) else None,
                arrays=arrays,
                iterations=int(words["iterations"]),
                unstable=None if words["unstable"] is None else tuple(words["unstable"]),
                remarks=tuple(
                    Note(NoteKind(kind), text, part) for kind, text, part in words["remarks"]
                ),
                from_cache=bool(words.get("from_cache", False)),
            )
        return None

    def _file(self, mark: str) -> Path:
        """Return the file of the run with this mark."""
        return self.store.path / RUNS / f"{mark[:20]}.npz"


FOLDER = "analyses"


class KeptAnalyses(RunCache):
    """The analyses of a study in its output folder, each under a key of all it depends on.

    Parameters
    ----------
    folder : Path
        Folder of the study.
    resume : bool
        Whether earlier analyses are reused; otherwise they are removed before the first one.
    """

    def __init__(self, folder: Path, resume: bool) -> None:
        super().__init__(folder / FOLDER)
        if resume and not self.folder.is_dir():
            log.warning(NOTHING_THERE, folder)
        self._resume = resume
        self._begun = False

    def read(self, key: str) -> History | None:
        """Read as `RunCache`; raises OutputError if earlier analyses cannot be removed."""
        if not self._begun:
            self._begun = True
            remove_unfinished(self.folder.parent)
            with output_errors(self.folder):
                if self.folder.exists() and not self._resume:
                    shutil.rmtree(self.folder)
        return super().read(key)

    def not_kept(self, error: OSError) -> None:
        """Raise OutputError: the study's own tables would not be written either."""
        with output_errors(self.folder):
            raise error


@one_blas_thread()
def write_page(result: object, folder: Path) -> Path:
    """Write all files of a result by the presenter of its class; return the path of the page."""
    write = PAGES.of(result)
    if write is None:
        raise TypeError(f"nothing writes a page of {type(result).__name__}")
    return write(result, folder)


@one_blas_thread()
def draw(result: object, drawing: str, *arguments: Any) -> Any:
    """Return the drawing of that name of a result, for a notebook."""
    drawings = DRAWINGS.of(result) or {}
    return drawings[drawing](result, *arguments)


def check_unused(out: Path | str | None, resume: bool, overwrite: bool) -> None:
    """Raise OutputError for a folder with a result that is neither resumed nor replaced."""
    path = OutputSettings.of(out, resume, overwrite).path
    if path is not None and (path / RESULT).exists() and not (overwrite or resume):
        raise OutputError(f"{out}: already holds a result; use --overwrite or another --out")


class Reported:
    """A result whose presenter writes a page: presenters look from above, no result imports one."""

    @checked_arguments
    def report(self, folder: Path | str, *, overwrite: bool = False) -> Path:
        """Write all files of the result into a folder.

        Parameters
        ----------
        folder : path
        overwrite : bool
            Whether to replace the result that the folder holds.

        Returns
        -------
        Path
            Of report.html.

        Raises
        ------
        OutputError
            The folder holds a result and `overwrite` is False, or it cannot be written.
        """
        with used_alone(folder):
            if (Path(folder) / RESULT).exists() and not overwrite:
                problem = "already holds a result; overwrite=True replaces it"
                raise OutputError(f"{folder}: {problem}, or name another folder")
            return write_page(self, Path(folder))


class Presented(Reported, ABC):
    """A study; `table` is the content of the CSV, `result` that of result.json."""

    write = Reported.report

    @property
    @abstractmethod
    def notes(self) -> Sequence[Note]:
        """Return what a reader must know of the study."""

    @property
    @abstractmethod
    def verdict(self) -> Verdict:
        """Return what the study comes to."""

    @property
    @abstractmethod
    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the study by name, beginning with its command."""

    @abstractmethod
    def result_lines(self) -> list[str]:
        """Return the results of the study as lines of the terminal."""

    @property
    def result(self) -> dict[str, Any]:
        """Return the content of result.json: the numbers, then the verdict and the notes."""
        ends = {"verdict": self.verdict.numbers, "notes": note_records(self.notes)}
        return {**plain_values(self.numbers), **ends}

    def lines(self) -> list[str]:
        """Return what a terminal shows: results, notes, and the verdict last."""
        return [*self.result_lines(), *note_lines(self.notes), *self.verdict.lines]

    def plot(self) -> Any:
        """Return a drawing of the study for a notebook, as `Fit.plot_moduli`."""
        return draw(self, "figure")


R = TypeVar("R", bound=Reported)


def finished(result: R, out: Path | str | None) -> R:
    """Return a result after writing its report to `out`, if given; raise OutputError."""
    if out is not None:
        result.report(out, overwrite=True)  # `out` was found unused, or is to be replaced
    return result


@dataclass(frozen=True)
class FailedRun:
    """A run that failed: the project's title, the failure in one line, and further lines."""

    title: str
    failure: str
    lines: Sequence[str]

    @property
    def verdict(self) -> Verdict:
        """Return that there is no result, and the failure."""
        words = f"this failed, and there is no result: {self.failure.rstrip('.')}"
        step = "look up what such a failure means and what helps: bubblefit docs failures"
        return Verdict("not to be used", words, next_step=step)


@contextmanager
def failure_page(folder: Path | None, title: str) -> Iterator[list[str]]:
    """Write report.html of a failure within the block, if there is a folder, and raise it again.

    Parameters
    ----------
    folder : Path or None
    title : str
        Of the project.

    Yields
    ------
    list of str
        Further lines of the page, to be filled.
    """
    lines: list[str] = []
    try:
        yield lines
    except (SolverFailure, NoFeasibleStart) as failure:
        if folder is not None:
            failed = FailedRun(title, str(failure).splitlines()[0], lines)
            with suppress(OutputError):  # the failure itself says more
                write_page(failed, folder)
        raise


PACKAGES = ("numpy", "scipy", "numba", "nlopt", "quadprog", "meshio")


def versions() -> dict[str, str]:
    """Return the versions of bubblefit, Python and `PACKAGES` by name."""
    packages = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"bubblefit": __version__, "python": platform.python_version(), **packages}


@dataclass(frozen=True, eq=False)
class Provenance:
    """The origin of a folder's results.

    Attributes
    ----------
    project : Path
        The project file.
    text : str or None
        The text of that file.
    settings : dict or None
        Settings of the run as a project file has them (`settings_of`); None if the run cannot be
        repeated from a file.
    data : sequence of dict
        The measured files or arrays, as `data_rows` describes them.
    solver : dict
        Name, version and settings of the solver, from `solver_facts`.
    runs : sequence of dict
        Date, machine and versions of each run (`this_run`), the earliest first.
    in_memory : InMemory
        Arrays and cards from Python, which the folder keeps as files.
    """

    project: Path
    text: str | None
    settings: Mapping[str, Any] | None
    data: Sequence[Mapping[str, Any]]
    solver: Mapping[str, str]
    runs: Sequence[Mapping[str, Any]]
    in_memory: InMemory = field(default_factory=InMemory)

    @classmethod
    def of(
        cls,
        project: Project,
        settings: Mapping[str, Any] | None,
        tests: Iterable[tuple[str, Test | PreparedTest]],
        solver: Solver,
        command_line: Sequence[str] | None,
    ) -> Provenance:
        """Return the record of a run that begins now.

        Parameters
        ----------
        project : Project
        settings : mapping or None
            Settings of the run.
        tests : iterable of (str, Test or PreparedTest)
            The tests by name, whose data files are recorded.
        solver : Solver
        command_line : sequence of str or None
            None if called from Python.
        """
        return cls(
            project=project.path,
            text=project.written.text,
            settings=settings,
            data=data_rows(tests),
            solver=solver_facts(project.fit.solver, solver.identity),
            runs=[this_run(command_line)],
            in_memory=project.written.in_memory,
        )

    @classmethod
    def read(cls, folder: Path) -> Provenance | None:
        """Read the record of a folder; None where it is missing or damaged."""
        with suppress(OSError, ValueError, KeyError, TypeError):
            content = json.loads((folder / PROVENANCE).read_text(encoding="utf-8"))
            runs = [dict(run) for run in content["runs"]]
            data = [dict(row) for row in content["data"]]
            project = content["project"]
            return cls(Path(project["file"]), project["text"], None, data, content["solver"], runs)
        return None

    def after(self, folder: Path) -> Provenance:
        """Return the record with the earlier runs of the folder before its own."""
        earlier = Provenance.read(folder)
        return self if earlier is None else replace(self, runs=[*earlier.runs, *self.runs])

    def write(self, folder: Path) -> None:
        """Write provenance.json, the project as run, and arrays as files; raises OutputError."""
        text = self.text
        settings = self.settings
        folders = self.in_memory.write_data(folder / DATA)
        if settings is not None:
            settings = self.in_memory.with_files(settings, folder / DATA)
        data = [
            {**row, "file": str(folders[row["test"]] / row["name"])}
            if row["test"] in folders
            else row
            for row in self.data
        ]
        content = {
            "project": {
                "file": os.path.abspath(self.project),
                "sha256": None if text is None else hashlib.sha256(text.encode()).hexdigest(),
                "text": text,
                "as_run": None if settings is None else project_text(settings),
            },
            "data": data,
            "solver": self.solver,
            "runs": self.runs,
        }
        if settings is not None:
            write_text(folder / AS_RUN, project_text(settings))
        write_text(folder / PROVENANCE, json.dumps(content, indent=1, ensure_ascii=False) + "\n")

    @property
    def files(self) -> list[tuple[str, str]]:
        """Return the names of the files that `write` writes, with descriptions."""
        project = [] if self.settings is None else [(AS_RUN, "the project as run, to run again")]
        return [(PROVENANCE, "what these results came from"), *project]


def data_rows(tests: Iterable[tuple[str, Test | PreparedTest]]) -> list[dict[str, Any]]:
    """Return checksum, format, columns, units and rows of each measured file or array; InputError.

    Arrays are named as their files are once they are written; their checksum is that of their
    numbers (64 bit, little-endian).
    """
    return [
        {
            "test": name,
            "file": file.path.name if file.arrays else os.path.abspath(file.path),
            "name": file.path.name,
            "sha256": file.sha256,
            "format": file.source.format,
            "columns": dict(file.source.columns),
            "units": dict(file.source.units),
            "rows_used": file.used_count,
            "rows_dropped": dict(file.dropped),
            "notes": list(file.source.notes),
        }
        for name, test in tests
        for file in test.data_files()
    ]


def this_run(command_line: Sequence[str] | None) -> dict[str, Any]:
    """Return the current date, machine and versions, with the command line if there is one."""
    return {
        "command_line": None if command_line is None else list(command_line),
        "date": datetime.now().astimezone().isoformat(timespec="seconds"),
        "folder": os.getcwd(),
        "machine": {
            "name": platform.node(),
            "system": platform.platform(),
            "processor": platform.machine(),
        },
        "versions": versions(),
    }


#: Settings of fabric and tests that change no result.
NAMES = ("name", "folder", "lab")


def solver_facts(name: str, identity: str) -> dict[str, str]:
    """Return name, version and settings of a solver from its identity "ccx 2.20; element=S8R"."""
    version, *settings = identity.split("; ")
    pairs = [setting.partition("=")[::2] for setting in settings]
    return {"name": name, "version": version, **dict(pairs)}
