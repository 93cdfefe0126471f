"""experiments/strips/section.py: keys of [[strips]], and lengths of the gauge of a direction."""

from bubblefit.experiments.strips.section import StripsSection


def test_gauge_of_an_angle_is_that_of_bias_then_of_all_strips():
    section = StripsSection.model_validate(
        {
            "gauge_length": 20.0,
            "final_length": 23.0,
            "bias": {"final_length": 25.0},
            "data": {"directions": {"0": "w*.csv", "15": ["a.csv", "b.csv"]}},
        }
    )
    lengths = {
        direction: (section.gauge(direction).gauge_length, section.gauge(direction).final_length)
        for direction in ("warp", "bias", "15 degrees")
    }
    assert lengths == {"warp": (20, 23), "bias": (20, 25), "15 degrees": (20, 25)}
    assert section.data.directions == {"0": ["w*.csv"], "15": ["a.csv", "b.csv"]}
