"""Progress: on a terminal and elsewhere, from the first analysis on."""

import json
import os
import threading
import time

import pytest
from bubblefit import compilation
from bubblefit.cli import terminal
from bubblefit.cli.main import main
from bubblefit.cli.options import COMPILING, LiveLine
from bubblefit.cli.terminal import EVENTS, Events
from bubblefit.runs.starts import EvaluationRecord, StartRecord
from click import Group

from ..support.commands import every_command, in_process, one_line
from ..support.refusals import raised

ENDED = StartRecord(1, (1, 1), 0.25, "done", 1, (), (), 0.1)


def analysis(start, objective):
    return EvaluationRecord(start, 1, objective, "ok", (), ())


@pytest.fixture
def clock(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])

    def pass_by(seconds):
        now[0] += seconds

    return pass_by


def test_the_start_under_way_is_told_from_its_first_analysis_on(clock):
    shown = LiveLine("starts", True, 4)
    said = []
    records = [None, analysis(0, 2.98), analysis(1, 0.5), analysis(1, None), ENDED]
    for record in [*records, analysis(0, 0.125)]:
        shown(record)
        said.append(shown.note)
        clock(2.0)
    unknown = "time left not known yet"
    assert said == [
        unknown,
        f"start 0 at 2.98, 1 analysis, {unknown}",
        f"start 1 at 0.5, 2 analyses, {unknown}",
        f"start 1 at a failure, 3 analyses, {unknown}",
        "best 0.25, 3 analyses, 24 s left",
        "best 0.25, start 0 at 0.125, 4 analyses, 30 s left",
    ]


def test_elsewhere_than_on_a_terminal_a_plain_line_a_minute(clock, capsys):
    shown = LiveLine("starts", False, 4)
    for _ in range(59):
        shown(analysis(0, 0.5))
        clock(1.0)
    assert capsys.readouterr().err == ""
    clock(1.0)
    shown(analysis(0, 0.25))
    line = "0 of 4 starts, start 0 at 0.25, 60 analyses, time left not known yet\n"
    assert capsys.readouterr() == ("", line)
    shown(analysis(0, 0.125))
    assert capsys.readouterr().err == ""


def test_compilation_is_announced_until_kernels_are_kept(tmp_path, monkeypatch, capsys):
    def said(quiet):
        with LiveLine("starts", quiet, 1):
            return capsys.readouterr().err

    monkeypatch.setattr(compilation, "kernel_folder", lambda: tmp_path)
    assert (said(False), said(True)) == (f"{COMPILING}\n", "")
    (tmp_path / "membrane").mkdir()
    (tmp_path / "membrane" / "kernel.assemble.1.nbc").touch()
    assert said(False) == ""
    monkeypatch.setattr(compilation, "kernel_folder", lambda: None)
    assert said(False) == f"{COMPILING}\n"


def told(path):
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["seconds"] for line in lines] == sorted(line["seconds"] for line in lines)
    return lines


def test_every_end_is_told(tmp_path):
    path = tmp_path / "e"
    for error, code, words in (
        (KeyboardInterrupt(), 130, "interrupted"),
        (SystemExit(1), 1, None),
        (SystemExit(None), 0, None),
        (ValueError("x"), 1, "ValueError: x"),
    ):

        def fails(error=error):
            raise error

        EVENTS.begin(path, "c")
        raised((SystemExit, ValueError), "", terminal.exits(fails))
        assert told(path)[-1] == {**told(path)[-1], "exit_code": code, "error": words}
    before = path.read_text()
    EVENTS.write("late")
    assert path.read_text() == before


def test_progress_is_told_where_more_is_done(tmp_path):
    path, events = tmp_path / "e", Events()
    events.progress("a", 1, 2, "nobody listens")
    events.begin(path, "c")
    for done in (0, 0, 1, 1, 2):
        events.progress("starts", done, None, "n")
    assert [line["done"] for line in told(path)[1:]] == [0, 1, 2]


def test_a_pipe_whose_reader_has_gone_ends_nothing(tmp_path):
    pipe, events, lines = tmp_path / "pipe", Events(), []
    os.mkfifo(pipe)

    def read():
        with pipe.open() as file:
            lines.append(file.readline())

    reader = threading.Thread(target=read)
    reader.start()
    events.begin(pipe, "c")
    reader.join()
    for done in range(3):
        events.progress("a", done, 3, "")
    events.end(0)
    assert json.loads(lines[0])["event"] == "begin"


def test_every_command_takes_it_and_says_where_it_cannot_write(tmp_path):
    one_line(in_process("doctor", "--events", tmp_path, cwd=tmp_path, code=2), str(tmp_path))
    for path, one in every_command(main):
        assert isinstance(one, Group) or any("--events" in param.opts for param in one.params), path
