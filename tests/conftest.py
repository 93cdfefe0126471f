"""What several test files share."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from bubblefit.errors import BubblefitError
from bubblefit.experiments import registry as experiments
from bubblefit.solvers import registry as solvers
from bubblefit.solvers.calculix.executable import Executable, find_ccx
from hypothesis import settings

from .bars import BarKind, BarSolver

# The first call of a kernel compiles it, or reads it from the cache.
settings.register_profile("bubblefit", deadline=None)
settings.load_profile("bubblefit")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of measured data beside the repository; tests that need it skip without."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no measured data: {folder} is not there")
    return folder


@pytest.fixture(scope="session")
def ccx() -> Executable:
    """A ccx that can load material libraries; without one tests skip, except in CI."""
    try:
        return find_ccx()
    except BubblefitError as error:
        if os.environ.get("CI"):
            pytest.fail(f"CI needs CalculiX: {error}")
        pytest.skip(str(error))


@pytest.fixture
def packages(tmp_path, monkeypatch):
    """A folder on sys.path for distributions of a test, see `plug_ins.install`."""
    folder = tmp_path / "packages"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    yield folder
    for name in [name for name in sys.modules if name.startswith("acme_")]:
        del sys.modules[name]


@pytest.fixture
def bars(monkeypatch: pytest.MonkeyPatch) -> BarSolver:
    """A solver and a kind of test, both named bars; the solver is the one that runs."""
    solver, known = BarSolver(), dict(experiments.kinds())
    for module in ("studies.series", "fits.simulation", "fits.project"):
        monkeypatch.setattr(f"bubblefit.{module}.kinds", lambda: {**known, "bars": BarKind()})
    monkeypatch.setitem(solvers.SOLVERS, "bars", lambda: solver)
    return solver
