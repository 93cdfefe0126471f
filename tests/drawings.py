"""What charts show, for the tests: numbers of their series, words of legends and axes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bubblefit.reports.charts import Chart, Charts, Series


def data(chart: Chart) -> list[np.ndarray]:
    """(2, k) of every series of lines or dots, in order; what is not there is NaN."""
    return [np.array([s.x, s.y], dtype=float) for s in chart.series if s.look in ("line", "dots")]


def named(chart: Chart) -> dict[str, Series]:
    """The series by name; of several with one name the first."""
    return {s.name: s for s in reversed(chart.series)}


def lines(chart: Chart, name: str) -> list[np.ndarray]:
    """(2, k) of every line or cloud of the name."""
    return [np.array([s.x, s.y], dtype=float) for s in chart.series if s.name == name and s.y]


def legend(charts: Charts) -> list[str]:
    """Names of all series, each once."""
    names = [s.name for chart in charts.charts for s in chart.series if s.name]
    return list(dict.fromkeys(names))


def shown(chart: Chart) -> tuple[str, str, str]:
    """Words of the axes, x and y, and the title."""
    return chart.x_label, chart.y_label, chart.title


def caught(patch: pytest.MonkeyPatch, module: Any, *names: str) -> list[tuple[Any, ...]]:
    """Calls of a module's declarations of charts that it saves: the file, then the arguments.

    Nothing is drawn.
    """
    calls: list[tuple[Any, ...]] = []

    def declared(*args: Any, **_: Any) -> tuple[Any, ...]:
        return args

    def saved(path: Path, args: tuple[Any, ...]) -> None:
        calls.append((path, *args))

    for name in names:
        patch.setattr(module, name, declared)
    save: Callable[..., None] = saved
    patch.setattr(module, "save", save)
    return calls


def check_convergence(
    charts: Charts, table: pd.DataFrame, what: str, rms: dict[str, Any] | None = None
) -> None:
    """The charts of one model show what convergence.csv has: changes over size, and the cost.

    rms : "rms_N" of the result, where the model has a load curve.
    """
    (model,) = set(table.model)
    changes, cost = charts.charts
    size = {"elements": "mean edge, mm", "increments": "step, share of the load"}[what]
    assert shown(changes) == (size, "change to the next finer level, %", model)
    assert shown(cost) == ("elements × increments", "seconds", "cost")
    assert changes.log_x and changes.log_y and cost.log_x and cost.log_y
    *names, first, second = [s.name for s in changes.series]
    assert [first, second] == ["order 1", "order 2"]
    for name, curve in zip(names, data(changes), strict=False):
        rows = table[table.quantity == name]
        if name == "RMS along the load curve":
            assert rms is not None
            change = 100 * np.array(rms["to_next_finer"]) / rms["largest_load"]
        else:
            change = 100 * np.abs(np.diff(rows.value) / rows.value.iloc[-1])
        drawn = change > 1e-5  # the solver's tolerance hides the rest
        sizes = np.sort(table["size"].unique())[::-1][:-1]
        seen = np.isfinite(curve[1])
        np.testing.assert_allclose(curve[:, seen], [sizes[drawn], change[drawn]], rtol=1e-5)
    assert (rms is not None) == ("RMS along the load curve" in names)
    levels = table.drop_duplicates("factor")
    work = levels.elements * levels.increments
    np.testing.assert_allclose(data(cost)[0], [work, levels.seconds], rtol=1e-5)
