"""A biaxial test in a fit: what is compared, and what a finished fit shows of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...inference.comparison import Comparison
from ...materials.law import HypoelasticLaw
from ...readers.biaxial import BiaxialPath
from ...solvers.base import History
from ..kinds import (
    DataFile,
    Doubt,
    Expected,
    FittedTest,
    MakeSolver,
    Masks,
    Reach,
    Weighting,
)
from .doubts import doubts_of_biaxial
from .objective import StrainObjective
from .test import BiaxialTest, reach_of


@dataclass(frozen=True, eq=False)
class FittedPath:
    """One ratio of a finished fit: measured data and the best law's response."""

    path: BiaxialPath
    objective: StrainObjective
    history: History

    @property
    def rms(self) -> tuple[float, float]:
        """Return the RMS errors of the strains along warp and fill, %."""
        warp, fill = self.objective.rms(self.history).tolist()
        return warp, fill


@dataclass(frozen=True, eq=False)
class PreparedBiaxial:
    """A biaxial test with its data."""

    test: BiaxialTest
    objective_is = "sum of the ratios' RMS errors of strain, warp and fill, over their largest"
    known: HypoelasticLaw | None = None

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Return nothing: a ratio is no specimen of another."""
        return {}

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return the ratios as parts, where there are several."""
        paths = self.test.data.paths
        whole = {self.part(p.ratio): np.ones(len(p.load), dtype=bool) for p in paths}
        ratios = {p.ratio: {**whole, self.part(p.ratio): ~whole[self.part(p.ratio)]} for p in paths}
        return {"ratios": ratios} if len(paths) > 1 else {}

    def reach(self, masks: Masks) -> Reach:
        """Return the reach of the ratios that masks leave."""
        return reach_of(self.kept(masks))

    def kept(self, masks: Masks | None) -> tuple[BiaxialPath, ...]:
        """Return the ratios that masks leave, which are matched whole."""
        known = masks or {}
        paths = self.test.data.paths
        return tuple(p for p in paths if known.get(self.part(p.ratio), np.True_).any())

    def part(self, ratio: str) -> str:
        """Return the name of the comparison of a ratio."""
        return f"{self.test.name}: {ratio}"

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return a comparison a ratio that masks leave.

        They lead in: a patch has no mesh, and hardly ever fails.

        Raises InputError: no strain at all along a path.
        """
        test, models = self.test, self.test.models()
        kept, found = self.kept(masks), []
        share = weighting.weight / (2 * max(1, len(kept))) if weighting.relative else 1.0
        for path in kept:
            largest = float(np.abs(path.since).max())
            if not largest > 0:
                raise test.place.error("data", f"the strains of ratio {path.ratio} are all zero")
            objective = StrainObjective(path.load, path.since, largest, share, test.noise)
            found.append(
                Comparison(
                    self.part(path.ratio), models[path.ratio], make_solver(), objective,
                    contracts=True,
                )
            )  # fmt: skip
        return tuple(found)

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """Return the same comparisons: there is no mesh to refine."""
        return self.comparisons(make_solver, weighting)

    def fitted_paths(self, fitted: FittedTest) -> tuple[FittedPath, ...]:
        """Return the ratios with the best law's response."""
        known = {c.name: (c, h) for c, h in zip(fitted.comparisons, fitted.histories, strict=True)}
        found = []
        for path in self.test.data.paths:
            comparison, history = known[self.part(path.ratio)]
            assert isinstance(comparison.objective, StrainObjective)
            found.append(FittedPath(path, comparison.objective, history))
        return tuple(found)

    def data_files(self) -> Sequence[DataFile]:
        """Return the files, with the number of rows on matched paths."""
        used = {id(table): 0 for table in self.test.data.tables}
        for path in self.test.data.paths:
            used[id(path.table)] += len(path.load)
        return [
            DataFile(
                table.path, table.source, used[id(table)],
                {"not of an evaluated loading": len(table.load) - used[id(table)]},
            )
            for table in self.test.data.tables
        ]  # fmt: skip

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        """Return the doubts about the paths."""
        return doubts_of_biaxial(self.test, expected)
