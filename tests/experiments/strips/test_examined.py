"""What is seen of strips before a fit: every cell of the table of curves as they were read."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.kinds import Output
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.report import examine
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial

WAY = np.array([0.1, 1.0, 2.0, 4.0, 3.9])
LOAD = np.array([2.0, 50.0, 90.0, 160.0, 120.0])


def test_every_cell(tmp_path: Path) -> None:
    curve = LoadCurve("warp", "W1", WAY, LOAD, None)
    line = fit_load_polynomial(np.linspace(0, 6, 9), 30 * np.linspace(0, 6, 9), 1)
    test = SimpleNamespace(
        strips={
            "warp": Strip("warp", 20.0, 24.0, None, (curve,)),
            "fill": Strip("fill", 25.0, 30.0, line),
            "bias": Strip("bias", 20.0, 30.0),  # without data
        }
    )
    shown = examine(SimpleNamespace(test=test), Output(tmp_path, "s/"))
    assert shown.figures == [("s/curves.png", "load curves as they were read")]
    assert (tmp_path / "s" / "curves.png").is_file()
    (table,) = shown.tables
    assert table.header == [
        "direction", "specimen", "points", "first elongation, mm", "last, mm", "last strain",
        "first load, N", "largest load, N",
    ]  # fmt: skip
    first, second = table.rows
    assert first[:2] == ["warp", "W1"] and second[:2] == ["fill", "polynomial"]
    assert first[2:] == pytest.approx([5, 0.1, 3.9, np.log(23.9 / 20), 2.0, 160.0])
    assert second[2:] == pytest.approx([50, 0.0, 5.0, np.log(1.2), 0.0, 150.0])
    assert (table.title, table.text) == ("Load curves as read", (1,))
