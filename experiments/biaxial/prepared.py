"""Biaxial tests in a fit: residuals, comparisons, and tests that could be made next."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError, SolverFailure
from ...inference.comparison import Comparison, NoiseIs
from ...materials.designers import RATIOS, shares
from ...materials.law import HypoelasticLaw
from ...materials.responses import biaxial_response, largest_load
from ...meshes.strip_models import elongations
from ...readers.frames import FrameSource
from ...solvers.base import History
from ..kinds import (
    Candidate,
    DataFile,
    Doubt,
    Expected,
    FittedTest,
    MakeSolver,
    Masks,
    Planning,
    Precision,
    Reach,
    Weighting,
)
from .data import BiaxialPath, BiaxialTable, Cycle
from .doubts import doubts_of_biaxial
from .section import BiaxialSection, TablesSection
from .test import BiaxialData, BiaxialTest, reach_of

Array = NDArray[np.float64]

#: Of one measured strain: what an extensometer or a camera on a cruciform is good for.
EXTENSOMETER = 1e-4
PERCENT = 100.0


class StrainObjective:
    """Residuals (model - measured) / (scale sqrt(n)) of n strains along warp, then fill.

    Strains count from the first load of the path. load, strain : (n, 2) N/mm and shares. scale :
    strain that counts as one. noise : of one measured strain; None: `EXTENSOMETER`.
    """

    #: What the residuals are in after `scale`.
    unit = "%"

    def __init__(
        self,
        load: ArrayLike,
        strain: ArrayLike,
        scale: float = 1.0,
        weight: float = 1.0,
        noise: float | None = None,
    ) -> None:
        self.load, self.strain = np.asarray(load, float), np.asarray(strain, float)
        if len(self.strain) < 2:
            raise InputError(None, "path", "expected two loads at least")
        self.least_noise = PERCENT * (EXTENSOMETER if noise is None else noise)
        self.noise_is: NoiseIs = "assumed" if noise is None else "given"
        # The first row is the zero of the others and matches whatever the law is.
        self.sizes = (len(self.strain) - 1,) * 2
        self._unit = scale * np.sqrt(len(self.strain) - 1) / weight

    @property
    def scale(self) -> Array:
        """Return % of strain in one unit of each residual, (2 n,)."""
        return np.full(sum(self.sizes), PERCENT * self._unit)

    @property
    def places(self) -> tuple[Array, ...]:
        """Return the load (n, 1) N/mm of each block's values: neighbours err as one."""
        return (self.load[1:].max(axis=1, keepdims=True),) * 2

    @property
    def data(self) -> tuple[Array, ...]:
        """Return everything measured that the residual depends on."""
        return self.load, self.strain

    def modelled(self, history: History) -> Array:
        """Return the model's strains (n, 2) since the beginning of the path."""
        own = elongations(history.displacement)
        return np.asarray(own - own[0])

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        """Return both blocks, (2 n,)."""
        return self._blocks(self.modelled(history) - self.strain)

    def jacobian(self, history: History, slope: Array) -> Array:
        """Return (2 n, parameters) from the slope of the displacements."""
        own = elongations(slope)
        return self._blocks(own - own[0])

    def nuisance_columns(self, names: Sequence[str]) -> Array:
        """Return (2 n, 0): there are no nuisance unknowns."""
        if names:
            raise InputError(None, "nuisance", f"a biaxial path knows no {', '.join(names)}")
        return np.empty((sum(self.sizes), 0))

    def of_points(self, values: Array) -> Array:
        """Return values for each residual from values for each load of the path."""
        return np.tile(values[1:], 2)

    def shifted(self, here: History, there: History) -> StrainObjective:
        """Return the objective of a model that shows `here` where this one shows `there`."""
        other = copy.copy(self)
        other.strain = self.strain - (self.modelled(here) - self.modelled(there))
        return other

    def rms(self, history: History) -> Array:
        """Return the RMS errors (2,) of the strains along warp and fill, %."""
        off = (self.modelled(history) - self.strain)[1:]
        return np.asarray(PERCENT * np.sqrt(np.mean(off**2, axis=0)))

    def _blocks(self, values: Array) -> Array:
        """Return rows (n, 2, ...) without the first as one column of values, the warp's first."""
        rows = np.swapaxes(values[1:], 0, 1)
        return np.asarray(rows.reshape(-1, *values.shape[2:]) / self._unit)


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
        """Return a comparison a ratio that masks leave; a patch hardly ever fails."""
        test, models = self.test, self.test.models()
        kept, found = self.kept(masks), []
        share = weighting.weight / (2 * max(1, len(kept))) if weighting.relative else 1.0
        for path in kept:
            largest = float(np.abs(path.since).max())
            if not largest > 0:
                raise test.place.error("data", f"the strains of ratio {path.ratio} are all zero")
            objective = StrainObjective(path.load, path.since, largest, share, test.noise)
            own = self.part(path.ratio), models[path.ratio], make_solver(), objective
            found.append(Comparison(*own, contracts=True))
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


#: Beside the five of designers' constants.
FURTHER = ("1:5", "5:1")
#: Loads of a path; values of a strain's curve that are taken to be independent where the project
#: has no biaxial test: an extensometer drifts, and errs alike along much of it.
LOADS, INDEPENDENT = 20, 5
#: Of the load at which a strain is at its end: where a path begins.
PRESTRESS = 0.05


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return each ratio by itself, up to the strains that the law is known for."""
    own = [test for test in planning.present if isinstance(test, PreparedBiaxial)]
    noise_is = "assumed" if not own else f"that of {own[0].test.name}"
    if planning.noise is not None:
        noise_is = "given"
    return [
        Candidate(f"biaxial {ratio}", partial(_made, ratio, own, planning), noise_is)
        for ratio in (*RATIOS, *FURTHER)
    ]


def _made(ratio: str, own: Sequence[PreparedBiaxial], planning: Planning) -> PreparedBiaxial:
    """Return the path with the strains that the law gives."""
    thickness = planning.place.fabric.thickness
    highest = largest_load(planning.law, thickness, [shares(ratio)], planning.ends[:2])
    if not highest > 0:
        raise SolverFailure(f"the law carries no load of ratio {ratio}", "membrane")
    loads = np.outer(np.linspace(PRESTRESS, 1.0, LOADS) * highest, shares(ratio))
    strain = biaxial_response(planning.law, loads, thickness).elongation
    table = BiaxialTable(
        Path("computed"), loads, strain, None, np.arange(LOADS), FrameSource("computed")
    )
    path = BiaxialPath(table, Cycle(ratio, 1, 1, 1, 0, LOADS - 1), 1, loads, strain)
    section = BiaxialSection(data=TablesSection(files=["computed"]))
    test = BiaxialTest(
        name=f"biaxial {ratio}",
        place=planning.place,
        weight=1.0,
        data=BiaxialData((table,), (), (path,)),
        section=section,
        noise=_noise(own, planning) / PERCENT,
    )
    return PreparedBiaxial(test)


def _noise(own: Sequence[PreparedBiaxial], planning: Planning) -> float:
    """Return the noise of independent strains, %."""
    if planning.noise is not None:
        return planning.noise
    known = [planning.precision[t.part(p.ratio)] for t in own for p in t.test.data.paths]
    if not known:
        return Precision(PERCENT * EXTENSOMETER, 1.0, INDEPENDENT).at(LOADS - 1)
    return max(one.at(LOADS - 1) for one in known)
