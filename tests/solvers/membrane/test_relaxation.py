"""Tension field: conditions at a point, derivatives, a tube bent beyond its first wrinkle."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.point_law import SLOPES
from bubblefit.materials.wrinkles import relaxed_update
from bubblefit.runs.verification.closed_forms import FIRST, PlaneEnds, published_moment
from hypothesis import given, settings
from hypothesis import strategies as st

from ...solvers.membrane.test_inflated import LAW

strains = st.tuples(*[st.floats(-0.08, 0.08)] * 2, st.floats(-0.2, 0.2)).map(np.array)
TAUT, WRINKLED, SLACK = 0, 1, 2


def update(h, h_old=(0, 0, 0), s_old=(0, 0, 0), share=0.01, law=LAW):
    """State, strain and stress of the fabric, carried stress, its slope, that of the strain."""
    he, s, carried = (np.empty(3) for _ in range(3))
    tangent, slope, unused = np.empty((3, 3)), np.empty((3, 3)), np.empty(SLOPES)
    state = relaxed_update(
        law.pieces, law.coupling, share, np.array(h, float), np.array(h_old, float),
        np.array(s_old, float), he, s, carried, tangent, unused, slope,
    )  # fmt: skip
    return state, he, s, carried, tangent, slope


def principal(a: float, b: float, c: float) -> np.ndarray:
    return np.linalg.eigvalsh([[a, c], [c, b]])


@settings(max_examples=400, deadline=None)
@given(strains, strains)
def test_no_compression_and_no_work_on_a_wrinkle(first: np.ndarray, then: np.ndarray) -> None:
    """Both increments: the second starts from whatever state the first one ended in."""
    _, he, s, *_ = update(first)
    for h, old, s_old in ((first, np.zeros(3), np.zeros(3)), (then, he, s)):
        state, fabric, stress, *_ = update(h, old, s_old)
        assert state >= 0
        wrinkle = fabric - h
        assert principal(*stress)[0] >= -1e-9
        assert principal(*(wrinkle * [1, 1, 0.5]))[0] >= -1e-11
        assert abs(stress @ wrinkle) < 1e-9
        assert (state == TAUT) == (not wrinkle.any())
        assert state != SLACK or not stress.any()


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_derivatives_of_stress_and_strain(seed: int) -> None:
    """At strains off the axes, where moduli (held below zero strain) have kinks of their own.

    The increment is small beside the range of strain: through a large one the midpoint's moduli
    may know two wrinkled states, and a difference may reach from one to the other.
    """
    rng = np.random.default_rng(seed)
    first = rng.normal(0.01, [0.04, 0.04, 0.08])
    then = first + rng.normal(0.0, [0.015, 0.015, 0.03])
    _, old, s_old, *_ = update(first)
    state, _, _, _, tangent, slope = update(then, old, s_old)
    step = 1e-7
    stress, strain = np.empty((3, 3)), np.empty((3, 3))
    for j in range(3):
        up, down = (update(then + k * step * np.eye(3)[j], old, s_old) for k in (1, -1))
        if {up[0], down[0]} != {state}:
            return  # a kink within the difference
        stress[:, j] = (up[3] - down[3]) / (2 * step)
        strain[:, j] = (up[1] - down[1]) / (2 * step)
    assert tangent == pytest.approx(stress, abs=2e-5 * np.abs(stress).max())
    assert slope == pytest.approx(strain, abs=2e-5)


@given(st.floats(0.001, 0.08), st.floats(0.001, 0.3))
def test_a_strip_that_is_pulled_wrinkles_where_it_is_narrowed(
    along: float, narrower: float
) -> None:
    """Fabric pulled along the fill and narrowed by more than nu: the stress of a free strip."""
    law = HypoelasticLaw.linear(800.0, 140.0, 20.0, 0.24)
    free = -0.24 * 140.0 / 800.0 * along
    state, he, s, *_ = update([free - narrower, along, 0.0], law=law)
    assert state == WRINKLED
    assert s == pytest.approx([0.0, 140.0 * along, 0.0], rel=1e-12, abs=1e-10)
    assert he == pytest.approx([free, along, 0.0], rel=1e-12, abs=1e-14)


def test_what_is_left_to_wrinkles_vanishes_with_its_share() -> None:
    _, _, s, *_ = update([-0.03, 0.05, 0.02])
    excess = [np.abs(update([-0.03, 0.05, 0.02], share=k)[3] - s).max() for k in (1e-2, 1e-4, 0.0)]
    assert excess[0] == pytest.approx(100 * excess[1], rel=1e-9)
    assert excess[2] == 0.0


def test_bent_tube_wrinkles_as_published() -> None:
    """At multiples of the curvature of the first wrinkle; 1e-4 is left to wrinkles."""
    tube, taut = PlaneEnds(32, 1e-4), PlaneEnds(32, None)
    for times in (1.5, 2.5, 4.0):
        wrinkled, moment, radius = tube.moment(times * FIRST)
        expected_wrinkled, expected = published_moment(times * FIRST, radius)
        assert moment == pytest.approx(expected, rel=2e-3)
        assert wrinkled == pytest.approx(expected_wrinkled, abs=1.0 / 32)
    # A membrane that carries compression goes on as it began.
    assert taut.moment(1.5 * FIRST)[1] == pytest.approx(0.75, rel=1e-2)
