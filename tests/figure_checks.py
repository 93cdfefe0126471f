"""What holds for every chart: words and units, numbers that belong together, all of it in sight."""

from __future__ import annotations

from math import isfinite

from bubblefit.reports.charts import Chart, Charts, Series, axis_ends
from bubblefit.reports.vega import picture

#: Axes that are plain numbers, ratios or names.
WITHOUT_UNIT = ("nu12", "strain", "share", "objective", "order", "start", "form", "-2 log L",
                "test", "weight", "load / ", "left out", "elements", "seconds", "largest", "/ that",
                "stress error", "error", "e")  # fmt: skip


def check_charts(charts: Charts) -> None:
    """Check what is drawn; AssertionError with the place and what is wrong."""
    assert charts.charts and picture(charts)["marks"]
    for number, chart in enumerate(charts.charts):
        where = f"{charts.name}, chart {number} ({chart.title})"
        if not (chart.title or chart.series):
            continue  # a free place
        for label in (chart.x_label, chart.y_label):
            assert label and label == label.strip(), f"{where}: {label!r}"
            assert ", " in label or any(word in label for word in WITHOUT_UNIT) or len(label) <= 3
        for series in chart.series:
            _check_series(series, f"{where}: {series.name!r}")
        _check_ends(chart, where)


def _check_series(s: Series, where: str) -> None:
    if s.look == "faces":
        assert len(s.x) == len(s.y) and len(s.x) % len(s.values) == 0, where
        return
    for own in (s.y, s.lower, s.upper, s.values):
        assert len(own) in (0, len(s.x)), where
    assert len(s.lower) == len(s.upper), where
    assert s.y or s.upper or not s.x, where
    known = [(a, b) for a, b in zip(s.lower, s.upper, strict=True) if None not in (a, b)]
    assert all(a <= b for a, b in known), f"{where}: a band upside down"


def _check_ends(chart: Chart, where: str) -> None:
    """Axes hold every curve, unless they say that they show a part."""
    x, y = axis_ends(chart)
    for (low, high), log in ((x, chart.log_x), (y, chart.log_y)):
        assert isfinite(low) and isfinite(high) and low < high and (low > 0 or not log), where
    if chart.x_range or chart.y_range or chart.x_names:
        return
    for s in chart.series:
        known = [(a, b) for a, b in zip(s.x, s.y, strict=False) if None not in (a, b)]
        for a, b in known:
            assert x[0] <= a <= x[1] or (chart.log_x and a <= 0), f"{where}: x = {a} is not seen"
            assert y[0] <= b <= y[1] or (chart.log_y and b <= 0), f"{where}: y = {b} is not seen"
