"""Progress: on a terminal and elsewhere, from the first analysis on."""

import time

import pytest
from bubblefit import files
from bubblefit.cli.progress import COMPILING, SeriesProgress, StudyProgress
from bubblefit.runs.simulation import Step
from bubblefit.runs.starts import EvaluationRecord, StartRecord

ENDED = StartRecord(1, (1, 1), 0.25, "done", 1, (), (), 0.1)


def analysis(start, objective):
    return EvaluationRecord(start, 1, objective, "ok", (), ())


@pytest.fixture
def clock(monkeypatch):
    """Lets so many seconds pass."""
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])

    def pass_by(seconds):
        now[0] += seconds

    return pass_by


def test_the_start_under_way_is_told_from_its_first_analysis_on(clock):
    shown = StudyProgress(4, quiet=True)
    said = []
    records = [None, analysis(0, 2.98), analysis(1, 0.5), analysis(1, None), ENDED]
    for record in [*records, analysis(0, 0.125)]:
        shown.saw(record)
        said.append(shown.note())
        clock(2.0)
    unknown = "time left not known yet"
    assert said == [
        f"no analysis yet, 0 analyses, {unknown}",
        f"start 0 at 2.98, 1 analysis, {unknown}",
        f"start 1 at 0.5, 2 analyses, {unknown}",
        f"start 1 at a failure, 3 analyses, {unknown}",
        "best 0.25, 3 analyses, 24 s left",
        "best 0.25, start 0 at 0.125, 4 analyses, 30 s left",
    ]


def test_elsewhere_than_on_a_terminal_a_plain_line_a_minute(clock, capsys):
    shown = StudyProgress(4, quiet=False)
    for _ in range(59):
        shown.saw(analysis(0, 0.5))
        clock(1.0)
    assert capsys.readouterr().err == ""
    clock(1.0)
    shown.saw(analysis(0, 0.25))
    line = "0 of 4 starts, start 0 at 0.25, 60 analyses, time left not known yet\n"
    assert capsys.readouterr() == ("", line)
    shown.saw(analysis(0, 0.125))
    assert capsys.readouterr().err == ""


def test_a_series_says_where_it_is_too(clock, capsys):
    for quiet in (False, True):
        shown = SeriesProgress(quiet)
        shown.saw(Step("bubble", 1, 3, 2, 7))
        clock(61.0)
        shown.saw(Step("bubble", 2, 3, 3, 7))
        shown.saw(Step("bubble", 2, 3, 4, 7))
        said = "" if quiet else "analysis 2 of 3, bubble: increment 3 of 7\n"
        assert capsys.readouterr() == ("", said)


def test_compilation_is_announced_until_kernels_are_kept(tmp_path, monkeypatch, capsys):
    def said(quiet):
        with StudyProgress(1, quiet):
            return capsys.readouterr().err

    monkeypatch.setattr(files, "_kernel_folder", lambda: tmp_path)
    assert (said(False), said(True)) == (f"{COMPILING}\n", "")
    (tmp_path / "membrane").mkdir()
    (tmp_path / "membrane" / "kernel.assemble.1.nbc").touch()
    assert said(False) == ""
    monkeypatch.setattr(files, "_kernel_folder", lambda: None)
    assert said(False) == f"{COMPILING}\n"
