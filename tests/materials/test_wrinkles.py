"""materials/wrinkles.py: taut, wrinkled and slack states of a fabric."""

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.pieces import PointState, point_response
from bubblefit.materials.wrinkles import FabricIncrement, relaxed_update, wrinkle_work
from hypothesis import given, settings
from hypothesis import strategies as st

from ..solvers.membrane.test_closed import LAW

strains = st.tuples(*[st.floats(-0.08, 0.08)] * 2, st.floats(-0.2, 0.2)).map(np.array)
TAUT, WRINKLED, SLACK = 0, 1, 2


def relaxed_update_of(h, h_old=(0, 0, 0), s_old=(0, 0, 0), share=0.01, law=LAW):
    he, s = np.empty(3), np.empty(3)
    work, written = wrinkle_work(), point_response().law
    before = PointState(np.array(h_old, float), np.array(s_old, float))
    after = PointState(he, s)
    increment = FabricIncrement(law.compiled, before, np.array(h, float), after, written)
    state = relaxed_update(increment, share, work)
    return state, he, s, work.membrane_stress, written.tangent, work.strain_slope


def principal(a, b, c):
    return np.linalg.eigvalsh([[a, c], [c, b]])


@settings(max_examples=200, deadline=None)
@given(strains, strains)
def test_wrinkled_state_has_no_compression_and_no_work(first, then):
    _, he, s, *_ = relaxed_update_of(first)
    for h, old, s_old in ((first, np.zeros(3), np.zeros(3)), (then, he, s)):
        state, fabric, stress, *_ = relaxed_update_of(h, old, s_old)
        assert state >= 0
        wrinkle = fabric - h
        assert principal(*stress)[0] >= -1e-9
        assert principal(*(wrinkle * [1, 1, 0.5]))[0] >= -1e-11
        assert abs(stress @ wrinkle) < 1e-9
        assert (state == TAUT) == (not wrinkle.any())
        assert state != SLACK or not stress.any()


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_derivatives_of_relaxed_stress_against_differences(seed):
    """At strains off the axes, where moduli (held below zero strain) have kinks of their own."""
    rng = np.random.default_rng(seed)
    first = rng.normal(0.01, [0.04, 0.04, 0.08])
    then = first + rng.normal(0.0, [0.015, 0.015, 0.03])
    _, old, s_old, *_ = relaxed_update_of(first)
    state, _, _, _, tangent, slope = relaxed_update_of(then, old, s_old)
    step, stress, strain = 1e-7, np.empty((3, 3)), np.empty((3, 3))
    for j in range(3):
        up, down = (relaxed_update_of(then + k * step * np.eye(3)[j], old, s_old) for k in (1, -1))
        if {up[0], down[0]} != {state}:
            return  # a kink within the difference
        stress[:, j] = (up[3] - down[3]) / (2 * step)
        strain[:, j] = (up[1] - down[1]) / (2 * step)
    assert tangent == pytest.approx(stress, abs=2e-5 * np.abs(stress).max())
    assert slope == pytest.approx(strain, abs=2e-5)


@given(st.floats(0.001, 0.08), st.floats(0.001, 0.3))
def test_narrowed_strip_wrinkles_with_stress_of_a_free_strip(along, narrower):
    """Fabric pulled along the fill and narrowed by more than nu: the stress of a free strip."""
    law = HypoelasticLaw.linear(800.0, 140.0, 20.0, 0.24)
    free = -0.24 * 140.0 / 800.0 * along
    state, he, s, *_ = relaxed_update_of([free - narrower, along, 0.0], law=law)
    assert state == WRINKLED
    assert s == pytest.approx([0.0, 140.0 * along, 0.0], rel=1e-12, abs=1e-10)
    assert he == pytest.approx([free, along, 0.0], rel=1e-12, abs=1e-14)
