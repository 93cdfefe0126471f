"""Strain regions of a load curve."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.data.regions import strain_regions
from bubblefit.errors import InputError


def test_a_broken_line_gives_its_own_breaks_back() -> None:
    strain = np.linspace(0.0, 0.41, 300)[1:]
    load = 900 * strain - 700 * np.maximum(strain - 0.05, 0) + 400 * np.maximum(strain - 0.3, 0)
    # The places of the grid are a hundredth apart.
    assert strain_regions(strain, load) == pytest.approx((0.05, 0.3), abs=0.005)
    with pytest.raises(InputError, match="five points"):
        strain_regions(strain[:4], load[:4])
