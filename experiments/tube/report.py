"""Results of tubes in tension and torsion as numbers, a table, a figure and a file."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ...errors import SolverFailure
from ...materials.card import MaterialCard
from ...reports.charts import Chart, Charts, dots, line
from ...reports.content import Exhibit, Table
from ...reports.vega import saved
from ...solvers.base import History
from ..kinds import CardRun, Findings, FittedTest, Output, Simulation
from . import PART, PERCENT, PreparedTube, TubeObjective, TubeTest

NAMES = ("along the tube", "around the tube", "radius times twist")
FIGURE, CAPTION = "strains.png", "Strains about their means"


def residuals(prepared: PreparedTube, fitted: FittedTest) -> pd.DataFrame:
    """Return a table of every matched strain in %."""
    objective, history = TubeObjective(prepared.test, 1.0), fitted.histories[0]
    modelled, parts = objective.modelled(history), []
    for k, column in enumerate(objective.read):
        table = pd.DataFrame({"part": PART, "row": np.arange(1, 1 + len(modelled))})
        table["quantity"] = NAMES[column]
        table["measured"] = PERCENT * objective.measured[:, k]
        table["modelled"] = PERCENT * modelled[:, k]
        parts.append(table.assign(difference=table["modelled"] - table["measured"], unit="%"))
    return pd.concat(parts, ignore_index=True)


def findings(prepared: PreparedTube, fitted: FittedTest) -> Findings:
    """Return the RMS errors of the best fit."""
    errors = _errors(prepared.test, fitted.histories[0])
    words = f"RMS errors of strain in %: {_words(errors)}"
    return Findings({"rms_percent": errors}, (), (words,), words, words)


def show(prepared: PreparedTube, fitted: FittedTest, found: Findings, out: Output) -> Exhibit:
    """Write strains.csv and the figure."""
    charts = _drawn(prepared.test, {"model": fitted.histories[0]})
    rows: list[list[object]] = [[*row] for row in found.numbers["rms_percent"].items()]
    strains = residuals(prepared, fitted)
    table = out.write("strains.csv", strains, "strains, measured and modelled")
    files = [table, saved(out, FIGURE, charts, CAPTION)]
    tables = [Table("Misfit of the tube", ["strain", "RMS error, %"], rows)]
    return Exhibit(tables=tables, files=files, parts=[charts])


def simulate(
    test: TubeTest, cards: Mapping[str, MaterialCard], runs: Mapping[tuple[str, str], CardRun],
    out: Output, within_range: bool = False,
) -> Simulation:  # fmt: skip
    """Draw the strains with every card; return the RMS errors."""
    ended = {name: runs[name, PART].outcome for name in cards}
    good = {name: one for name, one in ended.items() if isinstance(one, History)}
    numbers: dict[str, Any] = {name: {"rms_percent": _errors(test, h)} for name, h in good.items()}
    lines = [f"{name}: RMS of strain in %: {_words(_errors(test, h))}" for name, h in good.items()]
    for name, failure in ended.items():
        if isinstance(failure, SolverFailure):
            numbers[name] = {"failed": failure.reason}
            lines.append(f"{name}: failed: {failure.reason}")
    figures = [saved(out, FIGURE, _drawn(test, good), CAPTION)] if good else []
    return Simulation({"cards": numbers}, lines, figures)


def _errors(test: TubeTest, history: History) -> dict[str, float]:
    own = TubeObjective(test, 1.0)
    return dict(zip([NAMES[k] for k in own.read], own.rms(history).tolist(), strict=True))


def _words(errors: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {error:.3g}" for name, error in errors.items())


def _drawn(test: TubeTest, curves: Mapping[str, History]) -> Charts:
    """Return measured and modelled strains row by row, a chart a strain."""
    charts, rows, own = [], np.arange(1, 1 + len(test.loads)), TubeObjective(test, 1.0)
    for k, column in enumerate(own.read):
        series = [dots("measured", rows, PERCENT * own.measured[:, k], colour=7)]
        for rank, (name, history) in enumerate(curves.items()):
            series.append(line(name, rows, PERCENT * own.modelled(history)[:, k], colour=1 + rank))
        what = f"strain {NAMES[column]}, %"
        charts.append(Chart(NAMES[column], "row of the file", what, series, f"{test.name}: {what}"))
    return Charts(f"{test.name} strains", charts, CAPTION, columns=1)
