"""Figures of the thesis, reproduced by a script of benchmarks/reproduction."""

import numpy as np
import pytest

from ..support.paths import load_script


def test_effect_of_nu12_on_displacements_is_that_of_figure_4_2():
    """Largest displacement of the known solution at 300 kPa, relative to the mean of five nu12.

    Published: 1.029 to 0.967. With pressure that follows the surface ours are 1.036 to 0.960, at
    most 0.0070 off; with dead pressure, as the published profiles show Marc's to be, they are
    within 0.0005 (docs/how-to/studies.md). The published numbers carry three decimals.
    """
    figure = load_script("benchmarks/reproduction/nu12_figure_4_2.py")
    ours = figure.ratios()
    most, slope = figure.compare(ours)
    assert most < 0.0075
    # Same curve, steeper: falling, nearly straight, and by the same factor at both ends.
    assert (np.diff(ours.to_mean) < 0).all()
    assert slope == pytest.approx(figure.STEEPER, abs=figure.NEAR)
    published = np.array([*figure.FIGURE_4_2.values()])
    assert ours.to_mean - 1 == pytest.approx(slope * (published - 1), abs=1e-3)
