"""Fixtures of the tests of files and mistakes of real people."""

import pytest


@pytest.fixture(scope="session")
def export_file(tmp_path_factory):
    return tmp_path_factory.mktemp("strips") / "strip 3.csv"
