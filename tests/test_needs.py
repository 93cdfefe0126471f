"""No test is left out in CI, and `needs` is the one place where it is elsewhere."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from . import needs
from .places import ROOT

#: What leaves a test out, or lets it fail.
WORDS = {"skip", "skipif", "skipIf", "skipUnless", "SkipTest", "importorskip", "xfail"}


def left_out(path: Path) -> list[str]:
    """file:line of every name in WORDS that the code of a file uses."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        imported = [alias.name for alias in getattr(node, "names", []) if hasattr(alias, "name")]
        for name in [getattr(node, "attr", ""), *imported]:
            if name in WORDS:
                found.append(f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 0)} {name}")
    return found


def test_nothing_else_leaves_a_test_out() -> None:
    files = sorted((ROOT / "tests").rglob("*.py"))
    assert len(files) > 150
    found = [line for path in files for line in left_out(path)]
    # That place, and the check of it below.
    assert [line.split(":")[0] for line in found] == ["tests/needs.py", "tests/test_needs.py"], (
        found
    )


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A machine without any program, and without measured data."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("BUBBLEFIT_CACHE", str(tmp_path))
    for name in ("CC", "BUBBLEFIT_CCX"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(needs, "SHARED", tmp_path / "shared" / "data")


WANTS = {
    "install gfortran": needs.fortran,
    "install gcc": needs.c_compiler,
    "ccx": needs.calculix,
    "no measured data": needs.measured_data,
    "no_such_library cannot be loaded": lambda: needs.library("no_such_library"),
}


@pytest.mark.parametrize("words", WANTS)
def test_what_is_missing_skips_here_and_fails_in_ci(
    words: str, bare: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CI", raising=False)
    with pytest.raises(pytest.skip.Exception, match=words):
        WANTS[words]()
    monkeypatch.setenv("CI", "1")
    with pytest.raises(pytest.fail.Exception, match=words):
        WANTS[words]()
