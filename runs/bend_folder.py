"""The output folder of bending runs: a file each, so that none that ended is run again."""

from __future__ import annotations

import json
import zipfile
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import OutputError
from ..writing import replacing
from .bend_run import BendRun
from .folder import RESULT

RUNS = "runs"
ARRAYS = tuple(f.name for f in fields(BendRun) if str(f.type) == "Array")


class BendFolder:
    """A folder that holds the runs of a study of bending, each by its fingerprint."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, resume: bool, overwrite: bool) -> None:
        """Make the folder ready.

        Raises
        ------
        OutputError : it cannot be written, or holds runs and neither `resume` nor `overwrite` is
            given.
        """
        # A name with a dot before it is a file whose writing was cut off.
        held = list((self.path / RUNS).glob("*.npz"))
        whole = [p for p in held if not p.name.startswith(".")]
        if (whole or (self.path / RESULT).exists()) and not (resume or overwrite):
            raise OutputError(
                f"{self.path}: already holds a study; continue it with --resume, replace it "
                "with --overwrite, or name another folder with --out"
            )
        try:
            (self.path / RUNS).mkdir(parents=True, exist_ok=True)
            # Gone while runs are missing: where it is, the output is complete.
            (self.path / RESULT).unlink(missing_ok=True)
            for path in held:
                if overwrite or path not in whole:
                    path.unlink(missing_ok=True)
        except OSError as error:
            reason = error.strerror or str(error)
            raise OutputError(
                f"{self.path}: cannot be written: {reason}; choose another --out"
            ) from None

    def keep(self, mark: str, run: BendRun) -> None:
        """Write a run that ended, whole or not at all; one that failed is tried again next time.

        Raises
        ------
        OutputError : it cannot be written.
        """
        if run.failed:
            return
        words = {"seconds": run.seconds, "iterations": run.iterations, "remarks": run.remarks}
        arrays = {name: getattr(run, name) for name in ARRAYS}
        with replacing(self._file(mark)) as path:
            np.savez_compressed(path, words=np.array(json.dumps(words)), **arrays)

    def kept(self, mark: str) -> BendRun | None:
        """The run of this fingerprint; None where there is none, or a damaged one."""
        # KeyError, TypeError: not one of ours. The rest: cut off, or not an archive at all.
        with suppress(OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
            with np.load(self._file(mark), allow_pickle=False) as found:
                words = json.loads(str(found["words"]))
                arrays: dict[str, Any] = {n: np.array(found[n], dtype=float) for n in ARRAYS}
            return BendRun(
                float(words["seconds"]),
                iterations=int(words["iterations"]),
                remarks=tuple(map(str, words["remarks"])),
                **arrays,
            )
        return None

    def _file(self, mark: str) -> Path:
        return self.path / RUNS / f"{mark[:20]}.npz"
