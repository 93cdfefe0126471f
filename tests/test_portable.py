"""The main path where the operating system has nothing of POSIX to offer, as on Windows."""

import os
import subprocess
import sys

from bubblefit.solvers.process import run_process

from .projects import small

#: Put before a program, and before every interpreter that it starts. The code for this
#: system, platformdirs and numpy need some of these names: they are imported first. SIGKILL stays,
#: by which subprocess and psutil end a process on this system.
WITHOUT = """
import multiprocessing, numpy, os, platformdirs, psutil, signal, sys
for name in ("fcntl", "grp", "pwd", "resource", "termios"):
    sys.modules[name] = None
for name in (
    "chown", "fork", "forkpty", "fchmod", "getpgid", "getpgrp", "getuid", "geteuid", "killpg",
    "mkfifo", "register_at_fork", "sched_getaffinity", "setpgid", "setsid", "uname", "wait",
    "O_CLOEXEC", "O_NOFOLLOW", "O_NONBLOCK",
):
    if hasattr(os, name):
        delattr(os, name)
for name in ("alarm", "pthread_kill", "pthread_sigmask", "setitimer", "sigwait", "SIGALRM",
             "SIGCHLD", "SIGHUP", "SIGPIPE", "SIGQUIT", "SIGUSR1", "SIGUSR2"):
    if hasattr(signal, name):
        delattr(signal, name)
if multiprocessing.get_start_method(allow_none=True) is None:
    multiprocessing.set_start_method("spawn")
"""
FIT = """
import multiprocessing, sys
from pathlib import Path
import bubblefit as bf
from bubblefit.solvers import scratch
assert not hasattr(__import__("os"), "fork")
scratch.MEMORY = Path(sys.argv[2], "no such folder")
if __name__ == "__main__":
    project = bf.read_project(sys.argv[1])
    fit = bf.fit(project, starts=2, jobs=2, out=sys.argv[2])
    assert not multiprocessing.active_children()
    print(fit.objective, len(fit.starts()))
"""
PROGRAM = """
import sys
from pathlib import Path
from bubblefit.solvers import licences, process, scratch
folder = Path(sys.argv[1])
locks = licences.LicenceSettings(licences=1, licence_folder=str(folder / "locks"))
with scratch.run_folder("t", folder, False, "t", "log") as place:
    assert scratch.sweep([folder]) == [] and place.exists()
    words = [sys.executable, "-c", "import time; print('begun', flush=True); time.sleep(60)"]
    ended = process.run_process(words, place, place / "log", timeout=5.0)
    assert ended.timed_out and ended.seconds < 30, ended
    assert process.log_tail(place / "log") == "begun"
assert not place.exists()
"""


def without(program, folder, *arguments):
    """Return what a program prints in an interpreter that lacks the names of `WITHOUT`."""
    site = folder / "site"
    site.mkdir()
    (site / "sitecustomize.py").write_text(WITHOUT)
    (site / "program.py").write_text(program)
    paths = [str(site), *filter(None, sys.path)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, str(site / "program.py"), *map(str, arguments)]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_bubble_is_fitted_by_two_spawned_processes(tmp_path):
    project = small(tmp_path)
    printed = without(FIT, tmp_path, project, tmp_path / "out").splitlines()[-1].split()
    assert float(printed[0]) >= 0.0 and int(printed[1]) == 2
    assert (tmp_path / "out" / "history.csv").stat().st_size > 0


def test_a_program_is_run_ended_in_time_and_its_folder_removed(tmp_path):
    without(PROGRAM, tmp_path, tmp_path)


def test_what_a_program_started_is_killed_where_there_are_no_groups(tmp_path, monkeypatch):
    monkeypatch.setattr("bubblefit.solvers.process.GROUPS", False)
    script = f'{sys.executable} -c \'import time; time.sleep(3); open("late", "w")\' & sleep 60'
    ended = run_process(["/bin/sh", "-c", script], tmp_path, tmp_path / "log", timeout=0.5)
    assert ended.timed_out
    subprocess.run([sys.executable, "-c", "import time; time.sleep(4)"], check=True)
    assert not (tmp_path / "late").exists()
