"""experiments/strips/gauge_loads.py: loads paired with frames."""

import logging

import numpy as np
import pytest
from bubblefit.experiments.strips.gauge import virtual_strain_gauge
from bubblefit.experiments.strips.gauge_loads import gauge_load_curve

from ...support.refusals import complaint
from .cases import (
    LOWER,
    UPPER,
    gauge_of_three_frames,
    square_with_hole,
    stretched_frame,
    strip_grid,
)


def test_loads_are_paired_with_frames_by_time(caplog):
    record = gauge_of_three_frames()
    curve = gauge_load_curve(record, [0, 50, 120], direction="weft", specimen="3")
    assert (curve.direction, curve.specimen, curve.path) == ("fill", "3", None)
    np.testing.assert_array_equal(curve.load, [0, 120])
    np.testing.assert_array_equal(curve.elongation, record.elongation[[0, 2]])
    record = virtual_strain_gauge(
        [stretched_frame(strip_grid(), stretch, 0.0) for stretch in (1.0, 1.1, 1.2, 1.3)],
        LOWER,
        UPPER,
    )
    with caplog.at_level(logging.WARNING, logger="bubblefit"):
        how = {"direction": "warp", "specimen": "1", "load_times": np.arange(3.0)}
        times = np.array([-1, 0.5, 1.5, 2])
        curve = gauge_load_curve(record, [0, 10, 30], **how, frame_times=times)
    np.testing.assert_allclose(curve.load, [5, 20, 30])
    np.testing.assert_allclose(curve.elongation, record.elongation[1:])
    np.testing.assert_allclose(curve.time, [0.5, 1.5, 2])
    assert "1 of 4 frames have no load at their time" in caplog.text
    record = virtual_strain_gauge([square_with_hole()] * 4, (2.0, 2.0), (2.0, 8.0))

    def at(frames):
        times = {"frame_times": np.array(frames), "load_times": np.array([1, 3])}
        return gauge_load_curve(record, [0, 10], direction="warp", specimen="1", **times)

    curve = at([1, 2, 3, 3.001])
    assert curve.load.tolist() == [0.0, 5.0, 10.0] and curve.frame.tolist() == [0, 1, 2]
    assert at([0, 2, 3, 9]).load.tolist() == [5.0, 10.0]
    assert "specimen '1': only 1 of 4 frames have both" in complaint(at, [0, 2, 4, 9])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"direction": "90"}, "unknown direction '90'"),
        ({"frame_times": [0, 1, 2], "load_times": [0, 2, 1]}, "load_times: expected two"),
        ({"frame_times": [0, 1, 2], "load_times": [0, 1, 1]}, "load_times: expected two"),
        ({"loads": [1], "frame_times": [0, 1, 2], "load_times": [0]}, "load_times: expected two"),
        ({"frame_times": [7, 8, 9], "load_times": [0, 1, 2]}, "only 0 of 3 frames"),
    ],
)  # fmt: skip
def test_loads_that_cannot_be_paired_are_refused(options, words):
    options = {k: np.array(v) if k.endswith("times") else v for k, v in options.items()}
    asked = {"loads": [1, 2, 3], "direction": "warp", "specimen": "1"} | options
    assert words in complaint(gauge_load_curve, gauge_of_three_frames(), **asked)
