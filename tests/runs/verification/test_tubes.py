"""runs/verification/tubes.py: moments of a bent tube before and beyond its first wrinkle."""

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.runs.verification import tubes
from bubblefit.runs.verification.tubes import (
    FIRST_WRINKLE,
    RADIUS,
    TubeWithPlaneEnds,
    published_moment,
)


def test_published_moment_begins_at_one_half_and_ends_at_one():
    share, moment = published_moment(1.0001 * FIRST_WRINKLE, RADIUS)
    assert share == pytest.approx(0.0, abs=0.02)
    assert moment == pytest.approx(0.5, abs=1e-3)
    share, moment = published_moment(1000 * FIRST_WRINKLE, RADIUS)
    assert 0.8 < share < 1.0
    assert 0.95 < moment < 1.0


def test_published_moment_grows_with_curvature():
    found = [published_moment(factor * FIRST_WRINKLE, RADIUS) for factor in (1.2, 2, 4, 8)]
    shares, moments = zip(*found, strict=True)
    assert (np.diff(shares) > 0).all()
    assert (np.diff(moments) > 0).all()


def test_moment_before_the_first_wrinkle_is_elastic():
    tube = TubeWithPlaneEnds(16, 1e-4)
    wrinkled, moment, radius = tube.moment(0.5 * FIRST_WRINKLE)
    assert wrinkled == 0.0
    assert radius > RADIUS
    # E pi r^3 t times the curvature, over pi p r^3.
    assert moment == pytest.approx(0.25, rel=0.02)


def test_tube_without_equilibrium_is_a_failure():
    with pytest.raises(SolverFailure, match="no equilibrium of a bent tube"):
        tubes._equilibrium(None)
