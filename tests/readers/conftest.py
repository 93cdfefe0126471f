"""Fixtures of the tests of readers."""

from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def export_file(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("exports") / "strip 3.csv"
