"""Fixtures of the tests of solvers."""

import pytest


@pytest.fixture
def no_ccx(tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    (tmp_path / "cache").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setenv("BUBBLEFIT_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("BUBBLEFIT_CCX", raising=False)
    return tmp_path
