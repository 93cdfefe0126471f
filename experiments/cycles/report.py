"""Results of load histories in a fit as numbers, a table, figures and a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from ...errors import SolverFailure
from ...reports.charts import Chart, Charts, dots, line
from ...reports.content import Exhibit, Table
from ...reports.vega import saved
from ...solvers.base import History
from ..kinds import READING, Cards, Findings, FittedTest, Output, Runs, Simulation
from ..measured import compared
from . import CyclesTest, PreparedCycles

FIGURE, CAPTION, TABLE = "cycles.png", "Loads over strain, measured and modelled", "cycles.csv"


def residuals(prepared: PreparedCycles, fitted: FittedTest) -> pd.DataFrame:
    """Return a table of every matched load, N from the reference load on."""
    return pd.concat([
        compared("load", p.data.load, p.history.load, "N", part=p.data.name, cycle=p.data.cycle,
                 strain=p.data.strain)
        for p in prepared.fitted_parts(fitted)
    ], ignore_index=True)  # fmt: skip


def _numbers(test: CyclesTest, histories: Mapping[str, History]) -> dict[str, dict[str, float]]:
    every = [(name, test.matched[name], history.load) for name, history in histories.items()]
    return {
        name: {f"cycle {k}": float(np.sqrt(np.mean((load - one.load)[one.cycle == k] ** 2)))
               for k in np.unique(one.cycle)}
        for name, one, load in every
    }  # fmt: skip


def _lines(numbers: Mapping[str, Mapping[str, float]]) -> list[str]:
    return [
        f"{name}: RMS error of load in N: {', '.join(f'{k} {v:.3g}' for k, v in own.items())}"
        for name, own in numbers.items()
    ]


def findings(prepared: PreparedCycles, fitted: FittedTest) -> Findings:
    """Return the RMS errors of the best fit, and the doubts about the histories."""
    of_fit = dict(zip(prepared.test.matched, fitted.histories, strict=True))
    numbers = _numbers(prepared.test, of_fit)
    histories = [one.evaluated for one in prepared.test.matched.values()]
    reading = [note for one in histories for note in one.notes if note.kind == READING]
    notes = [*reading, *prepared.data_notes]
    share = max(100 * p.rms / p.data.load.max() for p in prepared.fitted_parts(fitted))
    words = f"RMS error of load {share:.2g} % of the largest"
    return Findings({"rms_N": numbers}, tuple(notes), tuple(_lines(numbers)), words, words)


def show(prepared: PreparedCycles, fitted: FittedTest, found: Findings, out: Output) -> Exhibit:
    """Write cycles.csv and the figure."""
    of_fit = dict(zip(prepared.test.matched, fitted.histories, strict=True))
    charts = _drawn(prepared.test, {"model": of_fit})
    rows: list[list[object]] = [
        [name, cycle, error] for name, own in found.numbers["rms_N"].items()
        for cycle, error in own.items()
    ]  # fmt: skip
    table = Table("Misfit of the load cycles", ["specimen", "", "RMS error, N"], rows, text=(1,))
    loads = out.write(TABLE, residuals(prepared, fitted), "loads, measured and modelled")
    files = [loads, saved(out, FIGURE, charts, CAPTION)]
    return Exhibit(tables=[table], files=files, parts=[charts])


def simulate(
    test: CyclesTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
) -> Simulation:
    """Draw the loads with every card; return the RMS errors."""
    numbers: dict[str, Any] = {}
    lines: list[str] = []
    good: dict[str, dict[str, History]] = {}
    for card in cards:
        ended = {name: runs[card, name].outcome for name in test.matched}
        good[card] = {name: one for name, one in ended.items() if isinstance(one, History)}
        numbers[card] = {"rms_N": _numbers(test, good[card])}
        lines += [f"{card}: {words}" for words in _lines(numbers[card]["rms_N"])]
        for name, one in ended.items():
            if isinstance(one, SolverFailure):
                numbers[card].setdefault("failed", {})[name] = one.reason
                lines.append(f"{card}: {name}: failed: {one.reason}")
    figure = saved(out, FIGURE, _drawn(test, good), CAPTION)
    return Simulation({"cards": numbers}, lines, [figure])


def _drawn(test: CyclesTest, curves: Mapping[str, Mapping[str, History]]) -> Charts:
    """Return load over strain, a chart a specimen."""
    charts = []
    for name, one in test.matched.items():
        series = [dots("measured", 100 * one.strain, one.load, colour=7)]
        for rank, (label, own) in enumerate(curves.items()):
            if name in own:
                series.append(line(label, 100 * one.strain, own[name].load, colour=1 + rank))
        what = "strain from the reference load, %"
        charts.append(Chart(name, what, "load from the reference load, N", series, name))
    return Charts(f"{test.name} cycles", charts, CAPTION, columns=1)
