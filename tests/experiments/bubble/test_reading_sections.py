import numpy as np
import pytest
from bubblefit.experiments.bubble.reading_sections import ApexSection


@pytest.mark.parametrize(
    ("keys", "quantity", "values", "measured"),
    [
        ({}, "curvature", [-0.002, 0.003], [0.002, 0.003]),
        ({"curvature_is": "half"}, "curvature", [-0.001], [0.002]),
        ({"curvature_is": "radius"}, "curvature", [500.0], [0.002]),
        ({}, "strain", [0.05], [0.05]),
        ({"strain_is": "logarithmic"}, "strain", [np.log(1.05)], [0.05]),
    ],
)
def test_curvatures_and_strains_are_turned_into_one_over_r_and_extension(
    keys, quantity, values, measured
):
    section = ApexSection(**keys)
    np.testing.assert_allclose(section.measure(quantity, np.array(values)), measured)


def test_noise_is_that_of_the_quantities_that_say_it():
    assert ApexSection().noise_of == {}
    assert ApexSection(strain_noise=1e-3).noise_of == {"strain": 1e-3}
