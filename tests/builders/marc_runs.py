"""The stand-in as tests use it: a folder of its own in which runs are counted and faults named."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from bubblefit.solvers.registry import solver_named

from ..support import needs

TESTS = Path(__file__).resolve().parents[1]


@dataclass
class StandIn:
    folder: Path

    @property
    def program(self) -> Path:
        return self.folder / "run_marc"

    @property
    def runs(self) -> list[str]:
        path = self.folder / "runs"
        return path.read_text().splitlines() if path.exists() else []

    def told(self, fault: str) -> None:
        (self.folder / "fault").write_text(fault)

    def solver(self, **settings) -> Any:
        if settings.get("law") == "hypela2":
            needs.fortran()
        scratch = self.folder / "scratch"
        scratch.mkdir(exist_ok=True)
        return solver_named("marc", marc=self.program, **{
            "increments": 0, "scratch": str(scratch), **settings
        })  # fmt: skip


@cache
def server() -> Path:
    """Start the server of jobs of this process, which ends with it; return its socket."""
    folder = tempfile.TemporaryDirectory(prefix="marc-")
    place = Path(folder.name) / "socket"
    paths = os.pathsep.join(filter(None, (str(TESTS), os.environ.get("PYTHONPATH"))))
    process = subprocess.Popen(
        [sys.executable, "-m", "marc_stand_in.server", place], stdin=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    atexit.register(process.kill)
    atexit.register(folder.cleanup)
    while not place.exists():
        assert process.poll() is None, "the stand-in does not start"
        time.sleep(0.01)
    return place


def stand_in(folder: Path) -> StandIn:
    folder.mkdir(parents=True, exist_ok=True)
    found = StandIn(folder)
    found.program.write_text(
        f'#!/bin/sh\nexport MARC_STAND_IN_FOLDER="{folder}" BUBBLEFIT_PYTHON="{sys.executable}"\n'
        f'exec "{sys.executable}" -I -S "{TESTS}/marc_stand_in/client.py" "{server()}" "$@"\n'
    )
    found.program.chmod(0o755)
    return found


@pytest.fixture
def marc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> StandIn:
    monkeypatch.delenv("BUBBLEFIT_MARC", raising=False)
    monkeypatch.delenv("MARC_STAND_IN_FAULT", raising=False)
    return stand_in(tmp_path / "marc")
