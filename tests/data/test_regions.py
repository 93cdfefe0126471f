"""Strain regions of a load curve."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.strips.polynomials import strain_regions


def test_a_broken_line_gives_its_own_breaks_back() -> None:
    strain = np.linspace(0.0, 0.41, 300)[1:]
    load = 900 * strain - 700 * np.maximum(strain - 0.05, 0) + 400 * np.maximum(strain - 0.3, 0)
    # The places of the grid are a hundredth apart.
    assert strain_regions(strain, load) == pytest.approx((0.05, 0.3), abs=0.005)


def test_breaks_at_the_ends_of_the_grid() -> None:
    """40 places between zero and the last strain: the first and the last may be breaks, too."""
    strain = np.linspace(0.0, 0.41, 83)[1:]
    load = 900 * strain - 700 * np.maximum(strain - 0.01, 0) + 400 * np.maximum(strain - 0.4, 0)
    assert strain_regions(strain, load) == pytest.approx((0.01, 0.40), abs=1e-9)


def test_points_that_tell_no_regions() -> None:
    strain = np.linspace(0.0, 0.4, 5)
    assert len(strain_regions(strain, strain)) == 2
    for few in (strain[:4], 0 * strain):
        with pytest.raises(InputError, match=f"five points are needed for regions, got {len(few)}"):
            strain_regions(few, few)
