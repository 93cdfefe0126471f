"""Validation: the moment of a bent tube beyond its first wrinkle (Comer and Levy)."""

import pytest
from bubblefit.runs.verification.tubes import FIRST_WRINKLE, TubeWithPlaneEnds, published_moment


def test_bent_tube_has_the_published_moment_beyond_its_first_wrinkle():
    tube, taut = TubeWithPlaneEnds(32, 1e-4), TubeWithPlaneEnds(32, None)
    for times in (1.5, 2.5, 4.0):
        wrinkled, moment, radius = tube.moment(times * FIRST_WRINKLE)
        expected_wrinkled, expected = published_moment(times * FIRST_WRINKLE, radius)
        assert moment == pytest.approx(expected, rel=2e-3)
        assert wrinkled == pytest.approx(expected_wrinkled, abs=1.0 / 32)
    # A membrane that carries compression goes on as it began.
    assert taut.moment(1.5 * FIRST_WRINKLE)[1] == pytest.approx(0.75, rel=1e-2)
