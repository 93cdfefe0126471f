"""meshes/beam_model.py: walls, braids and cords of a beam."""

import numpy as np
import pytest
from bubblefit.meshes.beam_model import BraidedWall, PlainWall, ThinTube, TubeCrossSection
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


TUBE_RADIUS, SHEAR = 170.0, 60.0
DIRECTIONS = (0.0, 17.0, 90.0, 233.0)


def tube_with_booms(angles=(), stiffness=800e3, axial=0.0):
    angles = np.array(angles, dtype=float)
    return ThinTube(TUBE_RADIUS, axial, SHEAR, angles, np.broadcast_to(stiffness, angles.shape))


def shear_flow_around(count, first=0.0):
    return first + 360.0 * np.arange(count) / count


def equal_booms(count):
    """Return the stiffness over r G of n equal booms, whose flow is constant between two.

    Jumps V r cos(a) / (n r^2 / 2) make flows V sin(a) / (n r sin(pi / n)) in the middles, whose
    squares add up to n / 2: V^2 pi / (n^2 r G sin^2(pi / n)).
    """
    return count**2 * np.sin(np.pi / count) ** 2 / np.pi


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_wall_without_booms_has_half_its_area_for_shear(direction):
    found = tube_with_booms(axial=400.0).shear_stiffness(direction)
    assert found == pytest.approx(np.pi * TUBE_RADIUS * SHEAR, rel=1e-12)


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("first", [0.0, 60.0, 11.0])
@pytest.mark.parametrize("count", [3, 4, 6, 24])
def test_equal_booms_without_wall_in_closed_form(count, first, direction):
    found = tube_with_booms(shear_flow_around(count, first)).shear_stiffness(direction)
    assert found == pytest.approx(equal_booms(count) * TUBE_RADIUS * SHEAR, rel=1e-9)


def test_shear_stiffness_of_three_and_of_many_booms():
    assert equal_booms(3) == pytest.approx(27 / (4 * np.pi), rel=1e-12)
    assert equal_booms(1000) == pytest.approx(np.pi, rel=1e-5)


def test_two_booms_are_the_webs_of_a_beam():
    """At the top and at the bottom: either half of the wall carries V / 2 over the height 2 r."""
    found = tube_with_booms([0.0, 180.0]).shear_stiffness()
    assert found == pytest.approx(8 / np.pi * TUBE_RADIUS * SHEAR, rel=1e-12)


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("axial", [1e-3, 20.0, 400.0])
def test_shear_flow_balances_the_force_without_twist(direction, axial):
    """Unequal booms anywhere; resultant of the flow by its tangent, twist by its mean."""
    section = tube_with_booms([5.0, 80.0, 200.0, 310.0], [8e5, 2e5, 5e5, 1e5], axial)
    angle, width, flow = section.shear_flow(direction)
    tangent = np.array([-np.sin(angle), np.cos(angle)])
    turn = np.radians(direction)
    np.testing.assert_allclose((width * flow) @ tangent.T, [np.cos(turn), np.sin(turn)], atol=1e-9)
    assert abs(width @ flow) < 1e-12
    # Equal where the section is turned with the force.
    turned = ThinTube(TUBE_RADIUS, axial, SHEAR, section.boom_angles + 41.0, section.boom_stiffness)
    same = section.shear_stiffness(direction)
    assert turned.shear_stiffness(direction + 41.0) == pytest.approx(same, rel=1e-9)


def test_wall_with_booms_lies_between_wall_and_booms():
    """By how much of the bending the booms carry; against a flow that is summed step by step."""
    section = tube_with_booms(shear_flow_around(3), 800e3, 100.0)
    step = 2 * np.pi / 36000
    at = step * (np.arange(36000) + 0.5)
    inertia = np.pi * TUBE_RADIUS**3 * 100.0 + 1.5 * 800e3 * TUBE_RADIUS**2
    rate = -100.0 * TUBE_RADIUS * np.cos(at) * TUBE_RADIUS * step / inertia
    for boom in np.radians(shear_flow_around(3)):
        rate[int(np.argmin(np.abs(at - step / 2 - boom)))] -= (
            800e3 * TUBE_RADIUS * np.cos(boom) / inertia
        )
    flow = np.cumsum(rate)
    flow -= flow.mean()
    by_steps = SHEAR / (flow**2 * TUBE_RADIUS * step).sum()
    found = section.shear_stiffness()
    assert found == pytest.approx(by_steps, rel=1e-3)
    assert 27 / (4 * np.pi) < found / (TUBE_RADIUS * SHEAR) < np.pi
