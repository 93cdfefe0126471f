"""experiments/bubble/readings.py: readings at few pressures, and the tables of a project."""

import numpy as np
import pytest
from bubblefit.experiments.bubble.readings import LIMITS, ApexSection, GaugeReadings, frame_weights

from ...builders.gauges import PRESSURES, height_series


def test_weights_give_a_cubic_in_the_cube_root_of_the_pressure():
    frames = (0.01, 0.02, 0.05, 0.1, 0.2)
    pressure = np.array([0.002, 0.01, 0.013, 0.07, 0.2])

    def cubic(p):
        s = np.cbrt(p)
        return 3 * s - 2 * s**2 + 0.7 * s**3

    weights = frame_weights(frames, pressure)
    np.testing.assert_allclose(weights @ cubic(np.array(frames)), cubic(pressure), rtol=1e-12)
    np.testing.assert_allclose(weights[[1, 4]], np.eye(5)[[0, 4]], atol=1e-12)


def test_one_frame_gives_a_line_from_the_sheet_at_rest():
    np.testing.assert_allclose(frame_weights([0.08], np.array([0.01])), [[0.5]])


def test_many_pressures_are_read_between_a_few_frames():
    many = np.linspace(0.001, 0.3, 500)
    frames = GaugeReadings((height_series([0, 0], many),)).frame_pressures(None)
    assert len(frames) == LIMITS.max_frames
    np.testing.assert_allclose([frames[0], frames[-1]], [0.001, 0.3])
    roots = np.diff(np.cbrt(frames))
    np.testing.assert_allclose(roots, roots[0])


def test_few_pressures_are_the_frames_and_listed_ones_come_first():
    readings = GaugeReadings((height_series([0, 0]), height_series([50, 0])))
    assert readings.frame_pressures(None) == PRESSURES
    assert readings.frame_pressures([0.03, 0.15]) == (0.03, 0.15)
    (first, _) = readings.within((0.03, 0.15)).series
    assert first.pressure.tolist() == [0.03, 0.06, 0.1, 0.15]
    assert GaugeReadings(()).frame_pressures(None) is None


def test_noise_is_the_stated_one_else_the_scatter_of_specimens_else_a_usual_one():
    rise = 30 * np.cbrt(PRESSURES)
    single = height_series([0, 0], value=rise)
    assert single.noise(0.2) == (0.2, "given")
    assert single.noise(None) == (0.05, "assumed")
    assert single.correlated_count == 1.0
    pair = height_series(
        [0, 0],
        (*PRESSURES, *PRESSURES),
        value=np.concatenate([0.98 * rise, 1.02 * rise]),
        specimens=np.repeat([0, 1], len(rise)),
    )
    noise, words = pair.noise(None)
    assert words == "specimens' scatter"
    assert noise == pytest.approx(0.02 * np.sqrt(np.mean(rise**2)), rel=0.1)
    # The readings of a specimen err together: two specimens are little more than one comparison.
    assert pair.correlated_count == pytest.approx(12 / 1.25)


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
