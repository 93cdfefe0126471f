"""Presenter of fitted bending tests of cylinders: load of the collar over its deflection."""

from __future__ import annotations

from collections.abc import Mapping

from ...experiments.base import Findings, FittedTest, Weighting
from ...experiments.bending import BendingKind, BendingObjective, BendingTest, PreparedBending
from ...experiments.cylinder.test import PART
from ...experiments.data_files import Output
from ...experiments.forward import Cards, Runs, Simulation
from ...experiments.measured import compared, errors_of_cards
from ...lazy_modules import pandas as pd
from ...presenting import KINDS
from ...solvers.base import History
from ..charts import Chart, Charts, dots, line
from ..presenter import PagePresenter
from ..vega import save

FIGURE = "bending.png"
CAPTION = "Load of the collar over its deflection, measured and modelled"


def residuals(prepared: PreparedBending, fitted: FittedTest) -> pd.DataFrame:
    """Return a table of every matched load, N, measured and modelled, with its deflection."""
    objective = BendingObjective(prepared.test, Weighting())
    loads = objective.modelled(fitted.histories[0])
    labels = {"part": PART, "deflection_mm": objective.elongation}
    return compared("load", objective.measured, loads, "N", **labels)


def findings(prepared: PreparedBending, fitted: FittedTest) -> Findings:
    """Return the RMS error of the load with the fitted law, as numbers and in words."""
    numbers = _errors(prepared.test, fitted.histories[0])
    words = _words(numbers)
    return Findings(numbers, (), (words,), words, words)


def simulate(
    test: BendingTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
) -> Simulation:
    """Draw the loads modelled with each card beside the measured ones; return the RMS errors."""
    numbers, lines, histories = errors_of_cards(
        runs, lambda history: _errors(test, history) if test.measured else {}, _words
    )
    parts = [_load_charts(test, histories)] if histories else []
    for charts in parts:
        save(out.path(FIGURE), charts)
    errors = {
        name: errors["rms_N"] / errors["largest_N"]
        for name, errors in numbers.items()
        if "rms_N" in errors
    }
    return Simulation({"cards": numbers}, lines, parts, errors)


def _errors(test: BendingTest, history: History) -> dict[str, float]:
    """Return the RMS error of the load and the largest measured load, N."""
    objective = BendingObjective(test, Weighting())
    return {"rms_N": objective.rms(history), "largest_N": abs(objective.measured).max()}


def _words(numbers: Mapping[str, float]) -> str:
    """Return the RMS error of the load in words, with its share of the largest."""
    share = 100 * numbers["rms_N"] / numbers["largest_N"]
    return f"RMS error of the load {numbers['rms_N']:.3g} N ({share:.2g} % of the largest)"


def _load_charts(test: BendingTest, curves: Mapping[str, History]) -> Charts:
    """Return a chart of measured and modelled loads; `curves` are the results by name."""
    series = [dots(c.repetition, c.deflection, c.load, colour=7) for c in test.measured]
    for rank, (name, history) in enumerate(curves.items()):
        deflection = [0.0, *test.deflections][: len(history.load)]
        series.append(line(name, deflection, history.load, colour=1 + rank))
    chart = Chart(test.name, "deflection of the collar, mm", "load, N", series, CAPTION)
    return Charts(f"{test.name} bending", [chart], CAPTION, columns=1)


class BendingPresenter(PagePresenter):
    """Presenter of bent cylinders whose loads are fitted."""

    findings = staticmethod(findings)
    residuals = staticmethod(residuals)
    simulate = staticmethod(simulate)


KINDS.register(BendingKind, BendingPresenter())
