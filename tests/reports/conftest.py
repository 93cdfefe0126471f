"""A whole page, written once; real drawings."""

import pytest
from bubblefit.reports import vega
from bubblefit.reports.converter import convert
from bubblefit.reports.html import write_report

from ..builders.pages import drawn, full_report


@pytest.fixture(autouse=True, scope="module")
def drawn_anew():
    """Draw every chart, also one of a kind that was drawn for another test."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(vega, "convert", convert)
        yield


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    folder = tmp_path_factory.mktemp("full")
    drawn(folder)
    return write_report(folder, full_report()).parent
