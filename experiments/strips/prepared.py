"""A test of strips in a fit: what is compared, and what a finished fit shows of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from ...identification.comparison import Comparison
from ...materials.law import HypoelasticLaw
from ...models.uniaxial import UniaxialModel
from ...solvers.base import History
from ..base import MakeSolver, Reach
from ..data_files import DataFile, joined
from ..doubts import Doubt, Expected
from ..exhibit import Exhibit, Output
from ..fittable import Findings, FittedTest, Masks, Weighting
from .doubts import doubts_of_strips
from .independent import loads_alike
from .objective import Array, LoadObjective
from .strip import Strip
from .test import StripsTest, reach_of

OBJECTIVES = {
    "N": "sum of the strips' RMS errors, N",
    "relative": "sum of the strips' RMS errors over their largest load",
}
#: Strips along the yarns lead in: they are homogeneous and hardly ever fail; a bias strip can at
#: its first increment.
STRAIGHT, BIAS = 0, 1


@dataclass(frozen=True, eq=False)
class FittedStrip:
    """One strip of a finished fit: what was measured, and what the best law makes of it."""

    strip: Strip
    model: UniaxialModel
    objective: LoadObjective
    history: History

    @property
    def direction(self) -> str:
        """warp, fill or bias."""
        return self.strip.direction

    @property
    def rms(self) -> float:
        """Of the load error, N."""
        return self.objective.rms(self.history)


@dataclass(frozen=True, eq=False)
class PreparedStrips:
    """The test: its curves were read with its section."""

    test: StripsTest

    @property
    def objective_is(self) -> str:
        """What is minimised, in words."""
        return OBJECTIVES[self.test.objective]

    @property
    def known(self) -> HypoelasticLaw | None:
        """None: loads are measured, not computed."""
        return None

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Number of the specimen of each measured point that is matched, by comparison."""
        test = self.test
        if test.match_by != "points":
            return {}
        return {self.part(d): test.strips[d].specimen_of.tolist() for d in test.matched}

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Directions, and specimens of a direction that has several."""
        from .parts import parts_of

        return parts_of(self)

    def reach(self, masks: Masks) -> Reach:
        """What the points matched say of the law."""
        by_direction = {d: masks.get(self.part(d)) for d in self.test.matched}
        return reach_of(self.test, by_direction)

    def kept(self, masks: Masks | None) -> tuple[str, ...]:
        """The directions of which masks leave anything to match."""
        known = masks or {}
        return tuple(d for d in self.test.matched if known.get(self.part(d), np.True_).any())

    def part(self, direction: str) -> str:
        """The name of the comparison of a direction."""
        return f"{self.test.name}: {direction}"

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """One a direction, without those whose weight is zero, or of which nothing is left.

        Raises
        ------
        InputError : nothing was measured, or no load at all.
        """
        test, models = self.test, self.test.models()
        share, kept = weighting.weight, self.kept(masks)
        if weighting.relative and kept:
            share /= sum(test.weights[d] for d in kept)
        relative = weighting.relative or test.objective == "relative"
        return tuple(
            Comparison(
                self.part(direction),
                models[direction],
                make_solver(),
                self._objective(models[direction], direction, relative, share, masks or {}),
                stage=BIAS if direction == "bias" else STRAIGHT,
                contracts=True,
                # A law of logarithmic strain lets yarns slide beside each other where half the
                # stress along them is more than G12 (docs/reference/law.md): fabrics do not.
                must_be_stable=False,
            )
            for direction in kept
        )

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """The same loads on other quads; the increments hardly matter (a bar has their limit)."""
        models = self.test.models(what="elements", factor=factor)
        own = self.comparisons(make_solver, weighting)
        return tuple(
            replace(comparison, model=models[direction])
            for comparison, direction in zip(own, self.test.matched, strict=True)
        )

    def _objective(
        self, model: UniaxialModel, direction: str, relative: bool, share: float, masks: Masks
    ) -> LoadObjective:
        test, strip = self.test, self.test.strips[direction]
        elongation, load = loads_to_match(test, strip, model)
        alike = loads_alike(strip, len(load), test.noise, test.specimens)
        whose = strip.specimen_of if test.match_by == "points" else None
        mask = masks.get(self.part(direction))
        if mask is not None:
            elongation, load = elongation[mask], load[mask]
            whose = None if whose is None else whose[mask]
        largest = float(np.abs(load).max(initial=0.0))
        if relative and not largest > 0:
            raise test.place.error(direction, "the measured load is zero")
        scale = largest if relative else 1.0
        weight = share * test.weights[direction]
        noise = strip.noise(largest, test.noise)
        return LoadObjective(
            model.elongations, elongation, load, scale, weight, *noise, alike, whose
        )

    def fitted_strips(self, fitted: FittedTest) -> tuple[FittedStrip, ...]:
        """The strips that a fit matched, each with its model, objective and history."""
        known = {c.name: (c, h) for c, h in zip(fitted.comparisons, fitted.histories, strict=True)}
        strips = []
        for direction in self.test.matched:
            comparison, history = known[self.part(direction)]
            objective = comparison.objective
            assert isinstance(objective, LoadObjective)
            strip = self.test.strips[direction]
            strips.append(FittedStrip(strip, comparison.model, objective, history))
        return tuple(strips)

    def data_files(self) -> Sequence[DataFile]:
        """The files of the curves that are matched."""
        points = self.test.match_by == "points"
        return joined(
            file for d in self.test.matched for file in self.test.strips[d].data_files(points)
        )

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        """What makes the load curves doubtful."""
        test = self.test
        return doubts_of_strips(test.strips, test.width, test.thickness, expected)

    def examine(self, out: Output) -> Exhibit:
        """The load curves as they were read."""
        from .examined import exhibit

        return exhibit(self.test, out)

    def findings(self, fitted: FittedTest) -> Findings:
        """What the best fit means for this test."""
        from .findings import findings_of

        return findings_of(self.test, self.fitted_strips(fitted))

    def show(self, fitted: FittedTest, findings: Findings, out: Output) -> Exhibit:
        """Write load curves, the deformed bias strip, moduli, orders and loads.csv."""
        from .exhibit import exhibit

        return exhibit(self.test, self.fitted_strips(fitted), fitted, out)

    def residuals(self, fitted: FittedTest) -> pd.DataFrame:
        """Every matched load, see `tables.residual_table`."""
        from .tables import residual_table

        return residual_table(self.fitted_strips(fitted))


def loads_to_match(test: StripsTest, strip: Strip, model: UniaxialModel) -> tuple[Array, Array]:
    """Elongation (n,) mm and load (n,) N: the points, or the polynomial at the increments."""
    if test.match_by == "points":
        return strip.points
    if strip.polynomial is None:
        raise test.place.error("data", "the load curves are not there")
    elongation = np.array(model.elongations)
    return elongation, strip.polynomial(elongation)
