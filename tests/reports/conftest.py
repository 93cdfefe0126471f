"""A whole page, written once."""

import pytest
from bubblefit.reports.html import write_report

from ..builders.pages import drawn, full_report


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    folder = tmp_path_factory.mktemp("full")
    drawn(folder)
    return write_report(folder, full_report()).parent
