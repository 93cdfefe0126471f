"""Runs of tests with cards in an output folder: a file each, so that none is run twice."""

from __future__ import annotations

import json
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..experiments.predicted import RunRecord
from ..notes import Note, NoteKind
from ..writing import replacing
from .store import Store

RUNS = "runs"


class RunRecords:
    """The runs in an output folder, each under a mark of everything that it depends on."""

    def __init__(self, path: Path) -> None:
        self.store = Store(path)

    def begin(self, resume: bool, overwrite: bool) -> None:
        """Make the folder ready; without `resume` no run is left in it.

        Raises
        ------
        OutputError, InputError : as `Store.begin`.
        """
        folder = self.store.path / RUNS
        # A name with a dot before it is a file whose writing was cut off.
        cut = [path for path in folder.glob(".*.npz")]
        held = [f"{RUNS}/{path.name}" for path in folder.glob("*.npz") if path not in cut]
        self.store.begin({}, resume, overwrite, held)
        for path in cut:
            path.unlink(missing_ok=True)

    def write(self, mark: str, record: RunRecord) -> None:
        """Write a run, whole or not at all; one that failed is tried again next time.

        Raises
        ------
        OutputError : it cannot be written.
        """
        if record.failure:
            return
        words = {
            "seconds": record.seconds,
            "early": record.early,
            "iterations": record.iterations,
            "unstable": record.unstable,
            "remarks": [(note.kind, note, note.of) for note in record.remarks],
            "arrays": list(record.arrays),
            "from_cache": record.from_cache,
        }
        arrays: dict[str, Any] = {f"of_{name}": array for name, array in record.arrays.items()}
        arrays["words"] = np.array(json.dumps(words))
        arrays["strain"] = np.empty(0) if record.strain is None else record.strain
        with replacing(self._file(mark)) as path:
            np.savez_compressed(path, **arrays)

    def read(self, mark: str) -> RunRecord | None:
        """The run under this mark; None where there is none, or a damaged one."""
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
                remarks=tuple(Note(NoteKind(kind), *said) for kind, *said in words["remarks"]),
                from_cache=bool(words.get("from_cache", False)),
            )
        return None

    def _file(self, mark: str) -> Path:
        return self.store.path / RUNS / f"{mark[:20]}.npz"
