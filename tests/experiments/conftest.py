"""Fixtures of the tests of experiments."""

from collections.abc import Callable
from functools import partial

import bubblefit as bf
import pytest
from bubblefit.experiments.strips.prepared import PreparedStrips

from ..builders.biaxial_tests import BENT_LAW, biaxial_project, biaxial_rows, write_biaxial_rows
from ..builders.load_histories import load_history, write_history
from ..builders.projects import edited_project
from .strips.cases import CURVES, PUBLISHED, prepared_strips

COARSE = ("increments = 100", "increments = 5")
Prepare = Callable[..., PreparedStrips]


@pytest.fixture
def plain_history_file(tmp_path):
    time, load, strain = load_history()
    return write_history(tmp_path / "strap.csv", ["time_s,load_N,strain"], (time, load, strain))


@pytest.fixture
def edited_bubble(tmp_path):
    return partial(edited_project, tmp_path)


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


@pytest.fixture
def published_strips(tmp_path) -> Prepare:
    (tmp_path / "curves.csv").write_bytes((CURVES / "curves.csv").read_bytes())
    return lambda *changes: prepared_strips(tmp_path, PUBLISHED, COARSE, *changes)
