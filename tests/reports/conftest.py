"""What tests of figures share."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

from ..figure_checks import check_figure


@contextmanager
def _no_file(path: Path) -> Iterator[Path]:
    yield path


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Figure]]:
    """Every figure that would have been written, in turn, and looked at in the end."""
    drawn: list[Figure] = []

    def keep(self: Figure, *_: Any, **__: Any) -> None:
        self.draw_without_rendering()
        drawn.append(self)

    monkeypatch.setattr(Figure, "savefig", keep)
    monkeypatch.setattr("bubblefit.reports.style.replacing", _no_file)
    yield drawn
    for figure in drawn:
        check_figure(figure)
