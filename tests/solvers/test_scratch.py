"""solvers/scratch.py: scratch folders of runs, kept and swept."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from bubblefit.errors import OutputError, SolverFailure
from bubblefit.solvers import scratch
from bubblefit.solvers.scratch import OWNER, claim, clear, run_folder, sweep

from ..support import needs
from ..support.commands import wait_for
from ..support.refusals import raised


@pytest.mark.parametrize("moment", ["mkdtemp", "rmtree"])
def test_interruption_at_any_moment_leaves_no_folder(tmp_path, monkeypatch, moment):
    place = scratch.tempfile if moment == "mkdtemp" else scratch.shutil
    really, came = getattr(place, moment), []

    def interrupted(*args, **options):
        done = really(*args, **options) if moment == "mkdtemp" else None
        if not came:
            came.append(1)
            os.kill(os.getpid(), signal.SIGINT)
        return done if moment == "mkdtemp" else really(*args, **options)

    monkeypatch.setattr(place, moment, interrupted)
    with (
        pytest.raises(KeyboardInterrupt),
        scratch.run_folder("ccx", tmp_path, False, "calculix", "job.log") as folder,
    ):
        (folder / "job.inp").write_text("*NODE")
    scratch.remove_interrupted()
    assert came and not list(tmp_path.iterdir())


BEGIN = """
import sys, time
from pathlib import Path
from bubblefit.solvers.scratch import run_folder
from bubblefit.solvers.process import run_process
with run_folder("t", Path(sys.argv[1]), False, "t", "log") as folder:
    (folder / "deep").mkdir()
    (folder / "deep" / "file").write_text("content")
    print(folder, flush=True)
    words = "echo $$ > group; sleep 300 & sleep 300; true"
    run_process(["/bin/sh", "-c", words], folder, folder / "log")
"""


def begun_run(place):
    process = subprocess.Popen(
        [sys.executable, "-c", BEGIN, place], stdout=subprocess.PIPE, text=True
    )
    folder = Path(process.stdout.readline().strip())
    group = folder / "group"
    wait_for(lambda: group.exists() and group.read_text().endswith("\n"), 20)
    return process, folder


def process_members(group):
    count = 0
    for file in Path("/proc").glob("[0-9]*/stat"):
        try:
            said = file.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        count += int(said[2]) == group and said[0] != "Z"
    return count


def test_killed_run_leaves_no_program_and_a_folder_that_is_swept(tmp_path):
    needs.linux("processes by their group")
    running, folder = begun_run(tmp_path)
    group = int((folder / "group").read_text())
    assert process_members(group) >= 2
    sweep([tmp_path])
    assert (folder / "deep" / "file").exists(), "of a process that lives"
    running.kill()
    running.wait()
    running.stdout.close()
    wait_for(lambda: not process_members(group), 10)
    assert sweep([tmp_path]) == [folder]
    assert list(tmp_path.iterdir()) == []


def test_kept_folders_are_never_swept(tmp_path, monkeypatch):
    with run_folder("good", tmp_path, True, "t", "log") as good:
        (good / "result").write_text("1")
    with (
        pytest.raises(SolverFailure) as failure,
        run_folder("bad", tmp_path, False, "t", "log") as bad,
    ):
        (bad / "log").write_text("why\n")
        raise SolverFailure("it failed", "t")
    memory = tmp_path / "memory"
    monkeypatch.setattr(scratch, "MEMORY", memory)
    monkeypatch.setattr(scratch.tempfile, "gettempdir", lambda: str(tmp_path))
    with (
        pytest.raises(SolverFailure) as moved,
        run_folder("moved", memory, False, "t", "log") as third,
    ):
        (third / "log").write_text("why\n")
        raise SolverFailure("it failed", "t")
    assert moved.value.scratch == tmp_path / third.name and not third.exists()
    kept = [good, failure.value.scratch, moved.value.scratch]
    for folder in kept:
        os.utime(folder, (1e9, 1e9))
        assert not (folder / OWNER).exists()
    assert sweep([tmp_path, memory]) == []
    assert [sorted(p.name for p in folder.iterdir()) for folder in kept] == [
        ["result"], ["log"], ["log"]
    ]  # fmt: skip


def abandoned_folder(place, **said):
    own = dict(zip(("machine", "boot", "process", "started"), scratch.owner_marks(), strict=True))
    folder = place / f"bubblefit-t-{len(list(place.iterdir()))}"
    folder.mkdir()
    (folder / OWNER).write_text("\n".join({**own, **said}.values()))
    (folder / "file").touch()
    return folder


def test_swept_folder_requires_dead_owner(tmp_path, monkeypatch):
    stays = [
        abandoned_folder(tmp_path),  # of this process, on a file system without locks
        abandoned_folder(tmp_path, machine="other", boot="other"),
    ]
    goes = [
        abandoned_folder(tmp_path, started="1"),  # the number is another process's by now
        abandoned_folder(tmp_path, process="999999999"),
        abandoned_folder(tmp_path, boot="before the restart"),
        abandoned_folder(tmp_path, machine="another container", process="999999999"),
    ]
    # In another container a process of ours has another number: what is locked stays.
    locked = abandoned_folder(tmp_path, process="999999999")
    code = "import sys, filelock; f = open(sys.argv[1], 'r+b'); "
    code += "filelock.lock_descriptor(f.fileno()); print(1, flush=True); sys.stdin.read()"
    holder = subprocess.Popen([sys.executable, "-c", code, locked / OWNER],
                              stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # fmt: skip
    holder.stdout.readline()
    assert sorted(sweep([tmp_path])) == sorted(goes)
    assert all(folder.exists() for folder in (*stays, locked))
    holder.communicate()
    assert sweep([tmp_path]) == [locked]
    # A removal that is cut off leaves an owner.
    folder = tmp_path / "bubblefit-t-1"
    (folder / "deep").mkdir(parents=True)
    (folder / "file").touch()
    lock = claim(folder)
    monkeypatch.setattr(scratch.shutil, "rmtree", lambda path, **_: None)  # cut off
    clear(folder)
    assert [path.name for path in folder.iterdir() if path.is_file()] == [OWNER]
    os.close(lock)


def test_folders_of_failed_runs_leave_memory(monkeypatch, tmp_path):
    monkeypatch.setattr(scratch, "MEMORY", tmp_path / "shm")
    monkeypatch.setattr(scratch.tempfile, "gettempdir", lambda: str(tmp_path / "disk"))
    (tmp_path / "shm").mkdir()
    (tmp_path / "disk").mkdir()
    assert scratch.default_parent() == tmp_path / "shm"
    elsewhere = scratch.fresh_folder("ccx", tmp_path)
    assert scratch.put_aside(elsewhere) == elsewhere
    monkeypatch.setattr(scratch, "ROOM", 1 << 60)
    assert scratch.default_parent() == tmp_path / "disk"
    raised(OutputError, "no scratch folder", scratch.fresh_folder, "ccx", Path("/proc/none"))
