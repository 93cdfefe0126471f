"""The files that a fit appends to while it runs, from which an interrupted fit is resumed."""

from __future__ import annotations

import csv
import errno
import io
import os
from collections.abc import Iterable, Sequence
from io import FileIO
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..storage.writing import output_errors, write_text
from .folder import Store
from .in_use import STARTS
from .starts import EvaluationRecord, Event, StartRecord

HISTORY = "history.csv"
#: First columns of history.csv, before those of the unknowns.
HEADER = ("start", "analysis", "solver", "mesh", "objective", "status")
MESH = HEADER.index("mesh")


class RunningFiles:
    """The files of a fit to which analyses and starts are written as they end.

    Parameters
    ----------
    store : Store
        Folder of the fit.
    columns : sequence of str
        Names of the unknowns, columns of history.csv after `HEADER`.
    scale : sequence of float
        Numbers by which the unknowns are divided to have the units of the columns.
    """

    def __init__(self, store: Store, columns: Sequence[str], scale: Sequence[float]) -> None:
        self.store = store
        self.columns = tuple(columns)
        self.scale = tuple(scale)
        self._rows: FileIO | None = None
        self._starts: FileIO | None = None

    def begin(self, resume: bool) -> list[StartRecord]:
        """Open the files; return the finished starts, on either mesh, if resumed.

        Raises InputError where they are damaged.
        """
        records: list[StartRecord] = []
        rows: list[list[str]] = []
        if resume:
            records = self.finished()
            finished = {(str(record.number), record.mesh) for record in records}
            rows = [row for row in self._read() if (row[0], row[MESH]) in finished]
        write_text(self.store.path / STARTS, "".join(record.text for record in records))
        write_text(self.store.path / HISTORY, _table([[*HEADER, *self.columns], *rows]))
        with output_errors(self.store.path):
            # Unbuffered: a row is the system's as soon as it is written, and closing cannot fail.
            self._starts = open(self.store.path / STARTS, "ab", buffering=0)
            self._rows = open(self.store.path / HISTORY, "ab", buffering=0)
        return records

    def add(self, record: Event) -> None:
        """Append to history.csv or starts.jsonl at once; raises OutputError."""
        assert self._rows is not None and self._starts is not None
        with output_errors(self.store.path):
            if isinstance(record, StartRecord):
                _append(self._starts, record.text)
                os.fsync(self._starts.fileno())
                return
            _append(self._rows, _table([self._row(record)]))

    def _row(self, record: EvaluationRecord) -> list[Any]:
        """Return the row of history.csv, every number in full."""
        values = (*record.coefficients, *record.nuisance)
        numbers = [repr(v / s) for v, s in zip(values, self.scale, strict=True)]
        objective = "" if record.objective is None else repr(record.objective)
        return [
            record.start,
            record.analysis,
            record.solver,
            record.mesh,
            objective,
            record.status,
            *numbers,
        ]

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
        records: dict[tuple[int, str], StartRecord] = {}
        lines = _text_of(path).splitlines()
        for i, line in enumerate(lines):
            try:
                record = StartRecord.read(line)
            except ValueError:
                if i == len(lines) - 1:
                    break  # cut off by a kill: that start is run again
                problem = "is damaged; use --overwrite"
                raise InputError(path, f"line {i + 1}", problem) from None
            records[record.number, record.mesh] = record
        return [record for record in records.values() if not record.failure]

    def _read(self) -> list[list[str]]:
        text = _text_of(self.store.path / HISTORY)
        complete_lines = text[: text.rfind("\n") + 1]  # one without its end was cut off
        return [row for row in csv.reader(io.StringIO(complete_lines)) if len(row) > MESH]


def _text_of(path: Path) -> str:
    """Return the text of a file, "" if there is none.

    A crash can leave bytes that are no text where the last line should be.
    """
    return path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""


def _append(stream: FileIO, text: str) -> None:
    content = text.encode()
    if stream.write(content) != len(content):
        # The disk is full; a last line without its end is left out when it is read.
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _table(rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
