"""Specify what all commands share: bad input in one line, exit codes, streams, events and logs."""

import codecs
import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import bubblefit as bf
import pytest
from bubblefit.cli import terminal
from bubblefit.cli.main import main
from bubblefit.cli.terminal import EVENTS, LOGGER, Events, resumable
from bubblefit.errors import BubblefitError, InputError
from bubblefit.experiments.registry import kind_names
from bubblefit.meshes import mesh as meshes
from click import Group

from ..builders.projects import (
    CONSTANT_STRIPS,
    constant_strips,
    known_bubble,
    known_bubble_of_form,
    replaced_once,
)
from ..support.commands import every_command, in_process, one_line, wait_for
from ..support.refusals import raised

CARD = ("--card", "out/material.toml")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A project of strips and its fit in out/; a folder named like a file of data."""
    folder = tmp_path_factory.mktemp("bad")
    constant_strips(folder)
    in_process("fit", "project.toml", "--out", "out", "--starts", 1, "--jobs", 1, cwd=folder)
    (folder / "folder.csv").mkdir()
    (folder / "file").write_text("text\n")
    return folder


@pytest.fixture(scope="module")
def fit(one_strip_fit):
    return one_strip_fit


def refused(folder, words, *arguments):
    """Assert that a command ends with one line of these words and code 2, and writes nothing."""
    before = sorted(folder.rglob("*"))
    done = in_process(*arguments, cwd=folder, code=2)
    one_line(done, *words)
    assert done.stderr.startswith("bubblefit: ") and done.stdout == ""
    assert sorted(folder.rglob("*")) == before


def project(folder, *changes, text=CONSTANT_STRIPS):
    (folder / "other.toml").write_text(replaced_once(text, *changes))
    return "other.toml"


@pytest.mark.parametrize("command", ["check", "estimate"])
def test_byte_order_mark_is_skipped(folder, command):
    text = (folder / "project.toml").read_bytes()
    (folder / "marked.toml").write_bytes(codecs.BOM_UTF8 + text)
    in_process(command, "marked.toml", cwd=folder)
    card = folder / "out" / "material.toml"
    (folder / "marked-card.toml").write_bytes(codecs.BOM_UTF8 + card.read_bytes())
    assert bf.read_card(folder / "marked-card.toml").law.beta == pytest.approx(
        bf.read_card(card).law.beta
    )


def test_unknown_form_is_named_before_keys_that_depend_on_it(folder):
    form = ('form = "constant"', 'form = "mine"')
    for changes in ([form], [form, ("strain_range = [0.12, 0.14, 0.1]\n", "")]):
        name = project(folder, *changes)
        for command in ("fit", "check", "estimate"):
            refused(folder, ("law.form: no form is called 'mine'", "known: "), command, name)


@pytest.mark.parametrize("name", [".", "..", "folder.csv", "folder.csv/"])
def test_folder_is_no_file_of_data(folder, name):
    file = project(folder, ('"one.csv"', f'"{name}"'))
    words = ("other.toml: strips[0].data.files[0]: ", " is a folder; name a file in it")
    refused(folder, words, "fit", file, "--out", "other")
    raised(InputError, "is a folder", bf.read, folder / name)


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit", "folder.csv"), ("export", "folder.csv", "--format", "constants"),
        ("cycles", "folder.csv"), ("profile", "project.toml", "--card", "folder.csv"),
        ("simulate", "test", "project.toml", "--card", "folder.csv"),
        ("simulate", "bend", "--diameter", 150, "--pressure", 140, *CARD,
         "--measured", "folder.csv"),
        ("gauge", "folder.csv", "--lower", 0, 0, "--upper", 0, 9, "--out", "g.csv"),
    ],
    ids=lambda arguments: arguments[0],
)  # fmt: skip
def test_option_for_a_file_refuses_a_folder(folder, arguments):
    refused(folder, ("folder.csv", "is a folder"), *arguments)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("report", "one.csv"), "one.csv: is a file; name the output folder of a run"),
        (("report", "out", "one.csv"), "one.csv: is a file; name the output folder of a run"),
        (("report", "none"), "none: there is no such folder"),
        (("fit", "project.toml", "--out", "file"), "file is a file; name a folder"),
        (("check", "project.toml", "--out", "file/deep"), "file is a file; name a folder"),
        (("fit", "project.toml", "--data", "file"), "file"),
        (("init", "file"), "file"),
    ],
)
def test_option_for_a_folder_refuses_a_file(folder, arguments, words):
    refused(folder, (words,), *arguments)


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit", "project.toml", "--out", "/proc/x"), ("check", "project.toml", "--out", "/proc/x"),
        ("plan", "project.toml", *CARD, "--out", "/proc/x"), ("schema", "--out", "/proc/x"),
        ("simulate", "test", "project.toml", *CARD, "--out", "/proc/x/y"), ("init", "/proc/x"),
        ("report", "out", "--out", "/proc/x.html"), ("cycles", "one.csv", "--out", "/proc/x"),
    ],
    ids=lambda arguments: arguments[0],
)  # fmt: skip
def test_unwritable_output_folder_is_refused(folder, arguments):
    done = in_process(*arguments, cwd=folder, code=2)
    one_line(done, "/proc/x", "cannot be written: ", "; choose another ")
    assert "free space" not in done.stderr


@pytest.mark.parametrize("kind", kind_names())
def test_single_brackets_of_a_test_are_refused(folder, kind):
    name = project(folder, text=f"[fabric]\nthickness = 0.8\n[{kind}]\nname = 'a'\n")
    words = f"other.toml: {kind}: there can be several of these tables; write [[{kind}]] for "
    refused(folder, (words,), "check", name)
    twice = f"[fabric]\nthickness = 0.8\n[{kind}]\nname = 'a'\n[{kind}]\nname = 'b'\n"
    name = project(folder, text=twice)
    refused(folder, (f"several tables of one name are written [[{kind}]]",), "check", name)


@pytest.mark.parametrize("table", ["fabric", "law", "fit", "units", "law.bounds", "strips.data"])
def test_double_brackets_of_a_single_table_are_refused(folder, table):
    name = project(folder, (f"[{table}]", f"[[{table}]]"))
    refused(folder, (f"only; write [{table}] for [[{table}]]",), "check", name)


def test_empty_choice_of_tests_is_refused(folder, fit):
    read = bf.read_project(folder / "project.toml")
    calls = [lambda c=c: c(read, tests=[]) for c in (bf.fit, bf.check, bf.estimate, bf.compare)]
    calls += [lambda: bf.validate(read, tests=()), lambda: bf.refine(read, fit.card, tests=[])]
    for call in calls:
        error = raised(InputError, "tests: names no test; leave it out to take all of them", call)
        assert "\n" not in str(error)


def test_mesh_beyond_the_memory_is_refused_with_an_estimate(tmp_path, monkeypatch):
    known_bubble(tmp_path, ("elements = 48", "elements = 4_000_000"))

    class Memory:
        available = 8e9

    monkeypatch.setattr(meshes.psutil, "virtual_memory", Memory, raising=False)
    words = ("project.toml: bubble[0].elements: an analysis of 1000000 quads takes about 30 GB",
             "8 GB are free; take fewer")  # fmt: skip
    for command in (("fit",), ("check",)):
        refused(tmp_path, words, *command, "project.toml")
    error = raised(InputError, "elements", meshes.check_memory, 10**6, "elements")
    assert "8 GB are free" in str(error)
    meshes.check_memory(200_000, "elements")


# Streams and interruptions, of real processes
def command(*arguments, **options):
    typed = [sys.executable, "-m", "bubblefit.cli", *arguments]
    return subprocess.Popen(typed, text=True, stderr=subprocess.PIPE, **options)


@pytest.mark.parametrize(
    "arguments", [("--help",), ("--version",), ("schema",), ("docs", "changelog"), ("verify", "-h")]
)
def test_full_stdout_has_an_exit_code_and_a_line(arguments):
    with open("/dev/full", "w") as full:
        running = command(*arguments, stdout=full)
        _, stderr = running.communicate(timeout=120)
    words = "bubblefit: standard output cannot be written: No space left on device; free space or"
    assert running.returncode == BubblefitError.exit_code == 2
    assert stderr.startswith(words) and stderr.count("\n") == 1


def test_results_are_kept_where_stdout_is_full(folder):
    with open("/dev/full", "w") as full:
        running = command(
            "check", "project.toml", "--out", "full", "--quiet", stdout=full, cwd=folder
        )
        _, stderr = running.communicate(timeout=120)
    assert running.returncode == 2 and "standard output cannot be written" in stderr
    assert (folder / "full" / "report.html").exists()


def test_closed_stdout_and_gone_readers_have_an_exit_code(folder):
    typed = f"{sys.executable} -m bubblefit.cli docs project-file"
    closed = subprocess.run(
        ["sh", "-c", f"{typed} >&-"], capture_output=True, text=True, timeout=120
    )
    assert (closed.returncode, closed.stderr) == (
        2, "bubblefit: standard output is closed; redirect it into a file, or to /dev/null\n"
    )  # fmt: skip
    gone = command("docs", "project-file", stdout=subprocess.PIPE)
    gone.stdout.close()
    assert gone.stderr.read() == "" and gone.wait(120) == 141
    # Errors keep their code where nobody can read them.
    for arguments in ("fit none.toml", "fit none.toml --bad"):
        silent = f"{sys.executable} -m bubblefit.cli {arguments} 2>/dev/full"
        assert subprocess.run(["sh", "-c", silent], cwd=folder, timeout=120).returncode == 2


@pytest.mark.parametrize("library", ["numpy/_core", "scipy"])
def test_interruption_while_imported_is_one_line(folder, library):
    """Our imports are under way, of which those of numpy and scipy take longest."""
    running = command("fit", "project.toml", "--out", "int", "--quiet", cwd=folder,
                      stdout=subprocess.DEVNULL)  # fmt: skip
    opened = Path(f"/proc/{running.pid}/maps")
    wait_for(lambda: library in opened.read_text(), 120)
    running.send_signal(signal.SIGINT)
    _, stderr = running.communicate(timeout=60)
    assert (running.returncode, stderr) == (130, "bubblefit: interrupted\n")
    assert not (folder / "int").exists()


@pytest.mark.parametrize("kept", ["run.json", "analyses", ""])
def test_interruption_names_kept_files_where_there_are_some(kept, tmp_path, capsys):
    (tmp_path / kept).mkdir(exist_ok=True)
    with pytest.raises(KeyboardInterrupt), resumable(tmp_path):
        raise KeyboardInterrupt
    words = f"interrupted; go on with --resume (kept in {tmp_path})\n"
    assert capsys.readouterr().err == (words if kept else "")


def told(path):
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line["seconds"] for line in lines] == sorted(line["seconds"] for line in lines)
    return lines


def test_events_report_every_end_of_a_command(tmp_path):
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
        raised((SystemExit, ValueError), "", terminal.in_one_line()(fails))
        assert told(path)[-1] == {**told(path)[-1], "exit_code": code, "error": words}
    before = path.read_text()
    EVENTS.write("late")
    assert path.read_text() == before


def test_events_report_progress(tmp_path):
    path, events = tmp_path / "e", Events()
    events.progress("a", 1, 2, "nobody listens")
    events.begin(path, "c")
    for done in (0, 0, 1, 1, 2):
        events.progress("starts", done, None, "n")
    assert [line["done"] for line in told(path)[1:]] == [0, 1, 2]


def test_events_to_a_closed_pipe_do_not_end_the_command(tmp_path):
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


def test_every_command_accepts_an_events_file(tmp_path):
    one_line(in_process("doctor", "--events", tmp_path, cwd=tmp_path, code=2), str(tmp_path))
    for path, one in every_command(main):
        assert isinstance(one, Group) or any("--events" in param.opts for param in one.params), path


def test_verbose_logs_every_analysis_start_and_time(tmp_path, monkeypatch):
    """After the command's name as before it; on stderr, so that stdout stays for results."""
    monkeypatch.setattr(LOGGER, "level", LOGGER.level)
    monkeypatch.setattr(LOGGER, "handlers", list(LOGGER.handlers))
    project = known_bubble_of_form(tmp_path, 'form = "constant"')
    arguments = ("fit", project, "--out", "out", "--starts", 1, "--jobs", 1, "--verbose")
    done = in_process(*arguments, cwd=tmp_path)
    rows = (tmp_path / "out/history.csv").read_text().splitlines()[1:]
    for number, row in enumerate(rows, 1):
        value = row.split(",")[4]
        said = f"objective {float(value):.6g}, ok" if value else "failed, no equilibrium at "
        assert f" start 0, analysis {number} by membrane: {said}" in done.stderr
    assert " start 0 ended: " in done.stderr and f"; {len(rows)} analyses in " in done.stderr
    for part in ("tests and their data", "all starts", "card, tables and figures in out"):
        assert f" {part}" in done.stderr
    assert "start 0, analysis" not in done.stdout
    # All notes, where there would be one and a count.
    assert done.stdout.count("note: ") >= 2 and "further note" not in done.stdout
    assert " analysis " not in in_process("doctor", cwd=tmp_path).stderr
