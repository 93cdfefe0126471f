"""The charts of a page, from the data beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from bubblefit.reports.charts import Chart, Charts
from bubblefit.reports.content import read_page_data


def charts_of(folder: Path) -> dict[str, Sequence[Chart]]:
    """By name."""
    return {p.name: p.charts for p in read_page_data(folder).parts if isinstance(p, Charts)}
