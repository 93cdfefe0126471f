"""Commands as a user runs them, for the tests: in a process of their own or in this one."""

from __future__ import annotations

import importlib
import json
import logging
import os
import pkgutil
import re
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from bubblefit.cli.main import main
from click.testing import CliRunner

TIMEOUT_S = 300.0
#: How long a command that is told to stop may take to end.
ENDING_S = 30.0
#: np.float64(0.5), array([0.5, 1. ]), [0.5 1. ]
NUMPY = re.compile(r"\bnp\.\w+\(|\barray\(|\[ ?-?\d+\.\d* +-?\d+\.\d*[\]\s]")
#: Packages that commands import as they go.
PACKAGES = (
    "cli",
    "experiments",
    "inference",
    "materials",
    "project",
    "readers",
    "reports",
    "runs",
    "solvers",
)


def bubblefit(
    *arguments: object, cwd: Path, code: int = 0, preexec_fn: Callable[[], None] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run the command; assert its exit code; return the finished process.

    In a process of its own, which is this one's copy: nothing is imported again. That a new
    interpreter does the same: tests/cli/test_module.py, and the interrupted commands.
    """
    command = [str(a) for a in arguments]
    _import_all()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        child = os.fork()
        if child == 0:
            _become(command, cwd, out.fileno(), err.fileno(), preexec_fn)
        deadline = time.monotonic() + TIMEOUT_S
        while True:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                break
            if time.monotonic() > deadline:
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
                raise subprocess.TimeoutExpired(command, TIMEOUT_S)
            time.sleep(0.005)
        texts = []
        for file in (out, err):
            file.seek(0)
            texts.append(file.read().decode())
    exit_code = os.waitstatus_to_exitcode(status)
    done = subprocess.CompletedProcess(command, exit_code, *texts)
    assert done.returncode == code, done.stderr + done.stdout
    plain(done.stdout + done.stderr)
    return done


def plain(text: str) -> None:
    """What a command prints is for people: no numbers or arrays as numpy writes them."""
    found = NUMPY.search(text)
    assert found is None, text[max(found.start() - 80, 0) :][:200] if found else ""


@cache
def _import_all() -> None:
    """What commands import when they are called: once here, not in every copy."""
    for name in PACKAGES:
        room = importlib.import_module(f"bubblefit.{name}")
        for module in pkgutil.walk_packages(room.__path__, f"{room.__name__}."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)


def _become(
    command: list[str], cwd: Path, out: int, err: int, first: Callable[[], None] | None
) -> None:
    """What the copy does; it never comes back."""
    code = 70
    try:
        os.dup2(out, 1)
        os.dup2(err, 2)
        os.chdir(cwd)
        if first is not None:
            first()
        sys.stdout = os.fdopen(1, "w", encoding="utf-8", closefd=False)
        sys.stderr = os.fdopen(2, "w", encoding="utf-8", closefd=False)
        # As in a new interpreter; pytest keeps warnings and log records for itself.
        logging.root.handlers.clear()
        warnings.resetwarnings()
        for ignored in (DeprecationWarning, PendingDeprecationWarning, ImportWarning):
            warnings.simplefilter("ignore", ignored)
        warnings.simplefilter("error", RuntimeWarning)
        warnings.showwarning = _show
        try:
            main(command, prog_name="bubblefit")
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
        except BaseException:
            sys.excepthook(*sys.exc_info())
            code = 1
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


def _show(message: Any, category: type, filename: str, lineno: int, *_: object) -> None:
    print(f"{filename}:{lineno}: {category.__name__}: {message}", file=sys.stderr)


def interrupted(
    *arguments: object,
    cwd: Path,
    when: Callable[[], object],
    number: signal.Signals = signal.SIGINT,
) -> subprocess.CompletedProcess[str]:
    """Run the command in a new interpreter, send it a signal `when` it is time; how it ended."""
    command = [sys.executable, "-m", "bubblefit.cli", *map(str, arguments)]
    running = subprocess.Popen(
        command, cwd=cwd, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + TIMEOUT_S
    while not when():
        assert time.monotonic() < deadline and running.poll() is None
        time.sleep(0.01)
    running.send_signal(number)
    _, said = running.communicate(timeout=ENDING_S)
    return subprocess.CompletedProcess(command, running.returncode, None, said)


def a_start_is_stored(out: Path) -> bool:
    """Whether the fit that writes to `out` has finished its first start."""
    starts = out / "starts.jsonl"
    return starts.exists() and "\n" in starts.read_text()


def in_process(*arguments, cwd, code=0):
    """The same in this process."""
    here = Path.cwd()
    os.chdir(cwd)
    try:
        done = CliRunner().invoke(main, [str(a) for a in arguments])
    finally:
        os.chdir(here)
    assert done.exit_code == code, (done.output, done.exception)
    plain(done.output)
    return done


def result_in(folder: Path) -> dict:
    return json.loads((folder / "result.json").read_text())


def one_line(done, *words: str) -> None:
    assert len(done.stderr.splitlines()) == 1, done.stderr
    for word in words:
        assert word in done.stderr, done.stderr
