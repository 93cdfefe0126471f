"""A kind of test: the load per width that a data sheet states at one strain along a yarn.

[[datasheet]]
name = "supplier"
direction = "warp"
strain = 0.02
load_per_width = 12.4   # N/mm
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from bubblefit.experiments.base import (
    BaseTest,
    Findings,
    FittedTest,
    MakeSolver,
    Masks,
    Reach,
    Refined,
    Weighting,
)
from bubblefit.experiments.data_files import Output
from bubblefit.experiments.forward import CardRun, Simulation
from bubblefit.experiments.measured import (
    MeasuredKind,
    PreparedWhole,
    compared,
    errors_of_cards,
)
from bubblefit.experiments.sections import Place
from bubblefit.experiments.strips.load_objective import StripObjective
from bubblefit.inference.comparison import Comparison
from bubblefit.materials.card import MaterialCard
from bubblefit.meshes.strip_models import UniaxialModel, straight_strip
from bubblefit.readers.sections import Positive, Section
from bubblefit.solvers.base import History
from pydantic import Field

#: mm: any strip of the same strain would do. A data sheet is rounded to two or three digits.
LENGTH, WIDTH, INCREMENTS, ROUNDED = 100.0, 50.0, 20, 0.005


class DatasheetSection(Section):
    """One [[datasheet]] of a project."""

    name: str | None = None
    weight: Annotated[float, Field(gt=0)] = 1.0
    direction: Literal["warp", "fill"]
    strain: Annotated[float, Field(gt=0, le=1)]
    load_per_width: Positive


@dataclass(frozen=True, kw_only=True)
class DatasheetTest(BaseTest):
    """A section as read; load_per_width in N/mm. It is all there is: the data are the section."""

    name: str
    place: Place
    weight: float
    direction: Literal["warp", "fill"]
    strain: float
    load_per_width: float
    kind: str = "datasheet"

    @property
    def load(self) -> float:
        """N of the strip."""
        return self.load_per_width * WIDTH

    @property
    def reach(self) -> Reach:
        """The strain of the sheet; the other strains it does not tell."""
        end = float(np.log1p(self.strain))
        return Reach((end, None, None) if self.direction == "warp" else (None, end, None))

    def models(
        self, thickness: float | None = None, refined: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, UniaxialModel]:
        """One quad: the strain is the same everywhere."""
        thick = self.place.fabric.thickness if thickness is None else thickness
        steps = max(1, round(INCREMENTS * (factor if refined == "increments" else 1.0)))
        end = LENGTH * (1 + self.strain)
        return {
            self.direction: straight_strip(
                self.direction, LENGTH, end, thick, WIDTH, steps, across=1, along=1
            )
        }

    def settings(self) -> Mapping[str, object]:
        """What a result depends on."""
        return {"direction": self.direction, "strain": self.strain, "weight": self.weight}


class PreparedDatasheet(PreparedWhole):
    """The test in a fit."""

    objective_is = "error of the load, of the one stated"

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """The one load. It leads in: such a strip hardly ever fails."""
        (model,) = self.test.models().values()
        load, weight = self.test.load, weighting.weight if weighting.relative else 1.0
        given = model.elongations, model.elongations[-1:], [load], load, weight, ROUNDED * load
        objective = StripObjective(*given)
        return (Comparison(self.test.name, model, make_solver(), objective, contracts=True),)


class DatasheetReport:
    """Word the results of a data sheet; there is no figure, and so no `show`."""

    def findings(self, prepared: PreparedDatasheet, fitted: FittedTest) -> Findings:
        """How far the best fit is from the sheet."""
        off = float(fitted.histories[0].load[-1]) / prepared.test.load - 1
        words = f"{off:+.2%} of the load stated"
        numbers = {"relative_error": off, "load_N": prepared.test.load}
        return Findings(numbers, (), (words,), words, words)

    def residuals(self, prepared: PreparedDatasheet, fitted: FittedTest) -> pd.DataFrame:
        """The one matched value."""
        test, modelled = prepared.test, fitted.histories[0].load[-1:]
        where = {"part": test.direction, "strain": test.strain}
        return compared("load", [test.load], modelled, "N", **where)

    def simulate(
        self,
        test: DatasheetTest,
        cards: Mapping[str, MaterialCard],
        runs: Mapping[tuple[str, str], CardRun],
        out: Output,
        within_range: bool = False,
    ) -> Simulation:
        """The load of every card beside the one stated."""

        def numbers(history: History) -> dict[str, Any]:
            return {"load_N": float(history.load[-1]), "stated_N": test.load}

        def words(found: dict[str, Any]) -> str:
            return "{load_N:.4g} N, stated {stated_N:.4g} N".format(**found)

        told, lines, _ = errors_of_cards(runs, numbers, words)
        return Simulation({"cards": told}, lines)


class Datasheet(MeasuredKind):
    """[[datasheet]] of a project: there is nothing to read but the section."""

    name = "datasheet"
    title = "the load per width of a data sheet"
    section = DatasheetSection
    prepared = PreparedDatasheet
    report = DatasheetReport()

    def read(self, section: DatasheetSection, place: Place, name: str) -> DatasheetTest:
        """The test of a section."""
        return DatasheetTest(**{**section.model_dump(), "name": name}, place=place)


#: The object that the entry point names.
KIND = Datasheet()
