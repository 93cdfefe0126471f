"""Charts of tests: numbers of their series, words of legends and axes, and what holds for all."""

from math import isfinite

import numpy as np
from bubblefit.reports.charts import Charts, axis_ends
from bubblefit.reports.content import read_page_data
from bubblefit.reports.vega import picture

WITHOUT_UNIT = ("nu12", "strain", "share", "objective", "order", "start", "form", "-2 log L",
                "test", "weight", "load / ", "left out", "elements", "seconds", "largest", "/ that",
                "stress error", "error", "analysis", "e")  # fmt: skip


def charts_of(folder):
    return {p.name: p.charts for p in read_page_data(folder).parts if isinstance(p, Charts)}


def data(chart):
    return [np.array([s.x, s.y], dtype=float) for s in chart.series if s.look in ("line", "dots")]


def named(chart):
    return {s.name: s for s in reversed(chart.series)}


def lines(chart, name):
    return [np.array([s.x, s.y], dtype=float) for s in chart.series if s.name == name and s.y]


def legend(charts):
    return list(dict.fromkeys(s.name for chart in charts.charts for s in chart.series if s.name))


def shown(chart):
    return chart.x_label, chart.y_label, chart.title


class Arguments(tuple):
    """Arguments of a call that would make charts, in place of the charts."""

    caption = ""


def caught(patch, module, *names):
    """Return a list that gets path and arguments of every figure that `module` saves."""
    calls = []
    save_charts = getattr(module, "saved", None)

    def saved(out, name, args, caption):
        if not isinstance(args, Arguments):
            return save_charts(out, name, args, caption)
        calls.append((out.path(name), *args))
        return name, caption

    for name in names:
        patch.setattr(f"{module.__name__}.{name}", lambda *args, **_: Arguments(args))
    patch.setattr(module, "save", lambda path, args: calls.append((path, *args)))
    patch.setattr(module, "saved", saved, raising=False)
    return calls


def check_convergence(charts, table, what, rms=None):
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


def check_charts(charts):
    """What holds for every chart: words and units, numbers that belong together, all in sight."""
    assert charts.charts and picture(charts)["marks"]
    for number, chart in enumerate(charts.charts):
        where = f"{charts.name}, chart {number} ({chart.title})"
        if not (chart.title or chart.series):
            continue  # a free place
        for label in (chart.x_label, chart.y_label):
            assert label and label == label.strip(), f"{where}: {label!r}"
            assert ", " in label or any(word in label for word in WITHOUT_UNIT) or len(label) <= 3
        for series in chart.series:
            own = f"{where}: {series.name!r}"
            if series.look == "faces":
                count = len(series.x)
                assert count == len(series.y) and count % len(series.values) == 0, own
                continue
            for values in (series.y, series.lower, series.upper, series.values):
                assert len(values) in (0, len(series.x)), own
            ends = list(zip(series.lower, series.upper, strict=True))
            assert series.y or series.upper or not series.x, own
            assert all(a <= b for a, b in ends if None not in (a, b)), f"{own}: upside down"
        x, y = axis_ends(chart)
        y = y[::-1] if chart.y_names else y  # from the top down
        for (low, high), log in ((x, chart.log_x), (y, chart.log_y)):
            assert isfinite(low) and isfinite(high) and low < high and (low > 0 or not log), where
        if chart.x_range or chart.y_range or chart.y_names:
            continue
        for a, b in ((a, b) for s in chart.series for a, b in zip(s.x, s.y, strict=False)):
            if a is None or b is None:
                continue
            assert x[0] <= a <= x[1] or (chart.log_x and a <= 0), f"{where}: x = {a} is not seen"
            assert y[0] <= b <= y[1] or (chart.log_y and b <= 0), f"{where}: y = {b} is not seen"
