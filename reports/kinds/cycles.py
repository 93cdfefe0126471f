"""Presenter of cyclic tests: load over strain in each cycle, measured and modelled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...errors import SolverFailure
from ...experiments.base import Findings, FittedTest
from ...experiments.cycles import CyclesKind, CyclesTest, PreparedCycles, Specimen
from ...experiments.data_files import READING, Output
from ...experiments.forward import Cards, Runs, Simulation
from ...experiments.measured import compared
from ...lazy_modules import pandas as pd
from ...presenting import KINDS
from ...solvers.base import History
from ..charts import Chart, Charts, dots, line
from ..content import Exhibit, Table
from ..presenter import PagePresenter
from ..vega import save, saved

FIGURE = "cycles.png"
CAPTION = "Loads over strain, measured and modelled"
TABLE = "cycles.csv"


def residuals(prepared: PreparedCycles, fitted: FittedTest) -> pd.DataFrame:
    """Return a table of every matched load, measured and modelled.

    Loads are in N, and loads and strains count from the reference load.
    """
    tables = []
    for part in prepared.fitted_parts(fitted):
        specimen = part.data
        labels = {"part": specimen.name, "cycle": specimen.cycle, "strain": specimen.strain}
        tables.append(compared("load", specimen.load, part.history.load, "N", **labels))
    return pd.concat(tables, ignore_index=True)


def _numbers(test: CyclesTest, histories: Mapping[str, History]) -> dict[str, dict[str, float]]:
    """Return the RMS error of the load by specimen and cycle, N."""
    errors = {}
    for name, history in histories.items():
        specimen = test.matched[name]
        difference = history.load - specimen.load
        errors[name] = {
            f"cycle {k}": np.sqrt(np.mean(difference[specimen.cycle == k] ** 2))
            for k in np.unique(specimen.cycle)
        }
    return errors


def _lines(numbers: Mapping[str, Mapping[str, float]]) -> list[str]:
    """Return the RMS errors in words, one line for each specimen."""
    lines = []
    for name, errors in numbers.items():
        words = ", ".join(f"{cycle} {error:.3g}" for cycle, error in errors.items())
        lines.append(f"{name}: RMS error of load in N: {words}")
    return lines


def findings(prepared: PreparedCycles, fitted: FittedTest) -> Findings:
    """Return the RMS errors with the fitted law, and the doubts about the measured histories."""
    of_fit = dict(zip(prepared.test.matched, fitted.histories, strict=True))
    numbers = _numbers(prepared.test, of_fit)
    histories = [specimen.evaluated for specimen in prepared.test.matched.values()]
    reading = [note for history in histories for note in history.notes if note.kind == READING]
    notes = [*reading, *prepared.data_notes]
    share = max(100 * p.rms / p.data.load.max() for p in prepared.fitted_parts(fitted))
    words = f"RMS error of load {share:.2g} % of the largest"
    return Findings({"rms_N": numbers}, tuple(notes), tuple(_lines(numbers)), words, words)


def show(prepared: PreparedCycles, fitted: FittedTest, findings: Findings, out: Output) -> Exhibit:
    """Write cycles.csv and the figure of the loads; return them and a table of the misfit."""
    histories = dict(zip(prepared.test.matched, fitted.histories, strict=True))
    charts = _load_charts(prepared.test, {"model": histories})
    rows = [
        [name, cycle, error]
        for name, errors in findings.numbers["rms_N"].items()
        for cycle, error in errors.items()
    ]
    table = Table("Misfit of the load cycles", ["specimen", "", "RMS error, N"], rows, text=(1,))
    loads = out.write(TABLE, residuals(prepared, fitted), "loads, measured and modelled")
    files = [loads, saved(out, FIGURE, charts, CAPTION)]
    return Exhibit(tables=[table], files=files, parts=[charts])


def simulate(
    test: CyclesTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
) -> Simulation:
    """Draw the loads modelled with each card beside the measured ones; return the RMS errors."""
    numbers: dict[str, Any] = {}
    lines = []
    histories: dict[str, dict[str, History]] = {}
    for card in cards:
        outcomes = {name: runs[card, name].outcome for name in test.matched}
        histories[card] = {n: run for n, run in outcomes.items() if isinstance(run, History)}
        numbers[card] = {"rms_N": _numbers(test, histories[card])}
        lines += [f"{card}: {words}" for words in _lines(numbers[card]["rms_N"])]
        for name, outcome in outcomes.items():
            if isinstance(outcome, SolverFailure):
                numbers[card].setdefault("failed", {})[name] = outcome.reason
                lines.append(f"{card}: {name}: failed: {outcome.reason}")
    charts = _load_charts(test, histories)
    save(out.path(FIGURE), charts)
    errors = {
        card: max(_relative_error(test.matched[name], history) for name, history in of_card.items())
        for card, of_card in histories.items()
        if of_card
    }
    return Simulation({"cards": numbers}, lines, [charts], errors)


def _relative_error(specimen: Specimen, history: History) -> float:
    """Return the RMS error of the load over the largest measured load."""
    difference = history.load - specimen.load
    return float(np.sqrt(np.mean(difference**2)) / specimen.load.max())


def _load_charts(test: CyclesTest, curves: Mapping[str, Mapping[str, History]]) -> Charts:
    """Return charts of load over strain, one for each specimen.

    `curves` : results by name of the card (or "model"), and by name of the specimen.
    """
    charts = []
    for name, specimen in test.matched.items():
        percent = 100 * specimen.strain
        series = [dots("measured", percent, specimen.load, colour=7)]
        for rank, (label, histories) in enumerate(curves.items()):
            if name in histories:
                series.append(line(label, percent, histories[name].load, colour=1 + rank))
        x_label = "strain from the reference load, %"
        y_label = "load from the reference load, N"
        charts.append(Chart(name, x_label, y_label, series, name))
    return Charts(f"{test.name} cycles", charts, CAPTION, columns=1)


class CyclesPresenter(PagePresenter):
    """Presenter of cyclic tests."""

    findings = staticmethod(findings)
    residuals = staticmethod(residuals)
    simulate = staticmethod(simulate)
    show = staticmethod(show)


KINDS.register(CyclesKind, CyclesPresenter())
