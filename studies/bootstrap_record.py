"""The samples of a bootstrap in its folder, so that none is fitted twice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..fits.setup import fingerprints
from .marked import mark_of, read_marked, write_marked
from .refound import Refound

SAMPLES = "bootstrap-samples.json"


@dataclass(frozen=True)
class Sample:
    """One refit. counts : by group, how often each unit was drawn. unknowns : the optimiser's.

    status : how the descent ended, as that of a fit.
    """

    number: int
    counts: Sequence[Sequence[int]]
    unknowns: Sequence[float]
    analyses: int
    status: str

    def to_json(self) -> dict[str, Any]:
        """Plain values, exact in JSON."""
        return asdict(self)


class BootstrapRecord:
    """Samples under a mark of all that they depend on, the optimum they began at among it.

    folder : None where nothing is written. resume : go on with what it holds.
    """

    def __init__(self, folder: Path | None, found: Refound, over: str, resume: bool) -> None:
        at = [f"{value:.6g}" for value in found.point.unknowns]
        parts = {**fingerprints(found.setup, found.problem), "over": over, "at": at}
        self._mark = mark_of(parts)
        self._folder = folder
        self.samples: dict[int, Sample] = {}
        if folder is not None and resume:
            self.samples = read_marked(folder / SAMPLES, self._mark, _by_number) or {}

    def write(self, sample: Sample) -> None:
        """Write a sample; raises OutputError."""
        self.samples[sample.number] = sample
        if self._folder is not None:
            rows = [one.to_json() for one in self.samples.values()]
            write_marked(self._folder, SAMPLES, self._mark, {"samples": rows})


def _by_number(content: dict[str, Any]) -> dict[int, Sample]:
    return {row["number"]: Sample(**row) for row in content["samples"]}
