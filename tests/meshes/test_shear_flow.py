"""meshes/shear_flow.py: shear flow around thin round sections, by closed forms and balance."""

import numpy as np
import pytest
from bubblefit.meshes.shear_flow import ThinTube

RADIUS, SHEAR = 170.0, 60.0
DIRECTIONS = (0.0, 17.0, 90.0, 233.0)


def tube_with_booms(angles=(), stiffness=800e3, axial=0.0):
    angles = np.array(angles, dtype=float)
    return ThinTube(RADIUS, axial, SHEAR, angles, np.broadcast_to(stiffness, angles.shape))


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
    assert found == pytest.approx(np.pi * RADIUS * SHEAR, rel=1e-12)


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("first", [0.0, 60.0, 11.0])
@pytest.mark.parametrize("count", [3, 4, 6, 24])
def test_equal_booms_without_wall_in_closed_form(count, first, direction):
    found = tube_with_booms(shear_flow_around(count, first)).shear_stiffness(direction)
    assert found == pytest.approx(equal_booms(count) * RADIUS * SHEAR, rel=1e-9)


def test_shear_stiffness_of_three_and_of_many_booms():
    assert equal_booms(3) == pytest.approx(27 / (4 * np.pi), rel=1e-12)
    assert equal_booms(1000) == pytest.approx(np.pi, rel=1e-5)


def test_two_booms_are_the_webs_of_a_beam():
    """At the top and at the bottom: either half of the wall carries V / 2 over the height 2 r."""
    found = tube_with_booms([0.0, 180.0]).shear_stiffness()
    assert found == pytest.approx(8 / np.pi * RADIUS * SHEAR, rel=1e-12)


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
    turned = ThinTube(RADIUS, axial, SHEAR, section.boom_angles + 41.0, section.boom_stiffness)
    same = section.shear_stiffness(direction)
    assert turned.shear_stiffness(direction + 41.0) == pytest.approx(same, rel=1e-9)


def test_wall_with_booms_lies_between_wall_and_booms():
    """By how much of the bending the booms carry; against a flow that is summed step by step."""
    section = tube_with_booms(shear_flow_around(3), 800e3, 100.0)
    step = 2 * np.pi / 36000
    at = step * (np.arange(36000) + 0.5)
    inertia = np.pi * RADIUS**3 * 100.0 + 1.5 * 800e3 * RADIUS**2
    rate = -100.0 * RADIUS * np.cos(at) * RADIUS * step / inertia
    for boom in np.radians(shear_flow_around(3)):
        rate[int(np.argmin(np.abs(at - step / 2 - boom)))] -= (
            800e3 * RADIUS * np.cos(boom) / inertia
        )
    flow = np.cumsum(rate)
    flow -= flow.mean()
    by_steps = SHEAR / (flow**2 * RADIUS * step).sum()
    found = section.shear_stiffness()
    assert found == pytest.approx(by_steps, rel=1e-3)
    assert 27 / (4 * np.pi) < found / (RADIUS * SHEAR) < np.pi
