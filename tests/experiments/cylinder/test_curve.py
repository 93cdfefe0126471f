"""experiments/cylinder/curve.py: stiffness, knee and limit point of load curves."""

import numpy as np
import pytest
from bubblefit.experiments.cylinder.curve import (
    against_measured,
    initial_stiffness,
    knee_point,
    limit_point,
    loads_at,
    straightness,
)
from bubblefit.meshes.cylinder_model import curve_reading
from bubblefit.readers.bending import BendingCurve

from .cases import OVER, WAY, run_of_curve


# Numbers of a curve
def test_stiffness_and_knee_of_a_bilinear_curve():
    load = np.minimum(4 * WAY, 300 + WAY)
    stiffness = initial_stiffness(WAY, load, OVER)
    assert stiffness == pytest.approx(4.0)
    # A slope over 20 mm is half of 4 where two thirds of them lie beyond the kink.
    place, force = knee_point(WAY, load, stiffness, OVER)
    assert place == pytest.approx(100 + 20 / 6, abs=0.1)
    assert force == pytest.approx(np.interp(place, WAY, load))
    assert limit_point(WAY, load) is None
    r2, off = straightness(WAY, load, force)
    assert r2 == pytest.approx(1.0) and off == pytest.approx(0.0, abs=1e-12)
    # Everything a tenth: the same curve, read at places a tenth as far.
    small = knee_point(0.1 * WAY, load, 40.0, 0.1 * OVER)
    assert small == pytest.approx((0.1 * place, force))
    assert curve_reading(15.0).places == pytest.approx(
        {"0.25 diameters": 3.75, "0.5 diameters": 7.5, "1 diameters": 15.0}
    )


def test_initial_stiffness():
    """Take the frames up to 20 mm, whatever rounding does to the last, and three at least."""
    load = run_of_curve(0, 20, 40, 60, 30, 200)
    for end in (20.0, 20.0 * (1 + 1e-12)):
        found = initial_stiffness(run_of_curve(0, 5, 10, 15, end, 30), load, OVER)
        assert found == pytest.approx(2.0)  # the straight line through five points
    way, load = run_of_curve(0, 30, 60, 90), run_of_curve(0, 60, 180, 900)
    assert initial_stiffness(way, load, OVER) == pytest.approx(3.0)  # the line through three
    assert initial_stiffness(way[:2], load[:2], OVER) == pytest.approx(2.0)
    assert initial_stiffness(way[:1], load[:1], OVER) is None


def test_loads_at_deflections_are_interpolated():
    """Between frames, and at the last, which may end short of it by rounding; not beyond."""
    places = {"40 mm": 40.0, "100 mm": 100.0, "101 mm": 101.0}
    found = loads_at(run_of_curve(0, 50, 100 * (1 - 1e-12)), run_of_curve(0, 200, 300), places)
    assert found == {"40 mm": pytest.approx(160.0), "100 mm": pytest.approx(300.0), "101 mm": None}


def test_limit_point_is_the_largest_load():
    load = 400 * np.sin(WAY / 240 * 0.9 * np.pi)
    assert limit_point(WAY, load) == pytest.approx((240 / 1.8, 400.0), rel=0.02)
    # The slope is that of the start times a cosine: half of it at 60 degrees.
    place, _ = knee_point(WAY, load, initial_stiffness(WAY, load, OVER), OVER)
    assert place == pytest.approx(240 / 0.9 / 3, rel=0.02)


@pytest.mark.parametrize(("low", "there"), [(99.5, False), (99.49, True), (-1.0, True)])
def test_fall_of_half_a_percent_is_a_limit_point(low, there):
    """The largest load counts, whether the fall is the last frame or not."""
    way = run_of_curve(0, 5, 10, 15)
    for load in (run_of_curve(0, 100, low, 99.9), run_of_curve(0, 50, 100, low)):
        found = limit_point(way, load)
        assert found == ((float(way[np.argmax(load)]), 100.0) if there else None)


def test_knee_lies_beyond_the_initial_slope():
    """4 N/mm to `kink` mm, then 1: the slope over 20 mm is 2 where a third lies before it."""

    def found(kink, end, stiffness=4.0):
        way = np.linspace(0.0, end, 401)
        return knee_point(way, np.minimum(4 * way, 3 * kink + way), stiffness, OVER)

    assert found(30.0, 100.0) == pytest.approx((30 + 10 / 3, 120 + 10 / 3), abs=0.02)
    assert found(20.0, 40.0) == pytest.approx((20 + 10 / 3, 80 + 10 / 3), abs=0.02)
    assert found(20.0, 39.9) is None and found(300.0, 240.0) is None
    # From the first place on, the slope is too small already.
    assert found(2.0, 60.0) == pytest.approx((10.0, 16.0))
    assert not any(found(30.0, 100.0, stiffness) for stiffness in (None, 0.0, -1.0))
    # Where it is just the half it has fallen to it.
    assert found(0.0, 60.0, 2.0) == pytest.approx((10.0, 10.0))
    assert found(0.0, 60.0, 1.99) is None


def test_straightness_up_to_half_of_the_knee():
    """Up to half of the load at the knee, of four frames at least."""
    r2, off = straightness(WAY, WAY**2, 2 * 240.0**2)
    # Of x^2 on [0, 1] the best straight line misses 1/180 of 4/45 of variance, 1/6 at the ends.
    assert r2 == pytest.approx(1 - (1 / 180) / (4 / 45), abs=2e-3)
    assert off == pytest.approx(1 / 6, rel=0.05)
    way, load = np.arange(5.0), run_of_curve(0, 1, 5, 6, 7)
    r2, off = straightness(way, load, 12.0)
    missed = load[:4] - (2.2 * way[:4] - 0.3)
    assert r2 == pytest.approx(1 - (missed**2).sum() / ((load[:4] - 3) ** 2).sum())
    assert off == pytest.approx(np.abs(missed).max() / 6)
    assert straightness(way, load, 11.9) is None
    # All five: 1.9 mm a step misses by 1.2 at most, and leaves 2.7 of 38.8.
    assert straightness(way, load, 1e9) == pytest.approx((1 - 2.7 / 38.8, 1.2 / 7))
    assert straightness(way, 0 * load, 12.0) is None


def test_comparison_with_measured_curves():
    """Bilinear, 40 and 4 N/mm with the corner at 10 mm; measured 30 N of friction and 25 % less."""
    way = np.linspace(0.0, 120.0, 1201)
    load = np.where(way < 10, 40 * way, 400 + 4 * (way - 10))
    read = 0.75 * load + 30.0 * (way > 0.0)
    reading = curve_reading(340.0, [100.0, 500.0], 4.0)
    found = against_measured(reading, way, load, [BendingCurve("a", way[:1101], read[:1101])])
    assert found.reference == 100.0
    assert found.pairs["secant stiffness"] == pytest.approx((40.0, 30.0), rel=1e-6)
    assert found.pairs["secant knee"] == pytest.approx((396.0, 0.75 * 396.0 + 30.0), rel=0.02)
    assert found.pairs["load at 100 mm"] == pytest.approx((760.0, 600.0))
    assert found.pairs["load at 500 mm"] is None and found.ratios["load at 500 mm"] is None
    assert found.ratios["secant stiffness"] == pytest.approx(40.0 / 30.0)
    twice = [BendingCurve(name, way, factor * read) for name, factor in (("a", 0.9), ("b", 1.1))]
    mean = against_measured(reading, way, load, twice).pairs["secant stiffness"][1]
    assert mean == pytest.approx(30.0)
    assert against_measured(reading, way, load, ()) is None


def test_a_limit_point_is_compared_with_a_limit_point_alone():
    """Measured up to its limit point and before it; predicted with a knee before its own."""
    reading = curve_reading(340.0, [40.0], OVER)
    load = 400 * np.sin(WAY / 240 * 0.9 * np.pi)
    fallen, rising = BendingCurve("a", WAY, 0.5 * load), BendingCurve("b", WAY[:30], load[:30])
    found = against_measured(reading, WAY, load, [fallen])
    assert found.pairs["limit point"] == pytest.approx((400.0, 200.0), rel=0.01)
    assert found.ratios["secant knee"] == pytest.approx(2.0)
    found = against_measured(reading, WAY, load, [rising])
    assert found.pairs["limit point"] is None and found.ratios["secant knee"] == pytest.approx(1.0)
