"""experiments/strips/data.py: breaks of a load curve."""

import numpy as np
import pytest
from bubblefit.experiments.strips.data import strain_regions

from ...support.refusals import complaint


def test_breaks_of_a_broken_line_are_recovered():
    strain = np.linspace(0.0, 0.41, 300)[1:]
    load = 900 * strain - 700 * np.maximum(strain - 0.05, 0) + 400 * np.maximum(strain - 0.3, 0)
    # The places of the grid are a hundredth apart.
    assert strain_regions(strain, load) == pytest.approx((0.05, 0.3), abs=0.005)
    # 40 places between zero and the last strain: the first and the last may be breaks, too.
    strain = np.linspace(0.0, 0.41, 83)[1:]
    load = 900 * strain - 700 * np.maximum(strain - 0.01, 0) + 400 * np.maximum(strain - 0.4, 0)
    assert strain_regions(strain, load) == pytest.approx((0.01, 0.40), abs=1e-9)
    strain = np.linspace(0.0, 0.4, 5)
    assert len(strain_regions(strain, strain)) == 2
    for few in (strain[:4], 0 * strain):
        assert f"five points are needed for regions, got {len(few)}" in complaint(
            strain_regions, few, few
        )
