"""The fits of a study of weights in its folder, so that none is made twice."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..fits.result import Fit
from ..fits.setup import fingerprints
from ..fits.store import Store
from .weighted_fit import WeightedFit

RUNS = "weights-runs.json"


class WeightsRecord:
    """Fits under a mark of all that they depend on, the optimum they began at among it.

    folder : None where nothing is written. resume : go on with what it holds.
    """

    def __init__(self, folder: Path | None, found: Fit, names: Sequence[str], resume: bool) -> None:
        own = [f"{value:.9g}" for value in found.best.point.unknowns]
        parts = {**fingerprints(found.setup, found.problem), "tests": list(names), "at": own}
        self._mark = hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()
        self._folder, self._runs = folder, dict[float, dict[str, Any]]()
        if folder is not None and resume:
            self._runs = self._written(folder / RUNS)

    def read(self, count: float) -> WeightedFit | None:
        """The fit at this weight; None where there is none, or it failed."""
        row = self._runs.get(count)
        return None if row is None or row["failure"] else WeightedFit(**row)

    def write(self, run: WeightedFit) -> None:
        """Write a fit; raises OutputError."""
        self._runs[run.count] = run.to_json()
        if self._folder is not None:
            content = {"of": self._mark, "runs": list(self._runs.values())}
            Store(self._folder).write(RUNS, json.dumps(content, indent=1) + "\n")

    def _written(self, path: Path) -> dict[float, dict[str, Any]]:
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["of"] != self._mark:
                return {}
            return {row["count"]: WeightedFit(**row).to_json() for row in content["runs"]}
        except (OSError, ValueError, KeyError, TypeError):
            return {}
