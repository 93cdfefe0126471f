"""Running files of a fit: history.csv, a row an analysis; starts.jsonl, a line a start."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
from collections.abc import Iterable, Sequence
from io import FileIO
from typing import Any

from ..errors import InputError
from ..writing import telling
from .start import EvaluationRecord, StartRecord
from .store import Store

STARTS, HISTORY = "starts.jsonl", "history.csv"
#: What every history begins with; the mesh is "full", or "coarse" where it leads to the full one.
HEADER = ("start", "analysis", "solver", "mesh", "objective", "status")
MESH = HEADER.index("mesh")


class RunningFiles:
    """The running files of a fit in its store.

    Parameters
    ----------
    columns : names of the unknowns' values after the columns that every history has; coefficients
        are divided by `scale` (MPa per unit of the file) and carry their unit in the name.
    """

    def __init__(self, store: Store, columns: Sequence[str], scale: Sequence[float]) -> None:
        self.store, self.columns, self.scale = store, tuple(columns), tuple(scale)
        self._rows: FileIO | None = None
        self._starts: FileIO | None = None

    def begin(self, resume: bool) -> list[StartRecord]:
        """Open the files; the starts that are finished already (none unless going on).

        One that the solver's failure ended is not. A start that runs coarse to fine can be finished
        on either mesh.

        Raises
        ------
        InputError : a line of starts.jsonl is damaged. OutputError : the folder cannot be written.
        """
        done = self.finished() if resume else []
        ended = {(str(record.number), record.mesh) for record in done}
        rows = [r for r in self._read() if (r[0], r[MESH]) in ended] if resume else []
        lines = [json.dumps(record.to_json()) + "\n" for record in done]
        self.store.write(STARTS, "".join(lines))
        self.store.write(HISTORY, _table([[*HEADER, *self.columns], *rows]))
        with telling(self.store.path):
            # Unbuffered: a row is the system's as soon as it is written, and closing cannot fail.
            self._starts = open(self.store.path / STARTS, "ab", buffering=0)
            self._rows = open(self.store.path / HISTORY, "ab", buffering=0)
        return done

    def add(self, record: EvaluationRecord | StartRecord) -> None:
        """Append to history.csv or starts.jsonl and hand it to the system at once.

        Raises
        ------
        OutputError : it cannot be written.
        """
        assert self._rows is not None and self._starts is not None
        with telling(self.store.path):
            if isinstance(record, StartRecord):
                _append(self._starts, json.dumps(record.to_json()) + "\n")
                os.fsync(self._starts.fileno())
                return
            values = (*record.coefficients, *record.nuisance)
            numbers = [repr(v / s) for v, s in zip(values, self.scale, strict=True)]
            value = "" if record.objective is None else repr(record.objective)
            said = record.start, record.analysis, record.solver, record.mesh, value, record.status
            _append(self._rows, _table([[*said, *numbers]]))

    def finish(self) -> None:
        """Close the files and put history.csv in order of start and analysis.

        Of a start that began again, because its process died, the rows of the last time count.
        """
        self.close()
        rows = self._read()
        last = {(int(row[0]), int(row[1])): row for row in rows[1:]}
        body = [last[number] for number in sorted(last)]
        self.store.write(HISTORY, _table([rows[0], *body]))

    def close(self) -> None:
        """Close the files (harmless when they are not open)."""
        for stream in (self._rows, self._starts):
            if stream is not None:
                stream.close()
        self._rows = self._starts = None

    def finished(self) -> list[StartRecord]:
        """The starts that ended, as starts.jsonl has them.

        Raises
        ------
        InputError : a line of it is damaged.
        """
        path = self.store.path / STARTS
        done: dict[tuple[int, str], StartRecord] = {}
        # A crash can leave bytes that are no text where the last line should be.
        text = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
        lines = text.splitlines()
        for i, line in enumerate(lines):
            try:
                record = StartRecord.from_json(json.loads(line))
            except (ValueError, KeyError, TypeError, IndexError):
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
