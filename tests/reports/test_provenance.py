"""Provenance on a page: date and fabric, runs, solver and data files, and the citation."""

from datetime import date
from pathlib import Path
from types import SimpleNamespace

import pytest
from bubblefit.reports.content import Listing, Words
from bubblefit.reports.provenance import about_of, citation, record_tables
from bubblefit.runs.folder import DIGITS, Provenance
from bubblefit.version import __version__

RUN = {
    "date": "2026-03-01T10:00:00",
    "command_line": ["bubblefit", "fit", "project.toml"],
    "machine": {"system": "Linux", "cores": 2},
    "versions": {"bubblefit": "1.0", "numpy": "2.0"},
}
FILE = {
    "test": "bubble",
    "name": "frame.csv",
    "sha256": "0123456789abcdef" * 4,
    "format": "plain",
    "columns": {"x": "X [mm]", "u": "dx"},
    "units": {"x": "mm"},
    "rows_used": 90,
    "rows_dropped": {"not a number": 10},
}


def record(**changes):
    parts = {
        "project": Path("/tests/project.toml"),
        "text": "",
        "settings": {},
        "data": [FILE],
        "solver": {"name": "calculix", "version": "ccx 2.21", "threads": "1", "mesh": ""},
        "runs": [RUN],
    }
    return Provenance(**{**parts, **changes})


def project(lab):
    return SimpleNamespace(title="a fabric", fabric=SimpleNamespace(thickness=0.81, lab=lab))


@pytest.mark.parametrize("lab", ["L 7", ""])
def test_head_of_page_has_date_of_last_run_fabric_and_laboratory(lab):
    later = {**RUN, "date": "2026-04-02T08:00:00"}
    about = dict(about_of(project(lab), record(runs=[RUN, later])))
    assert about["date"] == "2026-04-02"
    assert about["fabric"] == "a fabric, 0.81 mm"
    assert about.get("laboratory", "") == lab


def test_date_without_a_record_is_today():
    assert dict(about_of(project(""), None))["date"] == str(date.today())


def test_record_lists_command_machine_versions_and_solver():
    runs, files = record_tables(record())
    rows = dict(runs.rows)
    assert rows["project file"] == str(Path("/tests/project.toml"))
    assert rows["command"] == "bubblefit fit project.toml"
    assert rows["machine"] == "Linux, 2"
    assert rows["versions"] == "bubblefit 1.0, numpy 2.0"
    assert rows["solver"] == "ccx 2.21; threads = 1"
    assert "to be run again" in runs.note
    assert files.rows == [
        ["bubble", "frame.csv", FILE["sha256"][:DIGITS], "plain", "x: X [mm] in mm, u: dx", 90,
         "10 not a number"]
    ]  # fmt: skip


def test_record_of_python_without_files_says_so():
    call = {**RUN, "command_line": None}
    (runs,) = record_tables(record(runs=[call], data=[], settings=None, solver={}))
    rows = dict(runs.rows)
    assert rows["command"] == "none: called from Python"
    assert rows["data files"].startswith("none")
    assert "solver" not in rows
    assert "to be run again" not in runs.note


def test_citation_names_version_and_has_bibtex():
    words, entries = citation()
    assert isinstance(words, Words) and __version__ in words.lines[0]
    assert isinstance(entries, Listing) and "@" in entries.text
