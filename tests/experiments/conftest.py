"""Fixtures of the tests of experiments."""

import pytest

from ..builders.load_histories import load_history, write_history


@pytest.fixture
def plain_history_file(tmp_path):
    time, load, strain = load_history()
    return write_history(tmp_path / "strap.csv", ["time_s,load_N,strain"], (time, load, strain))
