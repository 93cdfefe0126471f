"""meshes/beam_model.py: walls, braids and cords of a beam."""

import numpy as np
import pytest
from bubblefit.meshes.beam_model import BraidedWall, PlainWall, TubeCrossSection
from bubblefit.meshes.cylinder_model import Cord, axial_table

from ..support.refusals import refused

RADIUS, PRESSURE, SPAN, SHEAR_SPAN = 170.0, 0.1, 3200.0, 1100.0
PLAIN = PlainWall(400.0, 300.0, 60.0, 0.2, wrinkles=False)
BRAID = BraidedWall(65.0, 2000.0, 2.0, 9.6, 3.33)
CORD = axial_table(800e3)
ONE_UP = (0.0, 120.0, 240.0)
TWO_UP = (60.0, 180.0, 300.0)


def tube_section(wall=BRAID, angles=ONE_UP, table=CORD, **more):
    return TubeCrossSection(RADIUS, PRESSURE, wall, [Cord(a, table, **more) for a in angles])


@pytest.mark.parametrize("angle", [56.0, 60.0, 65.0, 71.0])
def test_braid_pulls_as_yarns_of_constant_length(angle):
    wall = BraidedWall(angle, 2000.0, 2.0, 9.6, 3.33)
    beta, cot = np.radians(angle), 1 / np.tan(np.radians(angle))

    def inside(strain):  # p V of a tube whose length was 1
        turned = np.arccos(np.cos(beta) * (1 + strain))
        return PRESSURE * np.pi * (RADIUS * np.sin(turned) / np.sin(beta)) ** 2 * (1 + strain)

    def left(strain):
        force, slope = wall.pull(np.array([strain]), PRESSURE, RADIUS)
        held = 2 * np.pi * RADIUS * (force[0] - wall.axial * strain)
        return PRESSURE * np.pi * RADIUS**2 - held, slope[0]

    for strain in (-0.004, 0.0, 0.006):
        by_volume = (inside(strain + 1e-5) - inside(strain - 1e-5)) / 2e-5
        assert left(strain)[0] == pytest.approx(by_volume, rel=1e-6)
    thrust = PRESSURE * np.pi * RADIUS**2
    assert left(0.0)[0] == pytest.approx(thrust * (1 - 2 * cot**2), rel=1e-12)
    assert left(0.0)[1] == pytest.approx(wall.axial + 3 * PRESSURE * RADIUS * cot**2, rel=1e-12)
    own = TubeCrossSection(RADIUS, PRESSURE, wall, [Cord(a, CORD) for a in ONE_UP])
    assert own.cord_forces == pytest.approx([thrust * (1 - 2 * cot**2) / 3] * 3)
    normal, moment, _ = own.resultants(np.zeros(1), np.zeros(1))
    assert np.abs([normal[0], moment[0] / RADIUS]).max() < 1e-9 * thrust


@pytest.mark.parametrize(("angles", "times"), [(ONE_UP, 1.0), (TWO_UP, 2.0)])
def test_limit_moment_is_that_of_the_slack_cords(angles, times):
    """One cord up: the two others carry the thrust that the braid leaves, at half the radius."""
    wall = BraidedWall(65.0, 1e-6, 40.0, 1e-6, 1e-6)
    axial = wall.axial + 3 * PRESSURE * RADIUS / np.tan(np.radians(65.0)) ** 2
    own = TubeCrossSection(RADIUS, PRESSURE, wall, [Cord(a, axial_table(1e9)) for a in angles])
    bend = 1e-5
    strain = 0.0
    for _ in range(60):
        normal, moment, k = own.resultants(np.array([strain]), np.array([bend]))
        strain -= normal[0] / k[0, 0, 0]
    by_wall = axial * np.pi * RADIUS**3 * bend
    plateau = times * 0.5 * np.pi * PRESSURE * RADIUS**3 * (1 - 2 / np.tan(np.radians(65)) ** 2)
    assert moment[0] - by_wall == pytest.approx(plateau, rel=0.02)


def test_plain_wall_wrinkles_at_half_of_pi_p_r_cubed():
    """Axial stress p r / 2 is gone at the top when M = pi p r^3 / 2 (Comer and Levy)."""
    wall = PlainWall(400.0, 300.0, 60.0, 0.0)
    own = TubeCrossSection(RADIUS, PRESSURE, wall)
    bend = 0.5 * PRESSURE / wall.axial
    _, moment, _ = own.resultants(np.zeros(1), np.array([bend]))
    assert moment[0] == pytest.approx(0.5 * np.pi * PRESSURE * RADIUS**3, rel=1e-9)
    normal, _, stiff = own.resultants(np.zeros(1), np.array([4 * bend]))
    assert normal[0] > 0 and stiff[0, 1, 1] < 0.9 * wall.axial * np.pi * RADIUS**3


def test_wall_and_cords_of_a_plain_tube_share_the_thrust():
    own = tube_section(PLAIN, prestrain=1e-4)
    thrust, hoop = PRESSURE * np.pi * RADIUS**2, 0.2 * 300 / 400 * PRESSURE * RADIUS
    around = 2 * np.pi * RADIUS
    strain = (thrust - around * hoop - 3 * 800e3 * 1e-4) / (around * 400 + 3 * 800e3)
    assert own.cord_forces == pytest.approx([800e3 * (strain + 1e-4)] * 3, rel=1e-9)
    normal, _, _ = own.resultants(np.zeros(1), np.zeros(1))
    assert abs(normal[0]) < 1e-6 * thrust


def test_braid_without_a_holding_cord_is_refused():
    raised = refused(tube_section, BraidedWall(50.0, 2000.0, 2.0, 9.6, 3.33))
    assert raised.field == "angle" and "54.7" in raised.problem
    assert refused(tube_section, BRAID, ()).field == "angle"
