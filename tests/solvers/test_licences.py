"""Licences counted and waited for; scratch folders of runs, kept and tidied away.

The program that is run counts its copies itself (`counted_program`).
"""

import json
import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest
from bubblefit.errors import LicenceDenied, OutputError, SolverFailure
from bubblefit.solvers import licences, process, registry, scratch
from bubblefit.solvers.base import Announcement, hearing
from bubblefit.solvers.licences import held, locked, patiently
from bubblefit.solvers.registry import counted, solver_named, solver_settings
from bubblefit.solvers.scratch import OWNER, claim, clear, run_folder, sweep
from bubblefit.solvers.settings import LicenceSettings, licence_settings, split

from ..builders.counted_program import CountedSolver, counted_copies
from ..builders.plug_ins import install_plug_in
from ..support import needs
from ..support.commands import FORK, in_processes, wait_for
from ..support.refusals import complaint, raised

LAW = None
PROJECT = Path("/somewhere/project.toml")


def settings(folder, licences=2, **more):
    return LicenceSettings(licences=licences, licence_folder=str(folder / "locks"), **more)


def licensed(solver, given):
    return licences.licensed(solver, solver.name, given.model_dump(exclude_unset=True))


@pytest.mark.parametrize("count", [2, None])
def test_never_more_at_once_than_there_are_licences(tmp_path, count):

    def work(process):
        solver = CountedSolver(tmp_path / "runs", 0.02 if count else 0.3)
        if count:
            solver = licensed(solver, settings(tmp_path, count))
        for job in range(5 if count else 1):
            solver.run(f"{process}.{job}", LAW)

    in_processes(4, work)
    found = counted_copies(tmp_path / "runs")
    assert found.most == count if count else found.most > 2
    assert found.begun == found.ended
    assert found.ended == {f"{p}.{j}": 1 for p in range(4) for j in range(5 if count else 1)}


def test_a_licence_is_free_again_when_its_holder_was_killed(tmp_path):
    folder = tmp_path / "runs"

    def work(process):
        licensed(CountedSolver(folder, 60.0), settings(tmp_path, 1)).run("killed", LAW)

    holder = FORK.Process(target=work, args=(0,))
    holder.start()
    wait_for(lambda: (folder / "log").exists())
    assert holder.pid is not None
    os.kill(holder.pid, signal.SIGKILL)
    holder.join()
    licensed(CountedSolver(folder), settings(tmp_path, 1)).run("next", LAW)
    found = counted_copies(folder)
    assert found.most == 1 and found.ended == {"next": 1}


def test_the_program_holds_the_licence_until_it_has_ended_itself(tmp_path):
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


def test_waiting_is_said_once_and_so_is_its_end(tmp_path):
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


def test_the_machines_own_folder_is_everybodys(tmp_path, monkeypatch):
    monkeypatch.setattr(licences, "FOLDER", tmp_path / "machine")
    old = os.umask(0o077)
    try:
        with locked("acme", 1, None, pytest.fail):
            pass
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "machine").stat().st_mode) == 0o1777
    assert stat.S_IMODE((tmp_path / "machine" / "acme-1.lock").stat().st_mode) == 0o666


def test_a_lock_is_of_the_file_that_is_there(tmp_path, monkeypatch):
    with locked("acme", 1, tmp_path / "a", pytest.fail):
        for program, folder in (("b", "a"), ("acme", "b")):  # these count apart
            with locked(program, 1, tmp_path / folder, pytest.fail):
                pass
    # Whoever opened it before the other one was there may not run beside who locks that.
    with locked("acme", 1, tmp_path / "a", pytest.fail) as file:
        (tmp_path / "a" / "acme-1.lock").unlink()
        with locked("acme", 1, tmp_path / "a", pytest.fail) as other:
            assert not os.path.samestat(os.fstat(file), os.fstat(other))
            assert licences._any(tmp_path / "a", "acme", 1) is None
    # Tidied away, and made again by somebody else, between opening and locking it.
    opened = licences._opened

    def replaced(path):
        file = opened(path)
        path.unlink()
        path.touch()
        return file

    monkeypatch.setattr(licences, "_opened", replaced)
    assert licences._any(tmp_path / "a", "acme", 1) is None
    monkeypatch.undo()
    # A link is not followed, and a folder must be one.
    (tmp_path / "victim").write_text("")
    (tmp_path / "acme-1.lock").symlink_to(tmp_path / "victim")
    for place in (tmp_path, tmp_path / "victim"):
        given = settings(tmp_path, 1).model_copy(update={"licence_folder": str(place)})
        said = complaint(held("acme", given).__enter__)
        assert said.startswith(f"{place}: solver.acme.licence_folder:")


@pytest.fixture
def pauses(monkeypatch):
    made = []
    monkeypatch.setattr(licences.time, "sleep", made.append)
    monkeypatch.setattr(licences.time, "monotonic", lambda: sum(made))
    monkeypatch.setattr(licences.random, "uniform", lambda low, high: (low + high) / 2)
    yield made


def denials(count, folder, error=LicenceDenied):
    """Fails so many times, then gives 7; every try leaves a scratch folder."""
    tries = []

    def run():
        if len(tries) == count:
            return 7
        tries.append(folder / f"try-{len(tries)}")
        tries[-1].mkdir()
        raise error("no licence: none free", "acme", 5, "FLEXlm error -4", tries[-1])

    return run, tries


def test_pauses_double_up_to_ten_times_the_first(tmp_path, pauses):
    run, tries = denials(7, tmp_path)
    heard = []
    given = settings(tmp_path, licence_wait=1000.0, licence_retry=3.0)
    with hearing(heard.append):
        assert patiently(run, "acme", given) == 7
    assert pauses == [3.0, 6.0, 12.0, 24.0, 30.0, 30.0, 30.0]
    words = "acme: no licence: none free; trying again in 6 s, for 997 s more at most"
    assert heard[1] == Announcement(words)
    assert not any(folder.exists() for folder in tries)
    # After the stated time it is a failure.
    pauses.clear()
    (tmp_path / "more").mkdir()
    run, tries = denials(99, tmp_path / "more")
    given = settings(tmp_path, licence_wait=20.0, licence_retry=4.0)
    failure = raised(LicenceDenied, "", patiently, run, "acme", given)
    assert pauses == [4.0, 8.0, 8.0]  # the last one is cut: it is tried once more at the very end
    assert failure.reason == "no licence: none free; 4 tries in 20 s (licence_wait)"
    assert (failure.exit_number, failure.log_tail) == (5, "FLEXlm error -4")
    assert [folder.exists() for folder in tries] == [False, False, False, True]
    assert failure.scratch == tries[-1]


def test_defaults_and_the_file_of_the_site(tmp_path, monkeypatch):
    waits = [
        LicenceSettings(**g).wait
        for g in ({}, {"licences": 3}, {"licences": 3, "licence_wait": 0.0})
    ]
    assert waits == [0, 600, 0]
    site = tmp_path / "site.toml"
    site.write_text('licences = 3\nlicence_retry = 2.0\nlicence_folder = "locks"\n')
    monkeypatch.setattr(registry, "licensed", lambda _, name, given: licence_settings(name, given))
    found = solver_named("marc", marc=site, licences=5)
    assert (found.licences, found.licence_retry) == (5, 2.0)
    assert found.licence_folder == str(tmp_path / "locks")


ACME = """
class THING:
    name, external, progress, identity = "acme", True, None, "acme 1"
    def __init__(self, acmes=0): pass
    def run(self, model, law, scratch=None, timeout=None): pass
    def check(self): pass
"""


def test_every_external_solver_has_the_keys(packages):
    install_plug_in(packages, "acme", ACME, group="bubblefit.solvers")
    keys = {"licences": 4, "licence_folder": "locks", "licence_denied": ["no seat"]}
    tables = {"marc": keys, "calculix": keys, "acme": {**keys, "acmes": 1}}
    found = solver_settings(PROJECT, tables)
    for name in tables:
        solver = solver_named(name, **found[name])
        assert "run" in vars(solver), name
        given = licence_settings(name, split(found[name])[0])
        assert (given.licences, given.wait) == (4, 600)
        assert given.licence_folder == "/somewhere/locks"
        assert given.licence_denied == ["no seat"]
        # Who answers as a scheduler runs code here: no project names one.
        for key, value in {"licences": 0, "licence_wait": -1.0, "licence_denied": "text",
                           "licence_scheduler": "tcp://x:1"}.items():  # fmt: skip
            said = complaint(solver_settings, PROJECT, {name: {key: value}})
            assert said.startswith(f"{PROJECT}: solver.{name}.{key}: "), said
    assert found["acme"]["acmes"] == 1
    assert counted("acme", found["acme"]) == {"acmes": 1}  # licences change no result


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
    group = folder / "group"
    wait_for(lambda: group.exists() and group.read_text().endswith("\n"), 20)
    return process, folder


def members(group):
    count = 0
    for file in Path("/proc").glob("[0-9]*/stat"):
        try:
            said = file.read_text().rpartition(")")[2].split()
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
    wait_for(lambda: not members(group), 10)
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
    own = dict(zip(("machine", "boot", "process", "started"), scratch.owner_marks(), strict=True))
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
    raised(OutputError, "no scratch folder", scratch.fresh_folder, "ccx", Path("/proc/none"))


def test_the_log_may_be_anything(tmp_path):
    (tmp_path / "log").write_bytes(b"\xff\xfe\n" * 40 + b"x" * 100_000)
    assert len(process.log_tail(tmp_path / "log").splitlines()) <= 25
    assert process.log_tail(tmp_path / "none") == ""
