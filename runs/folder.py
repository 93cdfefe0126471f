"""The output folder: what is written while a study runs, and what makes it resumable."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
from collections.abc import Iterable, Sequence
from io import FileIO
from pathlib import Path
from typing import Any

from ..errors import InputError, OutputError
from .start import EvaluationRecord, StartRecord

RUN, STARTS, HISTORY, RESULT = "run.json", "starts.jsonl", "history.csv", "result.json"


class OutputFolder:
    """A folder that holds one study.

    run.json says whose study it is (fingerprint); starts.jsonl gets a line a finished start;
    history.csv a row an evaluation. Everything else is written at the end, each file whole.
    """

    def __init__(self, path: Path, modulus_unit: str, modulus_scale: float) -> None:
        self.path = path
        self.modulus_unit, self.modulus_scale = modulus_unit, modulus_scale
        self._history: FileIO | None = None
        self._starts: FileIO | None = None

    def begin(
        self, fingerprint: str, columns: Sequence[str], resume: bool, overwrite: bool
    ) -> dict[int, StartRecord]:
        """Make the folder ready; returns the starts already finished (none unless resuming).

        Raises
        ------
        OutputError : the folder cannot be written, or holds a study and neither `resume` nor
            `overwrite` is given.
        InputError : `resume`, but the folder's study is another one, or is not readable.
        """
        held = (self.path / RUN).exists() or (self.path / RESULT).exists()
        if held and not (resume or overwrite):
            raise OutputError(
                f"{self.path}: already holds a study; continue it with --resume, replace it "
                "with --overwrite, or name another folder with --out"
            )
        done: dict[int, StartRecord] = {}
        with _telling(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            if held and resume:
                self._same_study(fingerprint)
                done = self._finished()
                kept = [r for r in self._rows_read() if r[:1] and r[0] in map(str, done)]
                self.write("result.json", None)
            else:
                kept = []
                for name in (RESULT, STARTS, HISTORY):
                    self.write(name, None)
                self.write(RUN, json.dumps({"fingerprint": fingerprint}, indent=1) + "\n")
            lines = [json.dumps(record.to_json()) + "\n" for record in done.values()]
            self.write(STARTS, "".join(lines))
            self.write(HISTORY, _table([self.header(columns), *kept]))
            # Unbuffered: a row is the system's as soon as it is written, and closing cannot fail.
            self._starts = open(self.path / STARTS, "ab", buffering=0)
            self._history = open(self.path / HISTORY, "ab", buffering=0)
        return done

    def header(self, columns: Sequence[str]) -> list[str]:
        """Columns of history.csv; coefficients carry their unit in the name."""
        named = [f"{c}_{self.modulus_unit}" if c.startswith("beta") else c for c in columns]
        return ["start", "analysis", "solver", "objective", "status", *named]

    def add(self, record: EvaluationRecord | StartRecord) -> None:
        """Append to history.csv or starts.jsonl and hand it to the system at once."""
        assert self._history is not None and self._starts is not None
        with _telling(self.path):
            if isinstance(record, StartRecord):
                _append(self._starts, json.dumps(record.to_json()) + "\n")
                os.fsync(self._starts.fileno())
                return
            coefficients = [repr(c / self.modulus_scale) for c in record.coefficients]
            value = "" if record.objective is None else repr(record.objective)
            row = [record.start, record.analysis, record.solver, value, record.status]
            row += coefficients
            _append(self._history, _table([[*row, *map(repr, record.nuisance)]]))

    def finish(self) -> None:
        """Close the running files and put history.csv in order of start and analysis."""
        self.close()
        rows = self._rows_read()
        body = sorted(rows[1:], key=lambda r: (int(r[0]), int(r[1])))
        with _telling(self.path):
            self.write(HISTORY, _table([rows[0], *body]))

    def close(self) -> None:
        """Close the running files (harmless when they are not open)."""
        for stream in (self._history, self._starts):
            if stream is not None:
                stream.close()
        self._history = self._starts = None

    def write(self, name: str, text: str | None) -> None:
        """Write a file whole or not at all; None removes it."""
        path = self.path / name
        with _telling(self.path):
            if text is None:
                path.unlink(missing_ok=True)
                return
            temporary = path.with_name(name + ".part")
            try:
                with open(temporary, "w", encoding="utf-8", newline="") as stream:
                    stream.write(text)
                    stream.flush()
                    os.fsync(stream.fileno())
                os.replace(temporary, path)
            except OSError:
                temporary.unlink(missing_ok=True)
                raise

    def _same_study(self, fingerprint: str) -> None:
        path = self.path / RUN
        try:
            found = json.loads(path.read_text(encoding="utf-8"))["fingerprint"]
        except (OSError, ValueError, KeyError, TypeError):
            raise InputError(path, "", "is missing or damaged; use --overwrite") from None
        if found != fingerprint:
            raise InputError(
                path,
                "fingerprint",
                "this folder holds a study of another project, data, seed, method or version; "
                "resume it with the same, or use --overwrite",
            )

    def _finished(self) -> dict[int, StartRecord]:
        path = self.path / STARTS
        done: dict[int, StartRecord] = {}
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
            done[record.number] = record
        return done

    def _rows_read(self) -> list[list[str]]:
        path = self.path / HISTORY
        text = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
        whole = text[: text.rfind("\n") + 1]  # a last line without its end was cut off
        return [row for row in csv.reader(io.StringIO(whole)) if row]


def _append(stream: FileIO, text: str) -> None:
    content = text.encode()
    if stream.write(content) != len(content):
        # The rest would not fit; a last line without its end is left out when it is read.
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _table(rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


class _telling:
    """Turns an OSError into one line about the output folder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        if isinstance(error, OSError):
            raise OutputError(
                f"{self.path}: cannot write the output folder: {error.strerror or error}; "
                "free space or name another with --out"
            ) from None
