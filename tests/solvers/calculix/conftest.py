"""Fixtures of the tests with CalculiX: a fake program and results."""

import pytest
from bubblefit.solvers.calculix import solver as module
from bubblefit.solvers.calculix.solver import CalculixSolver

from .cases import LINEAR_LAW, small_bubble


@pytest.fixture
def fake_ccx(tmp_path, monkeypatch):
    """Makes a solver of a shell script, which runs in the scratch folder with $2 = job."""
    monkeypatch.setattr(module, "material_library", lambda: tmp_path / "libBUBBLEFIT.so")

    def make(script, **options):
        path = tmp_path / "ccx"
        path.write_text(f'#!/bin/sh\n[ "$1" = -v ] && echo "Version 9.9" && exit\n{script}\n')
        path.chmod(0o755)
        (tmp_path / "scratch").mkdir(exist_ok=True)
        return CalculixSolver(ccx=path, element="S4", scratch=tmp_path / "scratch", **options)

    return make


@pytest.fixture(scope="module")
def ccx_results(ccx, tmp_path_factory):
    folder = tmp_path_factory.mktemp("real")
    CalculixSolver(element="S4", scratch=folder, keep=True).run(small_bubble(), LINEAR_LAW)
    (kept,) = folder.iterdir()
    return kept
