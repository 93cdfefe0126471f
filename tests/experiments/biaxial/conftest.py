"""Fixtures of the tests of biaxial tests."""

import pytest
from bubblefit.experiments.biaxial.paths import read_biaxial_table

from ...builders.biaxial_tests import BENT_LAW, biaxial_rows, write_biaxial_rows

ROWS = biaxial_rows(BENT_LAW, cycles=3, kept=0.02)


@pytest.fixture
def biaxial_table(tmp_path):
    return read_biaxial_table(write_biaxial_rows(tmp_path / "test.csv", ROWS))
