"""Data of a page: strict JSON that is read back, and what is no page."""

import json
import re

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.reports.charts import Chart, Charts, line
from bubblefit.reports.content import (
    Exhibit,
    Facts,
    PageSection,
    Picture,
    Report,
    Table,
    Words,
    read_page_data,
    round_trip,
)
from bubblefit.reports.html import write_page, write_report

from ..builders.pages import full_report
from ..support.refusals import raised


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "is damaged"), ("[]", "is damaged"), ("{}", "is damaged"),
        ('{"layout": 99, "title": "x"}', "another version's layout: expected 1, got 99"),
        ('{"layout": 1, "title": 3}', "title"),
        ('{"layout": 1, "title": "x", "sections": [{"title": "s", "parts": [{"part": "?"}]}]}',
         "sections.0.parts.0"),
    ],
)  # fmt: skip
def test_data_that_are_no_page_are_refused(tmp_path, content, said):
    (tmp_path / "page.json").write_text(content)
    raised(InputError, re.escape(said), read_page_data, tmp_path)
    raised(InputError, r"page\.json.*cannot be read", read_page_data, tmp_path / "none")


def test_columns_without_a_value_are_left_out():
    rows = [["a", None, 0, None, "x"], ["b", None, None, None, "y"]]
    table = Table("T", ["test", "band", "notes", "knee", "ended"], rows, text=(1, 3, 4))
    shown = table.without_empty_columns()
    assert shown.header == ["test", "notes", "ended"] and shown.text == [2]
    assert shown.rows == [["a", 0, "x"], ["b", None, "y"]]


def test_parts_of_an_exhibit_begin_with_facts_below_its_title():
    table, words = Table("T", ["a"], [[1]]), Words(["b"])
    exhibit = Exhibit([("radius", 100)], [("a.png", "c")], [table], parts=[words])
    for title in ("", "one"):
        facts, *others = exhibit.all_parts(title)
        assert facts == Facts([("radius", 100)], title)
        assert others == [words, Picture("a.png", "c"), table]
    assert Exhibit(parts=[words]).all_parts() == [words]
    assert Exhibit().all_parts("one") == [Facts((), "one")]


def test_data_of_page_are_strict_json(full, tmp_path):
    chart = Chart("a", "x", "y", [line("b", [0, 1, np.nan], [np.inf, 2, 3])])
    table = Table("t", ["a"], [[np.float64("nan")], [np.int64(3)]])
    report = Report("x", sections=[PageSection("s", [Charts("c", [chart], ""), table])])
    write_report(tmp_path, report)
    content = json.loads((tmp_path / "page.json").read_text(), parse_constant=pytest.fail)
    charts, shown = content["sections"][0]["parts"]
    assert charts["charts"][0]["series"][0]["y"] == [None, 2.0, 3.0]
    assert shown["rows"] == [[None], [3]]
    again = write_page(full, read_page_data(full), tmp_path / "again.html").read_bytes()
    assert again == (full / "report.html").read_bytes()
    assert read_page_data(full) == round_trip(full_report())
