"""A deck of one's own of an inflated rubber sheet: constants of Mooney-Rivlin and their bands."""

import bubblefit as bf
import pytest

from ..builders.rubber_bulge import TRUE, bulge_heights, bulge_project
from ..support import needs

#: Standard deviations (MPa) by central differences at the truth.
SIGMAS = {"C10": 0.0064, "C01": 0.0046}


@pytest.mark.slow
def test_bands_of_two_constants_hold_the_truth(tmp_path):
    needs.calculix()
    fit = bf.fit(bulge_project(tmp_path, bulge_heights(tmp_path), 1), jobs=1)
    for name, truth in TRUE.items():
        numbers = fit.parameters[name]
        low, high = numbers["band"]
        assert low < truth < high
        assert numbers["sigma"] == pytest.approx(SIGMAS[name], rel=0.3)
