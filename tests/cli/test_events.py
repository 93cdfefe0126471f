"""--events: a JSON object a line, from the beginning to the end, however it ends."""

from __future__ import annotations

import json
import os
import threading
from pathlib import Path
from typing import Any

import pytest
from bubblefit.cli import terminal
from bubblefit.cli.main import COMMANDS, main
from bubblefit.cli.terminal import EVENTS, Events
from click import Context, Group
from click.testing import CliRunner

from ..projects import BUBBLE


def told(path: Path) -> list[dict[str, Any]]:
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["seconds"] for line in lines] == sorted(line["seconds"] for line in lines)
    return lines


def command(folder: Path, *arguments: object) -> tuple[int, list[dict[str, Any]], str]:
    path = folder / "events.jsonl"
    done = CliRunner().invoke(main, [*map(str, arguments), "--events", str(path)])
    return done.exit_code, told(path), done.stdout


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "p.toml").write_text(BUBBLE)
    return tmp_path / "p.toml"


def test_a_fit_tells_its_starts_and_its_end(project: Path, tmp_path: Path) -> None:
    out = ("--out", tmp_path / "out", "--starts", 2, "--jobs", 1, "--json")
    code, events, said = command(tmp_path, "fit", project, *out, "--fail-above", 1)
    begin, *progress, end = events
    assert code == 0 and end == {**end, "event": "end", "exit_code": 0, "error": None}
    assert begin["event"] == "begin" and begin["command"].endswith(" fit")
    assert {one["event"] for one in progress} == {"progress"}
    assert {one["what"] for one in progress} == {"starts"}
    assert [one["done"] for one in progress][-1] == progress[-1]["total"] == 2
    assert json.loads(said)["objective"] < 1
    # It is there already: a line for people and one for machines.
    code, (begin, end), said = command(tmp_path, "fit", project, *out)
    assert code == end["exit_code"] == 2 and "already holds" in end["error"] and not said


def test_every_end_is_told(tmp_path: Path) -> None:
    path = tmp_path / "e"
    for error, code, words in (
        (KeyboardInterrupt(), 130, "interrupted"),
        (SystemExit(1), 1, None),
        (SystemExit(None), 0, None),
        (ValueError("x"), 1, "ValueError: x"),
    ):

        def fails(error=error) -> None:
            raise error

        EVENTS.begin(path, "c")
        with pytest.raises((SystemExit, ValueError)):
            terminal.exits(fails)()
        assert told(path)[-1] == {**told(path)[-1], "exit_code": code, "error": words}
    before = path.read_text()
    EVENTS.write("late")
    assert path.read_text() == before


def test_progress_is_told_where_more_is_done(tmp_path: Path) -> None:
    path, events = tmp_path / "e", Events()
    events.progress("a", 1, 2, "nobody listens")
    events.begin(path, "c")
    for done in (0, 0, 1, 1, 2):
        events.progress("starts", done, None, "n")
    assert [line["done"] for line in told(path)[1:]] == [0, 1, 2]


def test_a_pipe_whose_reader_has_gone_ends_nothing(tmp_path: Path) -> None:
    pipe, events = tmp_path / "pipe", Events()
    os.mkfifo(pipe)
    lines: list[str] = []

    def read() -> None:
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


def test_a_file_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    done = CliRunner().invoke(main, ["doctor", "--events", str(tmp_path)])
    assert done.exit_code == 2 and str(tmp_path) in done.stderr


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_takes_it(name: str) -> None:
    found = main.get_command(Context(main), name)
    assert found is not None
    each = found.commands.values() if isinstance(found, Group) else [found]
    for one in each:
        assert any("--events" in param.opts for param in one.params), one.name
