"""experiments/strips/gauge.py: points followed, and loads paired with frames."""

import logging
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.strips.gauge import (
    CORRELATION_LOST,
    GaugeRecord,
    GaugeTable,
    Surface,
    gauge_load_curve,
    position_on,
    virtual_strain_gauge,
)
from bubblefit.notes import Note
from bubblefit.readers.curves import LoadCurve
from bubblefit.readers.frames import Frame
from hypothesis import given, settings
from hypothesis import strategies as st

from ...support.refusals import complaint
from .cases import (
    LOWER,
    UPPER,
    gauge_of_three_frames,
    square_with_hole,
    stretched_frame,
    strip_grid,
)


@settings(deadline=None, max_examples=40)
@given(
    stretches=st.lists(st.floats(0.95, 1.6), min_size=1, max_size=4),
    angle=st.floats(-1, 1),
    jitter=st.sampled_from([0.0, 0.1]),
    spacing=st.sampled_from([1.0, 1.3, 2.0]),
)
def test_gauge_measures_a_homogeneous_stretch_exactly(stretches, angle, jitter, spacing):
    points = strip_grid(spacing, jitter)
    frames = [stretched_frame(points, stretch, angle) for stretch in stretches]
    record = virtual_strain_gauge(frames, LOWER, UPPER)
    # By x, y and z: the strip's slope of 0.02 is part of the length.
    reference = (UPPER[1] - LOWER[1]) * np.hypot(1, 0.02)
    assert record.reference_length == pytest.approx(reference, rel=1e-12)
    np.testing.assert_allclose(record.length, reference * np.array(stretches), rtol=1e-10)
    np.testing.assert_allclose(record.elongation, record.length - reference, atol=1e-10)
    np.testing.assert_allclose(record.strain, np.array(stretches) - 1, atol=1e-10)
    np.testing.assert_allclose(record.log_strain, np.log(stretches), atol=1e-10)
    assert (record.lost_frames, record.warnings) == ((), ())


def test_triangle_of_no_area_holds_no_point():
    reference = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 2.0]])
    positions = np.zeros((4, 2, 3))
    positions[:, 0, :2] = reference
    positions[:, 1, :2] = 2.0 * reference + 1.0
    for order in ([0, 1, 2], [0, 2, 3]), ([0, 2, 3], [0, 1, 2]):
        surface = Surface(SimpleNamespace(simplices=np.array(order)), positions)
        for x, y in ((1.0, 0.5), (0.5, 0.0)):
            found = position_on(surface, np.array([x, y]), 9.0)
            np.testing.assert_allclose(found, [[x, y, 0.0], [2 * x + 1, 2 * y + 1, 0.0]])


def test_interpolation_of_the_gauge_is_of_second_order():
    errors = []
    for spacing in (2.0, 1.0, 0.5):
        points = strip_grid(spacing)
        move = np.zeros_like(points)
        move[:, 1] = 3 * np.sin(points[:, 1] / 10)
        record = virtual_strain_gauge([Frame(points, move)], (12.3, 20.73), (12.3, 41.31))
        change = 3 * (np.sin(4.131) - np.sin(2.073))
        exact = np.hypot(20.58 + change, 0.02 * 20.58) - np.hypot(1, 0.02) * 20.58
        errors.append(abs(record.elongation[0] - exact))
    assert errors[2] < errors[0] / 8
    assert errors[2] < 0.005


@pytest.mark.parametrize("how", ["nan", "missing"])
@pytest.mark.parametrize("jitter", [0.0, 0.05])
def test_missing_point_at_the_gauge_is_lost_correlation(how, jitter):
    points = strip_grid(1.0, jitter)
    frames = [stretched_frame(points, stretch, 0.0) for stretch in (1.0, 1.1, 1.2, 1.3)]
    near = np.argmin(np.linalg.norm(points[:, :2] - UPPER, axis=1))
    for i in (1, 3):
        if how == "nan":
            moved = frames[i].displacement.copy()
            moved[near, 2] = np.nan
            frames[i] = Frame(points, moved)
        else:
            kept = np.arange(len(points)) != near
            frames[i] = Frame(points[kept], frames[i].displacement[kept])
    record = virtual_strain_gauge(frames, LOWER, UPPER)
    assert record.lost_frames == (1, 3)
    for values in (record.length, record.elongation, record.strain, record.log_strain):
        np.testing.assert_array_equal(np.isnan(values), [False, True, False, True])
    np.testing.assert_allclose(record.strain[[0, 2]], [0.0, 0.2], atol=1e-12)
    (warning,) = record.warnings
    assert "upper end" in warning and "lost in 2 of 4 frames (1, 3)" in warning
    assert virtual_strain_gauge(frames, LOWER, UPPER, max_gap=3.0).lost_frames == ()
    # A hole elsewhere does not matter.
    assert virtual_strain_gauge(frames, LOWER, (5.0, 30.0)).lost_frames == ()


def test_gauge_outside_of_the_points_is_not_extrapolated():
    points = strip_grid()
    frames = [
        stretched_frame(points, 1.0, 0.0),
        stretched_frame(points[points[:, 1] < 38], 1.1, 0.0),
    ]
    record = virtual_strain_gauge(frames, LOWER, UPPER)
    assert record.lost_frames == (1,) and "outside the correlated points" in record.warnings[0]
    line = Frame(points[points[:, 0] == 12], np.zeros((61, 3)))
    nothing = Frame(np.zeros((0, 3)), np.zeros((0, 3)))
    record = virtual_strain_gauge([line, frames[0], nothing], LOWER, UPPER)
    assert record.lost_frames == (0, 2) and len(record.warnings) == 2
    sides = points[points[:, 1] < 30], points[points[:, 1] > 30]
    apart = [stretched_frame(part, 1.0, 0.0) for part in sides]
    for change, words in (
        ({"frames": apart}, "no frame shows"), ({"upper": LOWER}, "gauge: lower and upper"),
        ({"lower": (np.nan, 2.0)}, "lower: expected x and y in mm"),
        ({"upper": (12.0, 99.0)}, "upper end of the gauge at (12, 99) mm: lost in every frame"),
    ):  # fmt: skip
        asked = {"frames": frames[:1], "lower": LOWER, "upper": UPPER} | change
        assert words in complaint(virtual_strain_gauge, **asked)


def test_hole_at_the_gauge_is_bridged_up_to_its_limit():
    """Where one point is missing the triangles are 2 mm wide: 1.414 times the usual ones."""
    ends, hole = ((5.0, 1.2), (5.1, 5.2)), square_with_hole(without=(5.0, 5.0))
    assert virtual_strain_gauge([square_with_hole(), hole], *ends, 1.42).lost_frames == ()
    found = virtual_strain_gauge([square_with_hole(), hole, square_with_hole(), hole], *ends, 1.41)
    assert found.lost_frames == (1, 3)
    (warning,) = map(str, found.warnings)
    assert "upper end of the gauge at (5.1, 5.2) mm: correlation lost in 2 of 4 frames" in warning
    assert "are 2 mm apart, allowed 1.99" in warning
    assert "upper end of the gauge at (5.1," in complaint(virtual_strain_gauge, [hole], *ends, 1.41)
    assert "max_gap: expected a" in complaint(
        virtual_strain_gauge, [square_with_hole()], *ends, np.nan
    )
    # The usual triangle of a square grid of 1 mm is 1.41 mm wide.
    found = virtual_strain_gauge([square_with_hole()], (3.1, 3.0), (3.1, 4.42))
    assert found.reference_length == pytest.approx(1.42)
    said = complaint(virtual_strain_gauge, [square_with_hole()], (3.1, 3.0), (3.1, 4.41))
    assert "gauge: the ends are 1.41 mm apart," in said
    found = virtual_strain_gauge([square_with_hole()], (2.3, 0.0), (2.3, 10.0))
    assert found.length == pytest.approx([10.0])
    still, two = square_with_hole(), Frame(np.array([[0.0, 0, 0], [4, 0, 0]]), np.zeros((2, 3)))
    together = Frame(still.points, np.array([5.0, 5.0, 0.0]) - still.points)
    for frames, lower, upper, words in (
        ([still], (2.3, 0.0), (2.3, 10.001), "lost in every frame (outside the correlated points)"),
        ([two], (0.0, 0.0), (4.0, 0.0), "lower end of the gauge at (0, 0) mm: lost in every frame"),
        ([still, together], (2.0, 2.0), (8.0, 8.0), "gauge: the two ends meet in a frame"),
    ):
        assert words in complaint(virtual_strain_gauge, frames, lower, upper)


FILES, ENDS = ("a.csv", "b.csv", "c.csv", "d.csv"), ((1.5, -10.0), (1.5, 10.0))
#: Of 20 mm at rest; lost in the third frame, longest in the second.
LENGTH = np.array([20.0, 23.0, np.nan, 22.0])
U = LENGTH - 20.0
GONE = Note(CORRELATION_LOST, "the lower end is lost in c.csv")
RECORD = GaugeRecord(20.0, LENGTH, U, U / 20, np.log(LENGTH / 20), (2,), (GONE,))


def test_table_of_a_gauge_without_loads():
    alone = GaugeTable(FILES, *ENDS, RECORD)
    assert alone.numbers() == {
        "gauge_length_mm": 20.0,
        "longest": {
            "file": "b.csv", "length_mm": 23.0, "elongation_mm": 3.0,
            "strain": pytest.approx(0.15), "log_strain": pytest.approx(np.log(1.15)),
        },
        "frames": 4, "lost": ["c.csv"], "warnings": [GONE],
        "notes": [{"of": "", "kind": "correlation lost", "note": GONE}],
    }  # fmt: skip
    columns = {
        "frame": [0, 1, 2, 3], "file": FILES, "length_mm": LENGTH, "elongation_mm": U,
        "strain": U / 20, "log_strain": np.log(LENGTH / 20),
    }  # fmt: skip
    pd.testing.assert_frame_equal(alone.frame(), pd.DataFrame(columns))
    assert alone.without_load == []


def test_table_of_a_gauge_with_loads_of_a_machine(tmp_path):
    load, frame = np.array([5.0, 410.0]), np.array([0, 1])
    curve = LoadCurve("warp", "w1", U[:2], load, None, None, frame)
    table = GaugeTable(FILES, *ENDS, RECORD, curve, "the frames are out\nof order")
    numbers = table.numbers()
    assert {key: numbers[key] for key in list(numbers)[-5:]} == {
        "direction": "warp", "specimen": "w1", "points": 2, "largest_load_N": 410.0,
        "without_load": ["d.csv"],
    }  # fmt: skip
    assert numbers["warnings"][:2] == [GONE, "the frames are out\nof order"]
    assert numbers["warnings"][2].startswith("1 of 4 frames have a length and no load")
    kinds = [note["kind"] for note in numbers["notes"]]
    assert kinds[::2] == ["correlation lost", "frames without load"]
    table.write(tmp_path / "g.csv")
    head, *notes = (tmp_path / "g.csv").read_text().splitlines()[:4]
    assert "(1.5, -10) and (1.5, 10) mm, 20 mm long" in head
    assert notes == [f"# note: {' '.join(words.split())}" for words in numbers["warnings"]]
    read = pd.read_csv(tmp_path / "g.csv", comment="#")
    assert read["file"].tolist() == ["a.csv", "b.csv"] and read["load_N"].tolist() == [5.0, 410.0]
    assert set(read["specimen"]) == {"w1"} and set(read["direction"]) == {"warp"}


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
