"""Fixtures of the tests of biaxial tests."""

import bubblefit as bf
import pytest
from bubblefit.experiments.biaxial.tables import read_biaxial_table

from ...builders.biaxial_tests import BENT_LAW, biaxial_project, biaxial_rows, write_biaxial_rows

ROWS = biaxial_rows(BENT_LAW, cycles=3, kept=0.02)


@pytest.fixture
def biaxial_table(tmp_path):
    return read_biaxial_table(write_biaxial_rows(tmp_path / "test.csv", ROWS))


@pytest.fixture(scope="session")
def five_ratios_folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("biaxial")
    write_biaxial_rows(place / "test.csv", biaxial_rows(BENT_LAW, cycles=2, kept=0.01))
    biaxial_project(place)
    return place


@pytest.fixture(scope="session")
def fitted_five_ratios(five_ratios_folder):
    found = bf.fit(bf.read_project(five_ratios_folder / "project.toml"), starts=1)
    found.report(five_ratios_folder / "out")
    return found
