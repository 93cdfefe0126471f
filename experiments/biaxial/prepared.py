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
    """One ratio of a finished fit: what was measured, and what the best law makes of it."""

    path: BiaxialPath
    objective: StrainObjective
    history: History

    @property
    def rms(self) -> tuple[float, float]:
        """Of the strains along warp and fill, %."""
        warp, fill = self.objective.rms(self.history).tolist()
        return warp, fill


@dataclass(frozen=True, eq=False)
class PreparedBiaxial:
    """The test: its files were read with its section."""

    test: BiaxialTest
    objective_is = "sum of the ratios' RMS errors of strain, warp and fill, over their largest"
    known: HypoelasticLaw | None = None

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """None: a ratio is no specimen of another."""
        return {}

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Its ratios, where it has several."""
        paths = self.test.data.paths
        whole = {self.part(p.ratio): np.ones(len(p.load), dtype=bool) for p in paths}
        ratios = {p.ratio: {**whole, self.part(p.ratio): ~whole[self.part(p.ratio)]} for p in paths}
        return {"ratios": ratios} if len(paths) > 1 else {}

    def reach(self, masks: Masks) -> Reach:
        """What the ratios say of which masks leave anything."""
        return reach_of(self.kept(masks))

    def kept(self, masks: Masks | None) -> tuple[BiaxialPath, ...]:
        """The ratios of which masks leave anything to match: they are matched whole."""
        known = masks or {}
        paths = self.test.data.paths
        return tuple(p for p in paths if known.get(self.part(p.ratio), np.True_).any())

    def part(self, ratio: str) -> str:
        """The name of the comparison of a ratio."""
        return f"{self.test.name}: {ratio}"

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """One a ratio of which anything is left.

        They lead in: a patch has no mesh, and hardly ever fails.

        Raises
        ------
        InputError : no strain at all along a path.
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
        """The same comparisons: there is no mesh, and one increment a reading is enough."""
        return self.comparisons(make_solver, weighting)

    def fitted_paths(self, fitted: FittedTest) -> tuple[FittedPath, ...]:
        """The ratios with what the fit makes of them."""
        known = {c.name: (c, h) for c, h in zip(fitted.comparisons, fitted.histories, strict=True)}
        found = []
        for path in self.test.data.paths:
            comparison, history = known[self.part(path.ratio)]
            assert isinstance(comparison.objective, StrainObjective)
            found.append(FittedPath(path, comparison.objective, history))
        return tuple(found)

    def data_files(self) -> Sequence[DataFile]:
        """The files; the rows that count are those of the paths that are matched."""
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
        """What makes the paths doubtful."""
        return doubts_of_biaxial(self.test, expected)
