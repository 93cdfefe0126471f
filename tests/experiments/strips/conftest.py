"""Fixtures of the tests of strips."""

from collections.abc import Callable

import pytest
from bubblefit.experiments.strips.prepared import PreparedStrips

from .cases import CURVES, PUBLISHED, SMALL, prepared_strips, write_exports

COARSE = ("increments = 100", "increments = 5")
POINTS = ("[warp]", 'match = "points"\nincrements = 5\n[warp]')
Prepare = Callable[..., PreparedStrips]


@pytest.fixture
def published_strips(tmp_path) -> Prepare:
    (tmp_path / "curves.csv").write_bytes((CURVES / "curves.csv").read_bytes())
    return lambda *changes: prepared_strips(tmp_path, PUBLISHED, COARSE, *changes)


@pytest.fixture
def exported_strips(tmp_path) -> Prepare:
    write_exports(tmp_path)
    return lambda *changes: prepared_strips(tmp_path, SMALL, POINTS, *changes)
