"""A kind of test: the load per width that a data sheet states at one strain along a yarn.

[[datasheet]]
name = "supplier"
direction = "warp"
strain = 0.02
load_per_width = 12.4   # N/mm
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.kinds import (
    CardRun,
    Findings,
    FittedTest,
    MakeSolver,
    Masks,
    Output,
    Place,
    Reach,
    Refined,
    Simulation,
    Weighting,
)
from bubblefit.inference.comparison import Comparison
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import UniaxialModel, straight_strip
from bubblefit.readers.sections import Positive, Section
from bubblefit.reports.content import Exhibit
from bubblefit.solvers.base import Array, History
from pydantic import Field

#: mm: any strip of the same strain would do.
LENGTH, WIDTH, INCREMENTS = 100.0, 50.0, 20


class DatasheetSection(Section):
    """One [[datasheet]] of a project."""

    name: str | None = None
    weight: Annotated[float, Field(gt=0)] = 1.0
    direction: Literal["warp", "fill"]
    strain: Annotated[float, Field(gt=0, le=1)]
    load_per_width: Positive


@dataclass(frozen=True, kw_only=True)
class DatasheetTest:
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
        self, thickness: float | None = None, what: Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, UniaxialModel]:
        """One quad: the strain is the same everywhere."""
        thick = self.place.fabric.thickness if thickness is None else thickness
        steps = max(1, round(INCREMENTS * (factor if what == "increments" else 1.0)))
        end = LENGTH * (1 + self.strain)
        return {
            self.direction: straight_strip(
                self.direction, LENGTH, end, thick, WIDTH, steps, across=1, along=1
            )
        }

    def settings(self) -> Mapping[str, object]:
        """What a result depends on."""
        return {"direction": self.direction, "strain": self.strain, "weight": self.weight}


class LoadObjective:
    """The load of the last frame less the one stated, over the one stated: one block of one."""

    sizes = (1,)
    unit = "N"

    def __init__(self, load: float, weight: float) -> None:
        self.load, self.weight = load, weight
        # A data sheet is rounded to two or three digits.
        self.least_noise = 0.005 * load
        self.scale = np.array([load / weight])
        self.data = (np.array([load]),)

    def residual(self, history: History, nuisance: Mapping[str, float]) -> Array:
        """(1,)"""
        return np.array([(history.load[-1] - self.load) / self.scale[0]])

    def jacobian(self, history: History, slope: Array) -> Array:
        """(1, parameters) from the slope of the load."""
        if history.load_slope is None:
            raise InputError(None, "history", "the solver gives no derivatives of the load")
        return np.asarray(history.load_slope[-1:] / self.scale[0])

    def nuisance_columns(self, names: Sequence[str], nuisance: Mapping[str, float]) -> Array:
        """There is no nuisance."""
        return np.empty((1, 0))

    def shifted(self, here: History, there: History) -> "LoadObjective":
        """For a model that carries `here` where this one's carries `there`."""
        other = LoadObjective(self.load, self.weight)
        other.load = self.load - float(here.load[-1] - there.load[-1])
        return other


@dataclass(frozen=True)
class PreparedDatasheet:
    """The test in a fit."""

    test: DatasheetTest
    objective_is = "error of the load, of the one stated"
    known = None

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Nothing that could be left out."""
        return {}

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """The one load. It leads in: such a strip hardly ever fails."""
        (model,) = self.test.models().values()
        objective = LoadObjective(self.test.load, weighting.weight if weighting.relative else 1.0)
        return (Comparison(self.test.name, model, make_solver(), objective, contracts=True),)


class DatasheetReport:
    """Write and word the results of a data sheet."""

    def findings(self, prepared: PreparedDatasheet, fitted: FittedTest) -> Findings:
        """How far the best fit is from the sheet."""
        off = float(fitted.histories[0].load[-1]) / prepared.test.load - 1
        words = f"{off:+.2%} of the load stated"
        numbers = {"relative_error": off, "load_N": prepared.test.load}
        return Findings(numbers, (), (words,), words, words)

    def show(
        self, prepared: PreparedDatasheet, fitted: FittedTest, found: Findings, out: Output
    ) -> Exhibit:
        """Return the one fact: there is no figure."""
        return Exhibit(facts=[("data sheet", found.summary)])

    def residuals(self, prepared: PreparedDatasheet, fitted: FittedTest) -> pd.DataFrame:
        """The one matched value."""
        modelled, measured = float(fitted.histories[0].load[-1]), prepared.test.load
        return pd.DataFrame(
            {
                "part": [prepared.test.direction],
                "strain": [prepared.test.strain],
                "quantity": ["load"],
                "measured": [measured],
                "modelled": [modelled],
                "difference": [modelled - measured],
                "unit": ["N"],
            }
        )

    def simulate(
        self,
        test: DatasheetTest,
        cards: Mapping[str, MaterialCard],
        runs: Mapping[tuple[str, str], CardRun],
        out: Output,
        within_range: bool = False,
    ) -> Simulation:
        """The load of every card beside the one stated."""
        told: list[dict[str, Any]] = []
        lines = []
        for (card, _), run in runs.items():
            if isinstance(run.outcome, SolverFailure):
                told.append({"card": card, "failed": run.outcome.reason})
                lines.append(f"{card}: failed: {run.outcome.reason}")
                continue
            load = float(run.outcome.load[-1])
            told.append({"card": card, "load_N": load, "stated_N": test.load})
            lines.append(f"{card}: {load:.4g} N, stated {test.load:.4g} N")
        return Simulation({"cards": told}, lines)


class Datasheet:
    """[[datasheet]] of a project."""

    name = "datasheet"
    title = "the load per width of a data sheet"
    section = DatasheetSection
    fitted = True
    predicted = None
    studied = None
    report = DatasheetReport()

    def read(self, section: DatasheetSection, place: Place, name: str) -> DatasheetTest:
        """The test of a section."""
        return DatasheetTest(
            name=name,
            place=place,
            weight=section.weight,
            direction=section.direction,
            strain=section.strain,
            load_per_width=section.load_per_width,
        )

    def prepare(
        self, test: DatasheetTest, law: HypoelasticLaw, make_solver: MakeSolver
    ) -> PreparedDatasheet:
        """Return the test as it is: there is nothing to read or to compute."""
        return PreparedDatasheet(test)


#: The object that the entry point names.
KIND = Datasheet()
