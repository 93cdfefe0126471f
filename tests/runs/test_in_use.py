"""An output folder is written by one run at a time, in whatever way the other one ends."""

import json
import os
import signal
import subprocess
import sys
import threading
import warnings
from types import SimpleNamespace

import bubblefit as bf
import pytest
from bubblefit.arguments import checked_arguments
from bubblefit.errors import OutputError
from bubblefit.notes import GRAVE, Note, NoteKind
from bubblefit.runs.in_use import HOLDER, alone_in_folder, used_alone
from bubblefit.solvers.scratch import owner_marks

from ..builders.projects import constant_strips
from ..support.commands import in_process, one_line, wait_for
from ..support.refusals import raised

#: Holds a folder until its standard input ends.
HOLDS = """
import sys
from bubblefit.runs.in_use import used_alone
with used_alone(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


CARD = ("--card", "first/material.toml")


#: What is typed for each kind of command that writes a folder; --out goes behind it.
COMMANDS = {
    "fit": ("fit", "project.toml", "--overwrite"),
    "fit again": ("fit", "project.toml", "--resume"),
    "uniaxial": ("uniaxial", "project.toml", "--overwrite"),
    "check": ("check", "project.toml"),
    "profile": ("profile", "project.toml", *CARD, "--overwrite"),
    "bootstrap": ("bootstrap", "project.toml", "--over", "specimens", *CARD, "--overwrite"),
    "plan": ("plan", "project.toml", *CARD, "--overwrite"),
    "compare": ("compare", "project.toml", "--overwrite"),
    "validate": ("validate", "project.toml", "--overwrite"),
    "weights": ("validate", "project.toml", "--weights", "two", "--overwrite"),
    "mesh": ("study", "mesh", "project.toml", *CARD, "--overwrite"),
    "nu12": ("study", "nu12", "project.toml", *CARD, "--overwrite"),
    "simulate": ("simulate", "test", "project.toml", *CARD, "--overwrite"),
    "bend": ("simulate", "bend", "--diameter", 150, "--pressure", 140, *CARD, "--overwrite"),
    "cycles": ("cycles", "one.csv", "--overwrite"),
}


def test_grave_notes_of_any_study_are_warnings_at_the_line_of_the_user():
    """Those of a fit within the study, and light notes, are not."""

    def result(words):
        kinds = NoteKind("grave", weight=GRAVE), NoteKind("light")
        return SimpleNamespace(notes=[Note(kind, f"{words} {kind}") for kind in kinds])

    @checked_arguments
    @alone_in_folder
    def fit():
        return result("fit")

    @checked_arguments
    @alone_in_folder
    def study():
        fit()
        return result("study")

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        study()
    assert [(w.category, str(w.message)) for w in caught] == [(bf.BubblefitWarning, "study grave")]
    assert caught[0].filename == __file__


def holder(folder):
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDS, folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdout.readline() == b"held\n"
    return process


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A fit in first/, and a folder in use, which also holds a fit."""
    folder = tmp_path_factory.mktemp("in-use")
    constant_strips(folder)
    for name in ("first", "used"):
        in_process("fit", "project.toml", "--out", name, "--starts", 1, "--jobs", 1, cwd=folder)
    process = holder(folder / "used")
    yield folder
    process.communicate()


@pytest.mark.parametrize("name", COMMANDS)
def test_folder_in_use_is_refused(name, folder):
    before = {path: path.read_bytes() for path in (folder / "used").iterdir()}
    done = in_process(*COMMANDS[name], "--out", "used", cwd=folder, code=2)
    one_line(done, "used: is in use by process ", " since 20", "wait until that ends, or name")
    assert {path: path.read_bytes() for path in (folder / "used").iterdir()} == before


def test_python_results_are_refused_in_folder_in_use(folder):
    project = bf.read_project(folder / "project.toml")
    result = bf.fit(project, tests=["two"], starts=1, jobs=1)
    used = str(folder / "used")
    for write in (result.report, lambda out: bf.fit(project, out=out, overwrite=True)):
        raised(OutputError, "is in use by process", write, used)
    # Of a thread of this process as well.
    with used_alone(folder / "thread"):
        errors = []

        def write():
            try:
                result.report(folder / "thread")
            except OutputError as error:
                errors.append(str(error))

        thread = threading.Thread(target=write)
        thread.start()
        thread.join()
    assert "is in use by process" in errors[0]
    result.report(folder / "thread")


def test_two_simultaneous_fits_leave_one_whole_result(tmp_path):
    """Of two commands the later one ends at once, and says who is first."""
    constant_strips(tmp_path)
    first = [sys.executable, "-m", "bubblefit.cli", "fit", "project.toml", "--out", "out",
             "--starts", "8", "--jobs", "1", "--quiet"]  # fmt: skip
    running = subprocess.Popen(first, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    wait_for(lambda: (tmp_path / "out" / "starts.jsonl").exists(), 120)
    done = subprocess.run(
        [*first[:-5], "--overwrite"], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout) == (2, "")
    one_line(done, f"in use by process {running.pid} on ", "(__main__.py fit project.toml")
    running.communicate()
    assert running.returncode == 0
    assert len(json.loads((tmp_path / "out" / "result.json").read_text())["starts"]) == 8
    assert not (tmp_path / "out" / HOLDER).exists()


def test_lock_of_a_killed_process_does_not_block(tmp_path):
    process = holder(tmp_path / "out")
    raised(OutputError, f"in use by process {process.pid}", used_alone(tmp_path / "out").__enter__)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert (tmp_path / "out" / HOLDER).exists()
    with used_alone(tmp_path / "out"):
        pass
    # Nothing was written: what was made for it goes.
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize(("mark", "refused"), [("", True), ("999999999", False)])
def test_process_number_counts_where_files_cannot_be_locked(mark, refused, tmp_path, monkeypatch):
    def no_locks(*_, **__):
        raise OSError("no locks available")

    monkeypatch.setattr("filelock.lock_descriptor", no_locks)
    machine, boot, process, started = owner_marks()
    lines = [machine, boot, mark or process, started, "2026-01-31 10:00:00+01:00", "bubblefit fit"]
    (tmp_path / HOLDER).write_text("\n".join(lines))
    if refused:
        error = raised(OutputError, "is in use", used_alone(tmp_path).__enter__)
        assert f"{process} on {machine} (bubblefit fit) since 2026-01-31 10:00" in str(error)
    else:
        with used_alone(tmp_path):
            pass


def test_folder_is_locked_once_per_call_and_not_by_forked_workers(tmp_path):
    with used_alone(tmp_path / "new" / "deep"):
        with used_alone(tmp_path / "new" / "deep"):
            pass
        assert (tmp_path / "new" / "deep" / HOLDER).exists()
        child = os.fork()
        if child == 0:
            signal.pause()
    # The worker lives on, and holds nothing.
    with used_alone(tmp_path / "new"):
        pass
    assert not (tmp_path / "new").exists()
    process = holder(tmp_path / "new" / "deep")
    process.communicate()
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
