"""Fixtures of the tests of strips."""

import pytest

from ..conftest import Prepare
from .cases import SMALL, prepared_strips, write_exports

POINTS = ("[warp]", 'match = "points"\nincrements = 5\n[warp]')


@pytest.fixture
def exported_strips(tmp_path) -> Prepare:
    write_exports(tmp_path)
    return lambda *changes: prepared_strips(tmp_path, SMALL, POINTS, *changes)
