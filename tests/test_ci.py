"""`.ci/run`: what it makes, and that a test may not be left out there."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from .places import ROOT

SCRIPT = ROOT / ".ci" / "run"


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """A copy of the script, with a `make` that writes down what it is asked for."""
    (tmp_path / ".ci").mkdir()
    shutil.copy(SCRIPT, tmp_path / ".ci" / "run")
    make = tmp_path / "bin" / "make"
    make.parent.mkdir()
    make.write_text('#!/bin/sh\necho "CI=$CI $*"\n[ "$1" != "$FAULT" ]\n')
    make.chmod(0o755)
    return tmp_path


def run(house: Path, fault: str = "") -> tuple[int, list[str]]:
    """Exit code, and what was made."""
    environment = {name: value for name, value in os.environ.items() if name != "CI"}
    path = f"{house / 'bin'}:{os.environ['PATH']}"
    done = subprocess.run(
        [house / ".ci" / "run"],
        env={**environment, "PATH": path, "FAULT": fault},
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stdout.splitlines()


def test_it_lints_and_tests_with_ci_set(house: Path) -> None:
    code, made = run(house)
    assert code == 0
    assert made == ["CI=1 lint", "CI=1 test", "CI=1 mutants CHANGED=1 MINUTES=3"]


@pytest.mark.parametrize("target", ["lint", "test"])
def test_it_ends_with_the_first_failure(house: Path, target: str) -> None:
    code, made = run(house, target)
    assert code != 0 and made[-1] == f"CI=1 {target}"


def test_mutants_fail_nothing(house: Path) -> None:
    code, made = run(house, "mutants")
    assert code == 0 and made[-1] == "mutants: not tried to the end"


def gfortran(folder: Path) -> subprocess.CompletedProcess[str]:
    script = ROOT / ".ci" / "gfortran"
    return subprocess.run(
        ["/bin/sh", script], env={"PATH": str(folder)}, capture_output=True, text=True
    )


def test_gfortran_is_there_or_is_installed_or_named(tmp_path: Path) -> None:
    for name in ("dirname", "id", "env"):
        (tmp_path / name).symlink_to(shutil.which(name) or name)
    without = gfortran(tmp_path)
    assert without.returncode == 1
    assert "apt-get install gfortran" in without.stderr
    apt = tmp_path / "apt-get"
    apt.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/asked\n')
    apt.chmod(0o755)
    if os.geteuid() == 0:
        assert gfortran(tmp_path).returncode == 0
        assert " gfortran " in (tmp_path / "asked").read_text()
        (tmp_path / "asked").unlink()
    (tmp_path / "gfortran").symlink_to(shutil.which("true") or "true")
    with_it = gfortran(tmp_path)
    assert with_it.returncode == 0 and not with_it.stderr
    assert not (tmp_path / "asked").exists()
