"""Commands as a user runs them, for the tests: in a process of their own or in this one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from bubblefit.cli.main import main
from click.testing import CliRunner

ENVIRONMENT = {**os.environ, "PYTHONWARNINGS": "error::RuntimeWarning"}


def bubblefit(*arguments, cwd, code=0, **options):
    """Run the command; assert its exit code; return the finished process."""
    done = subprocess.run(
        [sys.executable, "-m", "bubblefit.cli", *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=300,
        env=ENVIRONMENT,
        **options,
    )
    assert done.returncode == code, done.stderr + done.stdout
    return done


def in_process(*arguments, cwd, code=0):
    """The same in this process."""
    here = Path.cwd()
    os.chdir(cwd)
    try:
        done = CliRunner().invoke(main, [str(a) for a in arguments])
    finally:
        os.chdir(here)
    assert done.exit_code == code, (done.output, done.exception)
    return done


def result_in(folder: Path) -> dict:
    return json.loads((folder / "result.json").read_text())


def one_line(done, *words: str) -> None:
    assert len(done.stderr.splitlines()) == 1, done.stderr
    for word in words:
        assert word in done.stderr, done.stderr
