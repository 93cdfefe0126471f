"""Measured biaxial tests of tissues: an artery under seven load ratios, an adventitia under three.

The directions of a ratio of the artery are separate files, sampled at different points.
"""

import bubblefit as bf
import numpy as np
import pytest

from ..support import needs
from ..support.paths import EXAMPLES


def example(name, folder):
    return bf.read_project(EXAMPLES / "soft-membranes" / name, needs.measured_data() / folder)


def test_directions_of_the_artery_are_paired():
    project = example("artery.toml", "artery_ratios")
    (test,) = project.tests.values()
    ends = {path.ratio: path.load[-1] for path in test.paths}
    # By the largest stresses (kPa) of the two files.
    assert ends["10:3"] == pytest.approx([1.3977, 0.4341], abs=1e-3)
    assert ends["1:1"] == pytest.approx([1.0891, 1.2756], abs=1e-3)
    assert len(test.paths) == 7
    for path in test.paths:
        ratio = path.load[:, 0] / path.load[:, 1]
        np.testing.assert_allclose(ratio, ratio[-1])
    # The direction that the 1:0.45 load compresses at last, by its own file.
    assert test.matched["0.45:1"].strain[-1] == pytest.approx([-0.007, 0.316], abs=1e-3)


def test_tissue_under_three_ratios_is_read():
    project = example("tissue.toml", "tissue_biaxial")
    (test,) = project.tests.values()
    assert [path.ratio for path in test.paths] == ["1:1", "2:1", "1:2"]
    end = test.matched["1:1"]
    secant = end.load[-1, 0] / end.strain[-1, 0]  # of 1 mm of thickness: about 0.55 MPa
    assert secant == pytest.approx(0.55, abs=0.08)
