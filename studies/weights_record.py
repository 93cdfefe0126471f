"""The fits of a study of weights in its folder, so that none is made twice."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..fits.result import Fit
from ..fits.setup import fingerprints
from .marked import mark_of, read_marked, write_marked
from .weighted_fit import WeightedFit

RUNS = "weights-runs.json"


class WeightsRecord:
    """Fits under a mark of all that they depend on, the optimum they began at among it.

    folder : None where nothing is written. resume : go on with what it holds.
    """

    def __init__(self, folder: Path | None, found: Fit, names: Sequence[str], resume: bool) -> None:
        own = [f"{value:.9g}" for value in found.best.point.unknowns]
        parts = {**fingerprints(found.setup, found.problem), "tests": list(names), "at": own}
        self._mark = mark_of(parts)
        self._folder, self._runs = folder, dict[float, dict[str, Any]]()
        if folder is not None and resume:
            self._runs = read_marked(folder / RUNS, self._mark, _by_count) or {}

    def read(self, count: float) -> WeightedFit | None:
        """The fit at this weight; None where there is none, or it failed."""
        row = self._runs.get(count)
        return None if row is None or row["failure"] else WeightedFit(**row)

    def write(self, run: WeightedFit) -> None:
        """Write a fit; raises OutputError."""
        self._runs[run.count] = run.to_json()
        if self._folder is not None:
            write_marked(self._folder, RUNS, self._mark, {"runs": list(self._runs.values())})


def _by_count(content: dict[str, Any]) -> dict[float, dict[str, Any]]:
    return {row["count"]: WeightedFit(**row).to_json() for row in content["runs"]}
