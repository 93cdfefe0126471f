"""Fixtures of the tests of files and mistakes of real people."""

import pytest

from ..builders.bubbles import DOUBTED_LAW, inflated_bubble


@pytest.fixture(scope="session")
def export_file(tmp_path_factory):
    return tmp_path_factory.mktemp("strips") / "strip 3.csv"


@pytest.fixture(scope="session")
def clean_bubble():
    return inflated_bubble(DOUBTED_LAW)
