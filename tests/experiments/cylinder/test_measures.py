"""Numbers of a bending run on curves that are known, and its deformed beam."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.cylinder.curve import (
    against_measured,
    initial_stiffness,
    knee_point,
    limit_point,
    loads_at,
    straightness,
)
from bubblefit.experiments.cylinder.measures import (
    bending_measures,
    inflation_strain,
    wrinkle_onset,
)
from bubblefit.experiments.cylinder.predicted import STUDIED, quantities
from bubblefit.experiments.cylinder.run import BendingRun, arrays_of, run_of
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import curve_reading, inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.strain import surface_strain
from bubblefit.meshes.tube import cylinder_mesh
from bubblefit.project.project import read_project
from bubblefit.readers.bending import BendingCurve
from bubblefit.runs.refinement import edge_length
from bubblefit.solvers.base import History

from ...builders.bent_cylinders import STUDIED_PROJECT, ran
from ...support.refusals import complaint, raised

#: mm over which slopes are taken here.
OVER = 20.0


WAY = np.linspace(0.0, 240.0, 61)


NONE = np.empty(0)


def of(*values: float) -> np.ndarray:
    return np.array(values, dtype=float)


# Numbers of a curve
def test_a_bilinear_curve():
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
    """Of the frames up to 20 mm, by rounding beyond or not, but of three at least."""
    load = of(0, 20, 40, 60, 30, 200)
    for end in (20.0, 20.0 * (1 + 1e-12)):
        found = initial_stiffness(of(0, 5, 10, 15, end, 30), load, OVER)
        assert found == pytest.approx(2.0)  # the straight line through five points
    way, load = of(0, 30, 60, 90), of(0, 60, 180, 900)
    assert initial_stiffness(way, load, OVER) == pytest.approx(3.0)  # the line through three
    assert initial_stiffness(way[:2], load[:2], OVER) == pytest.approx(2.0)
    assert initial_stiffness(way[:1], load[:1], OVER) is None


def test_loads_at_places():
    """Between frames, and at the last, which may end short of it by rounding; not beyond."""
    places = {"40 mm": 40.0, "100 mm": 100.0, "101 mm": 101.0}
    found = loads_at(of(0, 50, 100 * (1 - 1e-12)), of(0, 200, 300), places)
    assert found == {"40 mm": pytest.approx(160.0), "100 mm": pytest.approx(300.0), "101 mm": None}


def test_a_curve_with_a_limit_point():
    load = 400 * np.sin(WAY / 240 * 0.9 * np.pi)
    assert limit_point(WAY, load) == pytest.approx((240 / 1.8, 400.0), rel=0.02)
    # The slope is that of the start times a cosine: half of it at 60 degrees.
    place, _ = knee_point(WAY, load, initial_stiffness(WAY, load, OVER), OVER)
    assert place == pytest.approx(240 / 0.9 / 3, rel=0.02)


@pytest.mark.parametrize(("low", "there"), [(99.5, False), (99.49, True), (-1.0, True)])
def test_a_load_that_falls_by_half_a_percent(low, there):
    """The largest load counts, whether the fall is the last frame or not."""
    way = of(0, 5, 10, 15)
    for load in (of(0, 100, low, 99.9), of(0, 50, 100, low)):
        found = limit_point(way, load)
        assert found == ((float(way[np.argmax(load)]), 100.0) if there else None)


def test_where_a_knee_can_be():
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


def test_straightness():
    """Up to half of the load at the knee, of four frames at least."""
    r2, off = straightness(WAY, WAY**2, 2 * 240.0**2)
    # Of x^2 on [0, 1] the best straight line misses 1/180 of 4/45 of variance, 1/6 at the ends.
    assert r2 == pytest.approx(1 - (1 / 180) / (4 / 45), abs=2e-3)
    assert off == pytest.approx(1 / 6, rel=0.05)
    way, load = np.arange(5.0), of(0, 1, 5, 6, 7)
    r2, off = straightness(way, load, 12.0)
    missed = load[:4] - (2.2 * way[:4] - 0.3)
    assert r2 == pytest.approx(1 - (missed**2).sum() / ((load[:4] - 3) ** 2).sum())
    assert off == pytest.approx(np.abs(missed).max() / 6)
    assert straightness(way, load, 11.9) is None
    # All five: 1.9 mm a step misses by 1.2 at most, and leaves 2.7 of 38.8.
    assert straightness(way, load, 1e9) == pytest.approx((1 - 2.7 / 38.8, 1.2 / 7))
    assert straightness(way, 0 * load, 12.0) is None


def test_wrinkles_begin_where_more_is_wrinkled_than_when_inflated():
    run = BendingRun(of(0, 5, 10), of(0, 15, 30), NONE, NONE, NONE, NONE, of(0.25, 0.26, 0.2601))
    assert wrinkle_onset(run) == (10.0, 30.0)
    assert wrinkle_onset(replace(run, wrinkled=NONE)) is None
    assert wrinkle_onset(replace(run, wrinkled=of(0.1, 0.1, 0.1))) is None


def test_all_numbers_of_the_formula():
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
def test_strain_of_a_tube_that_grows():
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


def test_strain_of_a_flat_mesh_turned_in_space():
    disk = disk_mesh(100.0, 96)
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    warp = np.array([np.cos(0.3), np.sin(0.3), 0.0])
    u = 4 * np.random.default_rng(4).standard_normal(disk.points.shape)
    turned = Mesh(
        disk.points @ turn.T, disk.quads, {}, {}, np.tile(turn @ warp, (len(disk.quads), 1))
    )
    flat = surface_strain(disk, u, warp)
    np.testing.assert_allclose(surface_strain(turned, u @ turn.T), flat, atol=1e-12)
    # Carried around as a whole it is not strained.
    moved = turned.points @ turn - turned.points + 7.0
    np.testing.assert_allclose(surface_strain(turned, moved), 0.0, atol=1e-12)


# Records
MODEL = SimpleNamespace(deflections=(10.0, 20.0))


def history(frames: int = 3, **other) -> History:
    given = {
        "cavity_pressure": of(0.1, 0.101, 0.102)[:frames],
        "cavity_volume": 5e7 - np.arange(frames),
    } | other
    moved = np.arange(frames * 6.0).reshape(frames, 2, 3)
    return History(np.arange(frames) * 50.0, moved, np.zeros(3), np.zeros(3), **given)


def test_what_is_kept():
    kept = arrays_of(MODEL, history(wrinkled=[0.0, 0.1, 0.3]))
    assert {name: value.tolist() for name, value in kept.items()} == {
        "deflection": [0.0, 10.0, 20.0],
        "load": [0.0, 50.0, 100.0],
        "pressure": [0.1, 0.101, 0.102],
        "volume": [5e7, 5e7 - 1, 5e7 - 2],
        "inflated": [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]],
        "bent": [[12.0, 13.0, 14.0], [15.0, 16.0, 17.0]],
        "wrinkled": [0.0, 0.1, 0.3],
    }
    assert arrays_of(MODEL, history())["wrinkled"].size == 0
    # An early end is a result where the solver says why.
    short = history(2, early="no equilibrium")
    assert arrays_of(MODEL, short)["deflection"].tolist() == [0.0, 10.0]


@pytest.mark.parametrize(
    ("results", "words"),
    [
        (history(2), "at 10 of 20 mm"),
        (history(cavity_pressure=None), "no gas"),
        (history(cavity_volume=None), "no volume"),
    ],
)
def test_results_without_an_end_or_gas(results, words):
    raised(SolverFailure, words, arrays_of, MODEL, results)


# Models and quantities of a study
@pytest.fixture
def cylinders(tmp_path):
    path = tmp_path / "project.toml"
    path.write_text(STUDIED_PROJECT)
    return list(read_project(path).tests.values())


def test_finer_models(cylinders):
    narrow, wide = cylinders
    own, finer = (narrow.models(0.5, "elements", f)["cylinder"] for f in (3.0, 6.0))
    # What lies between seam, collar and supports is a whole number of rows: nearly a half.
    assert edge_length(finer.mesh) == pytest.approx(edge_length(own.mesh) / 2, rel=0.05)
    assert set(np.unique(wide.models(0.5, "elements", 6.0)["cylinder"].thickness)) == {0.5, 1.5}
    # Finer increments keep what is reported.
    own, finer = (narrow.models(0.81, "increments", f)["cylinder"] for f in (1.0, 3.0))
    assert finer.deflections == own.deflections and len(finer.increments) == 12
    assert finer.increments[:3] == pytest.approx([10 / 3, 20 / 3, 10.0])
    assert len(finer.inflation) == 3 * len(own.inflation) and finer.pressure == own.pressure
    np.testing.assert_array_equal(finer.reported, [2, 5, 8, 11])
    assert len(STUDIED.steps(finer)) == 42
    assert "increments" in complaint(narrow.models, 0.81, "increments", 0.5)


def test_quantities_of_a_history_made_up(cylinders):
    """A cylinder that swells by a tenth, then a load that is straight up to a limit and falls."""
    model = replace(cylinders[0].model(), deflections=np.arange(4.0, 241, 4.0), increments=())
    d = np.array([0.0, *model.deflections])
    moves = np.repeat((0.1 * model.mesh.points * [1, 1, 0])[None], len(d), axis=0)
    load = np.where(d < 120, 3.0 * d, 360.0 - 0.5 * (d - 120))
    history = History(load, moves, np.zeros(3), np.zeros(3), cavity_volume=np.full(len(d), 6.0e7))
    found = quantities(model, history)
    knee = found.pop("load at the knee, N")
    assert found == pytest.approx({
        "radius at mid-span, inflated, mm": 82.5, "volume, inflated, l": 60.0,
        "initial stiffness, N/mm": 3.0, "load at 40 mm, N": 120.0, "load at 100 mm, N": 300.0,
        "load at 240 mm, N": 300.0, "load at the limit point, N": 360.0,
    })  # fmt: skip
    assert 110 < knee / 3.0 < 120
    early = quantities(model, replace(history, load=load[:26], displacement=moves[:26]))
    assert "load at 240 mm, N" in found and "load at 240 mm, N" not in early
    assert "load at the limit point, N" not in early and early["no limit point up to, mm"] == 100.0
    assert "no knee up to, mm" in early and len(early) == len(found)


def test_a_curve_beside_measured_ones():
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
