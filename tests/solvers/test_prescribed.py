"""solvers/prescribed.py: elongations of a gauge reached by correction."""

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.prescribed import at_elongations, corrected

from ..support.refusals import raised
from .calculix.cases import COARSE, STRIP_LAW, strip_model_of


def relative_load_difference(found, expected):
    assert found.load.shape == expected.load.shape
    return float(np.abs(found.load - expected.load).max() / expected.load[-1])


def test_second_run_corrects_elongations_without_the_membrane(ccx, monkeypatch):
    coarse = strip_model_of("bias", 12, **COARSE)
    expected = CalculixSolver(element="S4").run(coarse, STRIP_LAW)
    # The gauge has the measured length. Sideways, the nodes do not move in proportion: the
    # spline's error over a coarse increment.
    ends = (coarse.mesh.points[n] + expected.displacement[:, n]
            for n in coarse.mesh.node_sets["gauge"])  # fmt: skip
    length = np.linalg.norm(np.subtract(*ends), axis=1) - coarse.gauge_length
    np.testing.assert_allclose(length, coarse.elongations, atol=1e-4)

    def refuse(*_, **__):
        raise SolverFailure("no equilibrium")

    monkeypatch.setattr(MembraneSolver, "run", refuse)
    found = CalculixSolver(element="S4").run(coarse, STRIP_LAW)
    # On so coarse a mesh the membrane's grips are 5 % off at first, and the law's increments with
    # them; the second run meets them. Second order in twelve increments.
    assert relative_load_difference(found, expected) < 3e-4


def test_gauge_that_is_not_reached_is_a_failure(ccx, monkeypatch, tmp_path):
    coarse = strip_model_of("bias", 4, **COARSE)
    short = np.array(coarse.elongations)
    monkeypatch.setattr("bubblefit.solvers.prescribed.as_the_membrane", lambda *_: short)
    with pytest.raises(SolverFailure, match=r"opened by \S+ mm only and not by 10\.967") as found:
        CalculixSolver(element="S4", scratch=tmp_path).run(coarse, STRIP_LAW)
    assert (found.value.scratch / "job.inp").exists()


def test_gauge_that_turns_back_is_a_failure():
    coarse = strip_model_of("bias", 2, **COARSE)
    gauge = np.array([6.0, 5.0, 12.0])
    raised(SolverFailure, "gets shorter", at_elongations, gauge, coarse, np.zeros(3), "calculix")
    with pytest.raises(SolverFailure, match="gets shorter"):
        corrected(coarse, np.array([1.0, 2.0, 3.0]), gauge, "calculix")
    # A correction reaches beyond the first run.
    half = np.array(coarse.elongations) / 2
    pulls = corrected(coarse, 3 * half, half, "calculix")
    np.testing.assert_allclose(pulls[:2], 3 * np.array(coarse.elongations))
    assert pulls[2] > pulls[1]
