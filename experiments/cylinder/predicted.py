"""Cylinders with cards: what is kept of a run, and what runs say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...materials.card import MaterialCard
from ...models.cylinder import CylinderModel
from ...solvers.base import History
from ..base import CardRun, Simulation
from ..exhibit import Output
from ..predicted import PredictedRun
from ..records import record_of
from .outcome import CylinderOutcome
from .record import Array, arrays_of, depends_on, early_end
from .test import PART, CylinderTest


class CylinderPredicted:
    """How cylinders are predicted."""

    def depends_on(self, model: CylinderModel) -> Sequence[object]:
        """All of a model that its result depends on."""
        return depends_on(model)

    def arrays(self, model: CylinderModel, history: History) -> Mapping[str, Array]:
        """What is kept of a history; raises SolverFailure where it is cut off without a word."""
        return arrays_of(model, history)

    def early(self, model: CylinderModel, history: History) -> str:
        """The solver's own word for an end before the last deflection."""
        return early_end(model, history)

    def measured(self, test: CylinderTest) -> bool:
        """Whether a test has measured loads."""
        return bool(test.measured)

    def outcome(self, runs: Sequence[PredictedRun]) -> CylinderOutcome:
        """What runs say."""
        return CylinderOutcome(runs)


def simulate(
    test: CylinderTest,
    cards: Mapping[str, MaterialCard],
    runs: Mapping[tuple[str, str], CardRun],
    out: Output,
) -> Simulation:
    """load_deflection.csv, figures and beams; the numbers of every card."""
    kind, predicted = CylinderPredicted(), []
    for name, card in cards.items():
        run = runs[name, PART]
        record = record_of(kind, run.model, run.outcome)
        predicted.append(PredictedRun(test, name, card, run.model, record))
    outcome = CylinderOutcome(predicted)
    if outcome.measures:
        outcome.show(out)
    numbers = {
        run.card: {"ended": outcome.ended(i)}
        | (dict(outcome.numbers(i)) if i in outcome.measures else {})
        for i, run in enumerate(predicted)
    }
    return Simulation({"cards": numbers}, outcome.lines())
