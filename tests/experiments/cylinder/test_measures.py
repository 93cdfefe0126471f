"""experiments/cylinder/measures.py: load curves, and numbers of a bending run and of its braid."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.cylinder.measures import (
    BendingRun,
    against_measured,
    angle_sensitivity,
    arrays_of,
    bending_measures,
    inflation_strain,
    initial_stiffness,
    is_near_neutral,
    knee_point,
    limit_point,
    loads_at,
    run_of,
    straightness,
    wrinkle_onset,
)
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.beam_model import BeamModel, BraidedWall, PlainWall, TubeCrossSection
from bubblefit.meshes.cylinder_model import Cord, axial_table, curve_reading, inflated_cylinder
from bubblefit.meshes.mesh import surface_strain
from bubblefit.meshes.tube import cylinder_mesh
from bubblefit.project.project import read_project
from bubblefit.readers.bending import BendingCurve
from bubblefit.runs.predictions import predict
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.bent_cylinders import ran
from ...support.refusals import raised
from .cases import BEAM, NONE, OVER, SMALL_CYLINDER, WAY, cylinder_history, run_of_curve


def test_wrinkle_onset_counts_from_the_inflated_state():
    run = BendingRun(
        run_of_curve(0, 5, 10),
        run_of_curve(0, 15, 30),
        NONE,
        NONE,
        NONE,
        NONE,
        run_of_curve(0.25, 0.26, 0.2601),
    )
    assert wrinkle_onset(run) == (10.0, 30.0)
    assert wrinkle_onset(replace(run, wrinkled=NONE)) is None
    assert wrinkle_onset(replace(run, wrinkled=run_of_curve(0.1, 0.1, 0.1))) is None


def test_measures_of_a_known_formula():
    reading = curve_reading(150.0, (40.0, 100.0, 240.0), OVER)
    m = inflated_cylinder(
        150.0, 0.14, 0.81, 40.0, deflections=WAY[1:].tolist(), symmetry="quarter", reading=reading
    )
    run = run_of(ran(m, MaterialCard(HypoelasticLaw.linear(500.0, 150.0, 20.0), 0.81)))
    found = bending_measures(m, run, ())
    hoop = np.log1p(0.14 * 75 / 0.81 / 150)
    assert found.body_strain == pytest.approx((np.log1p(np.expm1(0.1 * hoop)), hoop))
    arm = 2000 - 145
    limit = 4 * np.pi * 0.14 * 75**3 / arm
    stiffness = 48 * 514 * np.pi * 75**3 * 0.81 / arm**3
    assert found.stiffness == pytest.approx(stiffness, rel=0.02)
    for at, load in zip((40.0, 100.0, 240.0), found.loads.values(), strict=True):
        assert load == pytest.approx(limit * np.tanh(stiffness * at / limit))
    assert found.pressure_rise == pytest.approx(1e3 * 0.241 * 240e-5, rel=0.01)
    first, *_, last = (mpa / 1e-3 for mpa in run.pressure)
    assert found.pressure_rise == pytest.approx(last - first, rel=1e-9)
    assert found.limit is None and found.reached == 240.0 and found.error is None
    assert found.describe(found.limit) == "none up to 240 mm"
    assert found.describe(found.knee) == "{1:.0f} N, {0:.0f} mm".format(*found.knee)
    assert found.wrinkles[0] == 56.0


# Strain of a curved surface
def test_inflation_strain_of_a_growing_tube():
    """Quads without a seam are the body; where all of them touch the caps, the body is all."""
    mesh = cylinder_mesh(900.0, 150.0, 25.0, 40.0)
    u = mesh.points * [0.1, 0.1, 0.03]
    strain = surface_strain(mesh, u)
    tube = np.setdiff1d(np.arange(len(mesh.quads)), mesh.element_sets["caps"])
    wanted = np.tile([*np.log([1.03, 1.1]), 0], (len(tube), 1))
    np.testing.assert_allclose(strain[tube], wanted, atol=1e-12)
    np.testing.assert_allclose(strain[mesh.element_sets["caps"], :2], np.log(1.1))
    both = (pytest.approx(np.log(1.03)), pytest.approx(np.log(1.1)))
    assert inflation_strain(mesh, u) == (both, both)
    beside = mesh.node_sets["ends"]
    bulged = u.copy()
    bulged[beside] = mesh.points[beside] * [0.5, 0.5, 0.03]
    body, anywhere = inflation_strain(mesh, bulged)
    assert body == both and anywhere[1] > np.log(1.25)
    seam = np.unique(mesh.quads[mesh.element_sets["seam"]])
    u[seam] *= 2.0
    body, anywhere = inflation_strain(mesh, u)
    assert body == both and anywhere[0] == pytest.approx(np.log(1.06))
    whole = replace(mesh, element_sets={**mesh.element_sets, "caps": mesh.element_sets["body"]})
    assert inflation_strain(whole, u)[0][0] > np.log(1.04)
    alone = {k: v for k, v in mesh.element_sets.items() if k != "seam"}
    assert inflation_strain(replace(mesh, element_sets=alone), u)[1][0] < np.log(1.06)


PLACES = {"20 mm": 20.0, "60 mm": 60.0, "90 mm": 90.0}


def braided_model(angle):
    wall = BraidedWall(angle, 2000.0, 2.0, 9.6, 3.33)
    cords = [Cord(around, axial_table(800e3)) for around in (0.0, 120.0, 240.0)]
    return BeamModel(TubeCrossSection(170.0, 0.1, wall, cords), 3200.0, [20.0, 60.0], 1000.0)


def load_of(model):
    return MembraneSolver().run(model, HypoelasticLaw.linear(1.0, 1.0, 1.0)).load


def test_angle_sensitivity_is_change_to_beams_of_other_angles():
    loads = {angle: load_of(braided_model(angle))[-1] for angle in (56.0, 56.5, 57.0)}
    said = angle_sensitivity(braided_model(56.5), load_of(braided_model(56.5)), PLACES)
    less, more = (100 * (loads[angle] / loads[56.5] - 1) for angle in (56.0, 57.0))
    assert less < -5 and more > 5
    for words, change in (("less", less), ("more", more)):
        assert f"half a degree {words} changes the load at 60 mm by {change:+.0f} %" in said
    assert said.startswith("the braid's 56.5 degrees are near 54.7, where it leaves no thrust")


def test_angle_without_load_on_the_cords_has_no_equilibrium():
    said = angle_sensitivity(braided_model(55.0), load_of(braided_model(55.0)), PLACES)
    assert "half a degree less leaves no equilibrium, half a degree more changes the" in said
    nowhere = angle_sensitivity(braided_model(55.0), np.array([0.0, 10.0]), {"500 mm": 500.0})
    assert nowhere.endswith("the load depends much on the angle")


def test_angle_sensitivity_of_braids_near_the_neutral_angle_only():
    assert is_near_neutral(braided_model(57.9)) and not is_near_neutral(braided_model(58.1))
    beam = braided_model(60.0)
    plain = replace(beam.section, wall=PlainWall(400.0, 300.0, 60.0, 0.2))
    assert not is_near_neutral(replace(beam, section=plain)) and not is_near_neutral(None)


@pytest.mark.parametrize(("angle", "count"), [(56.5, 1), (65.0, 0)])
def test_bend_notes_angle_sensitivity_and_no_card(tmp_path, angle, count):
    path = tmp_path / "beam.toml"
    path.write_text(BEAM.replace("angle = 65.0", f"angle = {angle}"))
    done = predict(read_project(path))
    lines = done.lines()
    assert (
        sum(line.startswith("beam: the braid's 56.5 degrees are near") for line in lines) == count
    )
    assert not any("how sure" in line for line in lines)
    page = done.report(tmp_path / "out").read_text()
    assert ("half a degree less" in page) == bool(count)
    assert "how sure it is" not in page


def test_bending_run_keeps_what_is_reported():
    kept = arrays_of(SMALL_CYLINDER, cylinder_history(wrinkled=[0.0, 0.1, 0.3]))
    assert {name: value.tolist() for name, value in kept.items()} == {
        "deflection": [0.0, 10.0, 20.0],
        "load": [0.0, 50.0, 100.0],
        "pressure": [0.1, 0.101, 0.102],
        "volume": [5e7, 5e7 - 1, 5e7 - 2],
        "inflated": [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]],
        "bent": [[12.0, 13.0, 14.0], [15.0, 16.0, 17.0]],
        "wrinkled": [0.0, 0.1, 0.3],
    }
    assert arrays_of(SMALL_CYLINDER, cylinder_history())["wrinkled"].size == 0
    # An early end is a result where the solver says why.
    short = cylinder_history(2, early="no equilibrium")
    assert arrays_of(SMALL_CYLINDER, short)["deflection"].tolist() == [0.0, 10.0]


@pytest.mark.parametrize(
    ("results", "words"),
    [
        (cylinder_history(2), "at 10 of 20 mm"),
        (cylinder_history(cavity_pressure=None), "no gas"),
        (cylinder_history(cavity_volume=None), "no volume"),
    ],
)
def test_run_without_end_or_gas_is_a_failure(results, words):
    raised(SolverFailure, words, arrays_of, SMALL_CYLINDER, results)


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
    reading = curve_reading(340.0, [100.0, 110.5, 500.0], 4.0)
    found = against_measured(reading, way, load, [BendingCurve("a", way[:1101], read[:1101])])
    assert found.reference == 100.0
    assert found.pairs["secant stiffness"] == pytest.approx((40.0, 30.0), rel=1e-6)
    assert found.pairs["secant knee"] == pytest.approx((396.0, 0.75 * 396.0 + 30.0), rel=0.02)
    assert found.pairs["load at 100 mm"] == pytest.approx((760.0, 600.0))
    assert found.pairs["load at 110.5 mm"] is None
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
