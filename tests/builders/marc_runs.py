"""The stand-in as tests use it: a folder of its own in which runs are counted and faults named."""

from __future__ import annotations

import sys
from dataclasses import dataclass
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


def stand_in(folder: Path) -> StandIn:
    folder.mkdir(parents=True, exist_ok=True)
    found = StandIn(folder)
    found.program.write_text(
        f'#!/bin/sh\nexport MARC_STAND_IN_FOLDER="{folder}"\nBUBBLEFIT_PYTHON="{sys.executable}" '
        f'exec "{TESTS}/marc_stand_in/run_marc" "$@"\n'
    )
    found.program.chmod(0o755)
    return found


@pytest.fixture
def marc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> StandIn:
    monkeypatch.delenv("BUBBLEFIT_MARC", raising=False)
    monkeypatch.delenv("MARC_STAND_IN_FAULT", raising=False)
    return stand_in(tmp_path / "marc")
