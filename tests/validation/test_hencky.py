"""Validation: bubbles at low pressure against Hencky's series."""

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.runs.verification.bubbles import (
    FICHTER,
    MODULUS,
    RADIUS,
    TERMS,
    THICKNESS,
    apex_coefficient,
    pressure_at,
    stress_series,
)
from bubblefit.solvers.membrane.solver import MembraneSolver


def apex_of(elements, pressure, nu, change="constant"):
    law = HypoelasticLaw.linear(MODULUS, MODULUS, MODULUS / 2 / (1 + nu), nu, change)
    mesh = disk_mesh(RADIUS, elements, "quarter")
    history = MembraneSolver().run(BubbleModel(mesh, THICKNESS, [pressure]), law)
    return float(history.displacement[0, mesh.node_sets["apex"][0], 2])


@pytest.mark.parametrize(("nu", "b_0"), FICHTER.items())
def test_hencky_series_has_the_coefficients_of_fichter(nu, b_0):
    """W. B. Fichter, NASA TP 3658 (1997), table of b_0 for Hencky's problem; four decimals."""
    c = stress_series(b_0 / 4)
    assert (1 - nu) * c.sum() + 2 * np.arange(TERMS) @ c == pytest.approx(0.0, abs=5e-5)
    assert c[1] == pytest.approx(-1 / b_0**2 / 4)
    assert abs(c[-1]) < 1e-12
    assert apex_coefficient(0.3) == pytest.approx(0.653, abs=5e-4)  # Hencky


def test_bubble_converges_to_hencky_with_second_order():
    """Nested meshes; what the small slopes of the theory leave out (height squared) is removed."""
    counts = [128, 512, 2048, 8192]  # n = 4, 8, 16, 32 divisions of the core
    assert [len(disk_mesh(RADIUS, n, "quarter").quads) for n in counts] == [32, 128, 512, 2048]
    low, high = (
        np.array([apex_of(n, pressure_at(h, 0.3), 0.3) for n in counts]) / (h * RADIUS) - 1.0
        for h in (0.02, 0.04)
    )
    small = (4 * low - high) / 3
    assert np.log2(small[:-1] / small[1:]) == pytest.approx(np.full(3, 2.0), abs=0.2)
    assert 0 < small[-1] < 1e-4
    assert low[-1] < 5e-3 and high[-1] < 5e-3
