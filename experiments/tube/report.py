"""Results of tubes in tension and torsion as numbers, a table, a figure and a file."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from ...reports.charts import Chart, Charts, dots, line
from ...reports.content import Exhibit, Table
from ...reports.vega import saved
from ...solvers.base import History
from ..kinds import Cards, Findings, FittedTest, Output, Runs, Simulation
from ..measured import compared, errors_of_cards
from . import PART, PERCENT, PreparedTube, TubeObjective, TubeTest

NAMES = ("along the tube", "around the tube", "radius times twist")
FIGURE, CAPTION = "strains.png", "Strains about their means"


def residuals(prepared: PreparedTube, fitted: FittedTest) -> pd.DataFrame:
    """Return a table of every matched strain in %."""
    own = TubeObjective(prepared.test, 1.0)
    measured, modelled = PERCENT * own.measured, PERCENT * own.modelled(fitted.histories[0])
    where = {"part": PART, "row": np.arange(1, 1 + len(measured))}
    return pd.concat([
        compared(NAMES[column], measured[:, k], modelled[:, k], "%", **where)
        for k, column in enumerate(own.read)
    ], ignore_index=True)  # fmt: skip


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
    test: TubeTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
) -> Simulation:
    """Draw the strains with every card; return the RMS errors."""
    numbers, lines, good = errors_of_cards(
        runs, lambda history: {"rms_percent": _errors(test, history)},
        lambda found: f"RMS of strain in %: {_words(found['rms_percent'])}",
    )  # fmt: skip
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
