"""The same fit on coarse meshes: the same tests, data and unknowns, quads of twice the edge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ..errors import InputError
from ..experiments.fittable import PreparedTest, Weighting
from ..experiments.refinable import Refinable
from ..identification.comparison import Comparison
from ..identification.problem import FitProblem
from .setup import FitSetup
from .start import StartRecord

#: Edges of quads of the full mesh are those of the coarse one times it.
COARSER = 0.5


def coarse_problem(setup: FitSetup) -> FitProblem | None:
    """The fit on coarse meshes, run by the project's solver, or by what leads it.

    Tests whose kind knows no coarser mesh, or whose mesh is coarse already, stay as they are; None
    where all do.
    """
    make = setup.make_leading
    pairs = list(zip(setup.tests, setup.weightings, strict=True))
    coarse = [_coarse(test, make, weighting) for test, weighting in pairs]
    if not any(coarse):
        return None
    comparisons = [
        comparison
        for (test, weighting), own in zip(pairs, coarse, strict=True)
        for comparison in own or test.comparisons(make, weighting)
    ]
    return setup.problem_of(comparisons)


def _coarse(test: PreparedTest, make: Any, weighting: Weighting) -> tuple[Comparison, ...]:
    if not isinstance(test, Refinable):
        return ()
    try:
        return test.finer(make, weighting, COARSER)
    except InputError:
        return ()  # the mesh is as coarse as it can be


@dataclass(frozen=True)
class CoarseToFine:
    """What ran on which mesh.

    quads : by comparison, of the coarse and of the full mesh; those without a mesh are not among
    them. starts : on the coarse mesh. distinct : of their optima, fitted on the full mesh.
    coarse_analyses, full_analyses : of all starts together.
    """

    quads: dict[str, tuple[int, int]]
    starts: int
    distinct: int
    coarse_analyses: int
    full_analyses: int

    @classmethod
    def of(cls, setup: FitSetup, records: Sequence[StartRecord]) -> CoarseToFine | None:
        """Of a fit that ended with these records; None where every start ran on its own mesh."""
        coarse = coarse_problem(setup) if setup.project.fit.coarse_to_fine else None
        if coarse is None:
            return None
        pairs = zip(coarse.comparisons, setup.problem().comparisons, strict=True)
        quads = {
            own.name: (len(other.model.mesh.quads), len(own.model.mesh.quads))
            for other, own in pairs
            if hasattr(own.model, "mesh")
        }
        before = sum(record.coarse_analyses for record in records)
        after = sum(record.analyses for record in records) - before
        distinct = sum(record.same_as is None for record in records)
        return cls(quads, len(records), distinct, before, after)

    @property
    def words(self) -> str:
        """In a line, for page and terminal."""
        meshes = ", ".join(
            f"{name} {coarse} of {full} quads" for name, (coarse, full) in self.quads.items()
        )
        return (
            f"{self.starts} starts on the coarse mesh ({meshes}; {self.coarse_analyses} analyses), "
            f"{self.distinct} distinct of their optima on the full one ({self.full_analyses})"
        )

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        quads = {
            name: dict(zip(("coarse", "full"), own, strict=True))
            for name, own in self.quads.items()
        }
        return {**asdict(self), "quads": quads}
