"""What a killed process leaves goes with the next one; what is in use, or kept, stays."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from bubblefit.errors import OutputError, SolverFailure
from bubblefit.solvers import process, scratch
from bubblefit.solvers.scratch import OWNER, claim, clear, run_folder, sweep

from .. import needs

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


def begun(place):
    process = subprocess.Popen(
        [sys.executable, "-c", BEGIN, place], stdout=subprocess.PIPE, text=True
    )
    folder = Path(process.stdout.readline().strip())
    deadline = time.monotonic() + 20
    while not ((folder / "group").exists() and (folder / "group").read_text().endswith("\n")):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return process, folder


def members(group):
    count = 0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            said = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        count += int(said[2]) == group and said[0] != "Z"
    return count


def test_after_a_kill_no_program_lives_and_the_next_sweep_removes_the_folder(tmp_path):
    needs.linux("processes by their group")
    running, folder = begun(tmp_path)
    group = int((folder / "group").read_text())
    assert members(group) >= 2
    sweep([tmp_path])
    assert (folder / "deep" / "file").exists(), "of a process that lives"
    running.kill()
    running.wait()
    running.stdout.close()
    deadline = time.monotonic() + 10
    while members(group):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert sweep([tmp_path]) == [folder]
    assert list(tmp_path.iterdir()) == []


def test_a_watcher_and_a_folder_end_with_the_run(tmp_path, monkeypatch):
    needs.linux("processes by their name")
    with run_folder("t", tmp_path, False, "t", "log") as folder:
        process.run_process(["/bin/sh", "-c", "true"], folder, folder / "log")
        children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()
        names = [Path(f"/proc/{child}/cmdline").read_bytes() for child in children]
        assert not [name for name in names if b"bubblefit-watch" in name]
    with run_folder("t", tmp_path, False, "t", "log") as folder:
        assert sweep([tmp_path]) == [] and folder.exists()
    assert not folder.exists()
    monkeypatch.setattr(process, "WATCHER", (str(tmp_path / "no shell"),))
    with run_folder("t", tmp_path, False, "t", "log") as folder:
        assert process.run_process(["true"], folder, folder / "log").exit_code == 0


def test_what_is_kept_is_never_swept(tmp_path, monkeypatch):
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


def left(place, **said):
    own = dict(zip(("machine", "boot", "process", "started"), scratch._self(), strict=True))
    folder = place / f"bubblefit-t-{len(list(place.iterdir()))}"
    folder.mkdir()
    (folder / OWNER).write_text("\n".join({**own, **said}.values()))
    (folder / "file").touch()
    return folder


def test_whose_is_swept(tmp_path, monkeypatch):
    stays = [
        left(tmp_path),  # of this process, on a file system without locks
        left(tmp_path, machine="other", boot="other"),
    ]
    goes = [
        left(tmp_path, started="1"),  # the number is another process's by now
        left(tmp_path, process="999999999"),
        left(tmp_path, boot="before the restart"),
        left(tmp_path, machine="another container", process="999999999"),
    ]
    # In another container a process of ours has another number: what is locked stays.
    locked = left(tmp_path, process="999999999")
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


def test_failed_runs_leave_memory(monkeypatch, tmp_path):
    monkeypatch.setattr(scratch, "MEMORY", tmp_path / "shm")
    monkeypatch.setattr(scratch.tempfile, "gettempdir", lambda: str(tmp_path / "disk"))
    (tmp_path / "shm").mkdir()
    (tmp_path / "disk").mkdir()
    assert scratch.default_parent() == tmp_path / "shm"
    elsewhere = scratch.fresh_folder("ccx", tmp_path)
    assert scratch.put_aside(elsewhere) == elsewhere
    monkeypatch.setattr(scratch, "ROOM", 1 << 60)
    assert scratch.default_parent() == tmp_path / "disk"
    with pytest.raises(OutputError, match="no scratch folder"):
        scratch.fresh_folder("ccx", Path("/proc/none"))


def test_the_log_may_be_anything(tmp_path):
    (tmp_path / "log").write_bytes(b"\xff\xfe\n" * 40 + b"x" * 100_000)
    assert len(process.log_tail(tmp_path / "log").splitlines()) <= 25
    assert process.log_tail(tmp_path / "none") == ""
