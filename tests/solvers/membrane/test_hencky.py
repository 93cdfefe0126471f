"""Hencky's inflated circular membrane (1915): the solver at small strains, and its order."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.runs.verification.closed_forms import (
    FICHTER,
    MODULUS,
    RADIUS,
    TERMS,
    THICKNESS,
    apex_coefficient,
    stress_series,
)
from bubblefit.solvers.membrane.solver import MembraneSolver


def apex(elements: int, pressure: float, nu: float, change: str = "constant") -> float:
    law = HypoelasticLaw.linear(MODULUS, MODULUS, MODULUS / 2 / (1 + nu), nu, change)
    mesh = disk_mesh(RADIUS, elements, "quarter")
    history = MembraneSolver().run(BubbleModel(mesh, THICKNESS, [pressure]), law)
    return float(history.displacement[0, mesh.node_sets["apex"][0], 2])


def hencky(pressure: float, nu: float) -> float:
    scale = (pressure * RADIUS / (MODULUS * THICKNESS)) ** (1 / 3)
    return apex_coefficient(nu) * RADIUS * scale


def pressure_for(height: float, nu: float) -> float:
    """MPa at which Hencky's apex is height * R."""
    return (height / apex_coefficient(nu)) ** 3 * MODULUS * THICKNESS / RADIUS


@pytest.mark.parametrize(("nu", "b_0"), FICHTER.items())
def test_the_series_itself_against_fichter(nu: float, b_0: float) -> None:
    """W. B. Fichter, NASA TP 3658 (1997), table of b_0 for Hencky's problem; four decimals."""
    c = stress_series(b_0 / 4)
    assert (1 - nu) * c.sum() + 2 * np.arange(TERMS) @ c == pytest.approx(0.0, abs=5e-5)
    assert c[1] == pytest.approx(-1 / b_0**2 / 4)
    assert abs(c[-1]) < 1e-12


def test_the_classic_coefficient() -> None:
    """0.653 for nu = 0.3 (Hencky's number, as quoted by Timoshenko's successors)."""
    assert apex_coefficient(0.3) == pytest.approx(0.653, abs=5e-4)


@pytest.mark.parametrize("nu", [0.1, 0.24, 0.3, 0.45])
def test_apex_within_half_a_percent_on_a_fine_mesh(nu: float) -> None:
    pressure = pressure_for(0.02, nu)  # strains of about 2.5e-4
    assert apex(3200, pressure, nu) == pytest.approx(hencky(pressure, nu), rel=5e-3)


def test_second_order_convergence_to_hencky(capsys: pytest.CaptureFixture[str]) -> None:
    """Nested meshes; what the small slopes of the theory leave out (height squared) is removed."""
    nu, counts = 0.3, [128, 512, 2048, 8192]  # n = 4, 8, 16, 32 divisions of the core

    def errors(height: float) -> np.ndarray:
        pressure = pressure_for(height, nu)
        return np.array([apex(n, pressure, nu) for n in counts]) / hencky(pressure, nu) - 1.0

    low, high = errors(0.02), errors(0.04)
    small = (4 * low - high) / 3
    order = np.log2(small[:-1] / small[1:])
    with capsys.disabled():
        print(f"\nHencky: quads {[n // 4 for n in counts]}, relative error of the apex {small}")
        print(f"order {order.round(2)}; at height 0.02 R {low}, 0.04 R {high}")
    assert [len(disk_mesh(RADIUS, n, "quarter").quads) for n in counts] == [32, 128, 512, 2048]
    assert order == pytest.approx(np.full(3, 2.0), abs=0.2)
    assert 0 < small[-1] < 1e-4
    assert low[-1] < 5e-3 and high[-1] < 5e-3


def test_thickness_change_does_not_matter_at_small_strain() -> None:
    pressure = pressure_for(0.02, 0.3)
    constant, thin = (apex(192, pressure, 0.3, c) for c in ("constant", "incompressible"))
    assert thin == pytest.approx(constant, rel=1e-3)
    assert thin > constant


def test_height_grows_with_the_cube_root_of_pressure() -> None:
    low, high = pressure_for(0.01, 0.3), 8 * pressure_for(0.01, 0.3)
    assert apex(192, high, 0.3) / apex(192, low, 0.3) == pytest.approx(2.0, rel=5e-4)
