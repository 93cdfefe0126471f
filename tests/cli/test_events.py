"""--events: a JSON object a line, from the beginning to the end, however it ends."""

import json
import os
import threading

import pytest
from bubblefit.cli import terminal
from bubblefit.cli.main import main
from bubblefit.cli.terminal import EVENTS, Events, every_command
from click import Group

from ..commands import in_process, one_line
from ..projects import BUBBLE


def told(path):
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["seconds"] for line in lines] == sorted(line["seconds"] for line in lines)
    return lines


def test_a_fit_tells_its_starts_and_its_end(tmp_path):
    (tmp_path / "p.toml").write_text(BUBBLE)
    run = ("fit", "p.toml", "--out", "out", "--starts", 2, "--jobs", 1, "--json", "--events", "e")
    done = in_process(*run, "--fail-above", 1, cwd=tmp_path)
    begin, *progress, end = told(tmp_path / "e")
    assert end == {**end, "event": "end", "exit_code": 0, "error": None}
    assert begin["event"] == "begin" and begin["command"].endswith(" fit")
    assert {one["event"] for one in progress} == {"progress"}
    assert {one["what"] for one in progress} == {"starts"}
    assert [one["done"] for one in progress][-1] == progress[-1]["total"] == 2
    assert json.loads(done.stdout)["objective"] < 1
    # It is there already: a line for people and one for machines.
    done = in_process(*run, cwd=tmp_path, code=2)
    begin, end = told(tmp_path / "e")
    assert end["exit_code"] == 2 and "already holds" in end["error"] and not done.stdout


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
        with pytest.raises((SystemExit, ValueError)):
            terminal.exits(fails)()
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
