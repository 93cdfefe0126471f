"""Presenter of tubes under pressure, tension and torsion: strains, measured and modelled."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...experiments.base import Findings, FittedTest
from ...experiments.data_files import Output
from ...experiments.forward import Cards, Runs, Simulation
from ...experiments.measured import PERCENT, compared, errors_of_cards
from ...experiments.tube import PART, PreparedTube, TubeKind, TubeObjective, TubeTest
from ...lazy_modules import pandas as pd
from ...presenting import KINDS
from ...solvers.base import History
from ..charts import Chart, Charts, dots, line
from ..content import Exhibit, Table
from ..presenter import PagePresenter
from ..vega import save, saved

NAMES = ("along the tube", "around the tube", "radius times twist")
FIGURE = "strains.png"
CAPTION = "Strains about their means"


def residuals(prepared: PreparedTube, fitted: FittedTest) -> pd.DataFrame:
    """Return a table of every matched strain in %."""
    objective = TubeObjective(prepared.test, 1.0)
    measured = PERCENT * objective.measured_strain
    modelled = PERCENT * objective.modelled(fitted.histories[0])
    labels = {"part": PART, "row": np.arange(1, 1 + len(measured))}
    tables = [
        compared(NAMES[column], measured[:, k], modelled[:, k], "%", **labels)
        for k, column in enumerate(objective.components)
    ]
    return pd.concat(tables, ignore_index=True)


def findings(prepared: PreparedTube, fitted: FittedTest) -> Findings:
    """Return the RMS errors of the strains with the fitted law, as numbers and in words."""
    errors = _errors(prepared.test, fitted.histories[0])
    words = f"RMS errors of strain in %: {_words(errors)}"
    return Findings({"rms_percent": errors}, (), (words,), words, words)


def show(prepared: PreparedTube, fitted: FittedTest, findings: Findings, out: Output) -> Exhibit:
    """Write strains.csv and the figure of the strains; return them and a table of the misfit."""
    charts = _strain_charts(prepared.test, {"model": fitted.histories[0]})
    rows = [[*row] for row in findings.numbers["rms_percent"].items()]
    strains = residuals(prepared, fitted)
    strains_file = out.write("strains.csv", strains, "strains, measured and modelled")
    files = [strains_file, saved(out, FIGURE, charts, CAPTION)]
    tables = [Table("Misfit of the tube", ["strain", "RMS error, %"], rows)]
    return Exhibit(tables=tables, files=files, parts=[charts])


def simulate(
    test: TubeTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
) -> Simulation:
    """Draw the strains modelled with each card beside the measured ones; return the RMS errors."""
    numbers, lines, histories = errors_of_cards(
        runs,
        lambda history: {"rms_percent": _errors(test, history)},
        lambda errors: f"RMS of strain in %: {_words(errors['rms_percent'])}",
    )
    parts = [_strain_charts(test, histories)] if histories else []
    for charts in parts:
        save(out.path(FIGURE), charts)
    errors = {name: _relative_error(test, history) for name, history in histories.items()}
    return Simulation({"cards": numbers}, lines, parts, errors)


def _errors(test: TubeTest, history: History) -> dict[str, float]:
    """Return the RMS error of each measured strain, %."""
    objective = TubeObjective(test, 1.0)
    names = [NAMES[k] for k in objective.components]
    return dict(zip(names, objective.rms(history).tolist(), strict=True))


def _relative_error(test: TubeTest, history: History) -> float:
    """Return the largest RMS error of a strain over that strain's largest measured value."""
    objective = TubeObjective(test, 1.0)
    largest = np.abs(objective.measured_strain).max(axis=0)
    return float((objective.rms(history) / PERCENT / largest).max())


def _words(errors: Mapping[str, float]) -> str:
    """Return the errors by name in words."""
    return ", ".join(f"{name} {error:.3g}" for name, error in errors.items())


def _strain_charts(test: TubeTest, curves: Mapping[str, History]) -> Charts:
    """Return charts of measured and modelled strains over the rows of the data file.

    There is one chart for each component of strain; `curves` are the results by name.
    """
    charts = []
    rows = np.arange(1, 1 + len(test.loads))
    objective = TubeObjective(test, 1.0)
    for k, column in enumerate(objective.components):
        series = [dots("measured", rows, PERCENT * objective.measured_strain[:, k], colour=7)]
        for rank, (name, history) in enumerate(curves.items()):
            strain = PERCENT * objective.modelled(history)[:, k]
            series.append(line(name, rows, strain, colour=1 + rank))
        label = f"strain {NAMES[column]}, %"
        alt = f"{test.name}: {label}"
        charts.append(Chart(NAMES[column], "row of the file", label, series, alt))
    return Charts(f"{test.name} strains", charts, CAPTION, columns=1)


class TubePresenter(PagePresenter):
    """Presenter of tubes."""

    findings = staticmethod(findings)
    residuals = staticmethod(residuals)
    simulate = staticmethod(simulate)
    show = staticmethod(show)


KINDS.register(TubeKind, TubePresenter())
