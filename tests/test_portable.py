"""The main path where the operating system has nothing of POSIX to offer, as on Windows."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

from bubblefit import files
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


#: Compiles one kernel that calls another file's functions, and prints what it computes.
KERNEL = """
import numpy as np
from bubblefit.materials.law import HypoelasticLaw
law = HypoelasticLaw.linear(400.0, 250.0, 12.0)
print(law.increment(np.zeros(3), np.array([0.01, 0.0, 0.0]), np.zeros(3))[0])
"""


def run(cache, package=None):
    # Not optimised: what takes long is to compile.
    environment = {**os.environ, "BUBBLEFIT_CACHE": str(cache), "NUMBA_OPT": "0"}
    if package is not None:
        environment["PYTHONPATH"] = str(package)
    done = subprocess.run(
        [sys.executable, "-c", KERNEL], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_where_the_cache_is(monkeypatch):
    monkeypatch.setenv("BUBBLEFIT_CACHE", "/x")
    assert files.cache_folder() == Path("/x")
    monkeypatch.delenv("BUBBLEFIT_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/y")
    assert files.cache_folder() == Path("/y/bubblefit")
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", "/z")
    assert files.cache_folder() == Path("/z/.cache/bubblefit")


def _compiles(file):
    functions = (n for n in ast.walk(ast.parse(file.read_text())) if isinstance(n, ast.FunctionDef))
    decorators = (d for function in functions for d in function.decorator_list)
    return any("compiled" in ast.unparse(decorator) for decorator in decorators)


def test_every_file_with_compiled_functions_is_among_the_kernels():
    outside = {"tests", "benchmarks", "build", "out"}
    sources = (file.relative_to(files.ROOT) for file in files.ROOT.rglob("*.py"))
    ours = [f for f in sources if f.parts[0] not in outside and not f.parts[0].startswith(".")]
    with_kernels = {file.as_posix() for file in ours if _compiles(files.ROOT / file)}
    assert len(with_kernels) > 5
    assert with_kernels == set(files.KERNELS)
    assert len(files.KERNELS) == len(with_kernels)


def test_an_edit_reaches_code_compiled_from_another_file_without_a_cache_too(tmp_path):
    package = tmp_path / "copy" / "bubblefit"
    shutil.copytree(
        files.ROOT,
        package,
        ignore=shutil.ignore_patterns(".*", "out", "tests", "build", "*.egg-info", "__pycache__"),
    )
    before = run(tmp_path / "cache", package.parent)
    assert list((tmp_path / "cache").glob("kernels-*/*/*.nbi"))
    law = package / "materials" / "pieces.py"
    text = law.read_text()
    edited = text.replace(
        "first + pieces[component, k, 4]", "first + 2.0 * pieces[component, k, 4]"
    )
    assert edited != text
    law.write_text(edited)
    after = run(tmp_path / "cache", package.parent)
    assert after != before
    (tmp_path / "file").write_text("in the way of a cache")
    assert run(tmp_path / "file" / "cache", package.parent) == after
