"""Analyses of a study in its output folder, each kept as it ends, so that none is made twice."""

from __future__ import annotations

import shutil
from pathlib import Path

from ..errors import InputError
from ..solvers.base import History
from ..solvers.run_cache import RunCache
from ..writing import remove_cut, telling

FOLDER = "analyses"


class KeptAnalyses(RunCache):
    """Those of a study that writes into `folder`, each under a key of all that it depends on.

    Of another project or card none is taken. Nothing is touched before the first analysis; then,
    without `resume`, what is there goes.

    Raises
    ------
    InputError : `resume`, but there is nothing to go on with.
    """

    def __init__(self, folder: Path, resume: bool) -> None:
        super().__init__(folder / FOLDER)
        if resume and not self.folder.is_dir():
            problem = "holds nothing to go on with; leave --resume out, or name another with --out"
            raise InputError(folder, "", problem)
        self._resume, self._begun = resume, False

    def read(self, key: str) -> History | None:
        """As of `RunCache`; raises OutputError where what is there cannot be removed."""
        if not self._begun:
            self._begun = True
            remove_cut(self.folder.parent)
            with telling(self.folder):
                if self.folder.exists() and not self._resume:
                    shutil.rmtree(self.folder)
        return super().read(key)

    def not_kept(self, error: OSError) -> None:
        """Raises OutputError: the study's own tables would not be written either."""
        with telling(self.folder):
            raise error
