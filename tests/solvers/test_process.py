"""solvers/process.py: a program held, watched and ended."""

import json
import os
import time
from pathlib import Path

from bubblefit.solvers import process
from bubblefit.solvers.base import Announcement, hearing
from bubblefit.solvers.licences import held, locked
from bubblefit.solvers.process import run_process
from bubblefit.solvers.scratch import run_folder, sweep
from bubblefit.solvers.settings import LicenceSettings

from ..support import needs
from ..support.commands import FORK, alive, in_processes, wait_for


def test_children_of_program_are_killed_without_process_groups(tmp_path, monkeypatch):
    monkeypatch.setattr("bubblefit.solvers.process.GROUPS", False)
    shell_text = "sleep 60 & echo $! > child; sleep 60"
    ended = run_process(["/bin/sh", "-c", shell_text], tmp_path, tmp_path / "log", timeout=0.5)
    assert ended.timed_out
    child = int((tmp_path / "child").read_text())
    wait_for(lambda: not alive(child), seconds=5)


def settings(folder, licences=2, **more):
    return LicenceSettings(licences=licences, licence_folder=str(folder / "locks"), **more)


def test_program_holds_its_licence_until_it_has_ended(tmp_path):
    def work(_):
        with held("acme", settings(tmp_path, 1)):
            # As a wrapper script leaves a program behind: in a session of its own.
            script = "setsid sleep 0.8 & sleep 0.2"
            process.run_process(["sh", "-c", script], tmp_path, tmp_path / "log")

    in_processes(1, work)
    begun, heard = time.monotonic(), list[Announcement]()
    with hearing(heard.append), held("acme", settings(tmp_path, 1)):
        assert time.monotonic() - begun > 0.2
    assert [bool(said.words) for said in heard] == [True, False]


def test_waiting_for_a_licence_is_reported_once(tmp_path):
    # Forked before the lock is there: a copy of this process would hold it, too.
    ready = FORK.Event()
    process = FORK.Process(target=_hold, args=(settings(tmp_path, 1), tmp_path, ready))
    process.start()
    with locked("acme", 1, tmp_path / "locks", lambda: None):
        ready.set()
        wait_for(lambda: (tmp_path / "heard").exists())
        time.sleep(0.2)
    process.join(30)
    told = (tmp_path / "heard").read_text().splitlines()
    heard = [Announcement(*said) for said in map(json.loads, told)]
    assert [said.words for said in heard] == ["waiting for a licence of acme", ""]
    assert heard[0].of == heard[1].of and str(process.pid) in heard[0].of


def _hold(given, folder, ready):
    ready.wait(30)

    def write(said):
        with (folder / "heard").open("a") as file:
            file.write(json.dumps([said.words, said.of]) + "\n")

    with hearing(write), held("acme", given):
        pass


def test_watcher_and_folder_end_with_the_run(tmp_path, monkeypatch):
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


def test_log_may_be_any_bytes(tmp_path):
    (tmp_path / "log").write_bytes(b"\xff\xfe\n" * 40 + b"x" * 100_000)
    assert len(process.log_tail(tmp_path / "log").splitlines()) <= 25
    assert process.log_tail(tmp_path / "none") == ""
