"""Numbers of a bending run on curves that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.cylinder.measures import (
    bending_measures,
    inflation_strain,
    initial_stiffness,
    knee_point,
    limit_point,
    loads_at,
    straightness,
    wrinkle_onset,
)
from bubblefit.experiments.cylinder.record import BendingRun, run_of
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder import cylinder_mesh
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.strain import middle_strain, surface_strain
from bubblefit.models.bending import inflated_cylinder
from bubblefit.models.reading import curve_reading

from ...cylinder_cases import ran

#: mm over which slopes are taken here.
OVER = 20.0
WAY = np.linspace(0.0, 240.0, 61)
NONE = np.empty(0)


def law(e1: float = 500.0) -> HypoelasticLaw:
    return HypoelasticLaw.linear(e1, 150.0, 20.0)


def model(symmetry: str = "quarter"):
    way, reading = WAY[1:].tolist(), curve_reading(150.0, (40.0, 100.0, 240.0), OVER)
    return inflated_cylinder(
        150.0, 0.14, 0.81, 40.0, deflections=way, symmetry=symmetry, reading=reading
    )


# Numbers of a curve


def test_a_bilinear_curve() -> None:
    """4 N/mm to 100 mm, 1 N/mm from there."""
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


def test_the_initial_slope_is_of_the_frames_up_to_there() -> None:
    """The frame that lies there counts, by rounding beyond or not; the next one does not."""
    load = np.array([0.0, 20.0, 40.0, 60.0, 30.0, 200.0])
    for end in (20.0, 20.0 * (1 + 1e-12)):
        found = initial_stiffness(np.array([0.0, 5.0, 10.0, 15.0, end, 30.0]), load, OVER)
        assert found == pytest.approx(2.0)  # the straight line through five points


def test_loads_at_places() -> None:
    """Between frames, and at the last, which may end short of it by rounding; not beyond."""
    way, load = np.array([0.0, 50.0, 100.0 * (1 - 1e-12)]), np.array([0.0, 200.0, 300.0])
    found = loads_at(way, load, {"40 mm": 40.0, "100 mm": 100.0, "101 mm": 101.0})
    assert found == {"40 mm": pytest.approx(160.0), "100 mm": pytest.approx(300.0), "101 mm": None}


def test_a_curve_with_a_limit_point() -> None:
    load = 400 * np.sin(WAY / 240 * 0.9 * np.pi)
    top = limit_point(WAY, load)
    assert top == pytest.approx((240 / 1.8, 400.0), rel=0.02)
    # The slope is that of the start times a cosine: half of it at 60 degrees.
    place, _ = knee_point(WAY, load, initial_stiffness(WAY, load, OVER), OVER)
    assert place == pytest.approx(240 / 0.9 / 3, rel=0.02)
    # A dip by less than one half percent is contact's noise.
    assert limit_point(WAY[:3], np.array([0.0, 100.0, 99.6])) is None


def test_curves_that_say_too_little() -> None:
    assert initial_stiffness(WAY[:1], NONE, OVER) is None
    assert knee_point(WAY[:5], 4 * WAY[:5], 4.0, OVER) is None
    assert knee_point(WAY, 4 * WAY, 4.0, OVER) is None
    assert straightness(WAY[:3], 4 * WAY[:3], 100.0) is None


def test_a_bent_line_is_not_straight() -> None:
    r2, off = straightness(WAY, WAY**2, 2 * 240.0**2)
    # Of x^2 on [0, 1] the best straight line misses 1/180 of 4/45 of variance, 1/6 at the ends.
    assert r2 == pytest.approx(1 - (1 / 180) / (4 / 45), abs=2e-3)
    assert off == pytest.approx(1 / 6, rel=0.05)


def test_wrinkles_begin_where_more_is_wrinkled_than_when_inflated() -> None:
    share = 0.1 + 1e-3 * np.maximum(WAY - 50, 0)
    run = BendingRun(WAY, 2 * WAY, NONE, NONE, NONE, NONE, share)
    assert wrinkle_onset(run) == pytest.approx((64.0, 128.0))
    assert wrinkle_onset(replace(run, wrinkled=NONE)) is None
    assert wrinkle_onset(replace(run, wrinkled=0 * WAY + 0.1)) is None


def test_all_numbers_of_the_formula() -> None:
    m = model()
    run = run_of(ran(m, MaterialCard(law(), 0.81)))
    assert run is not None
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
    assert found.buckling_is == "knee" and found.reached == 240.0 and found.error is None
    assert found.wrinkles[0] == 56.0


# Strain of a curved surface


def test_strain_of_a_tube_that_grows() -> None:
    mesh = cylinder_mesh(900.0, 150.0, 25.0, 40.0)
    strain = surface_strain(mesh, mesh.points * [0.1, 0.1, 0.03])
    tube = np.setdiff1d(np.arange(len(mesh.quads)), mesh.element_sets["caps"])
    np.testing.assert_allclose(strain[tube], np.tile([*np.log([1.03, 1.1]), 0], (len(tube), 1)),
                               atol=1e-12)  # fmt: skip
    np.testing.assert_allclose(strain[mesh.element_sets["caps"], :2], np.log(1.1))


def test_strain_of_a_flat_mesh_turned_in_space() -> None:
    disk = disk_mesh(100.0, 96)
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)
    warp = np.array([np.cos(0.3), np.sin(0.3), 0.0])
    u = 4 * np.random.default_rng(4).standard_normal(disk.points.shape)
    turned = Mesh(
        disk.points @ turn.T, disk.quads, {}, {}, np.tile(turn @ warp, (len(disk.quads), 1))
    )
    flat = middle_strain(disk, u, warp)
    np.testing.assert_allclose(surface_strain(turned, u @ turn.T), flat, atol=1e-12)
    # Carried around as a whole it is not strained.
    moved = turned.points @ turn - turned.points + 7.0
    np.testing.assert_allclose(surface_strain(turned, moved), 0.0, atol=1e-12)
    with pytest.raises(ValueError, match="warp"):
        surface_strain(disk, u)


def test_the_body_is_apart_from_seam_and_caps() -> None:
    mesh = cylinder_mesh(900.0, 150.0, 25.0, 40.0)
    u = mesh.points * [0.1, 0.1, 0.0]
    beside = mesh.node_sets["ends"]
    u[beside] = mesh.points[beside] * [0.5, 0.5, 0.0]
    body, anywhere = inflation_strain(mesh, u)
    assert body[1] == pytest.approx(np.log(1.1))
    assert anywhere[1] > np.log(1.25)


def test_a_smaller_cylinder_is_read_at_its_own_scale() -> None:
    """Everything a tenth: the same curve, read at places a tenth as far."""
    tenth = replace(model(), reading=curve_reading(15.0))
    assert tenth.reading.places == pytest.approx(
        {"0.25 diameters": 3.75, "0.5 diameters": 7.5, "1 diameters": 15.0}
    )
    load = np.minimum(4 * WAY, 300 + WAY)
    large = knee_point(WAY, load, 4.0, OVER)
    small = knee_point(0.1 * WAY, load, 40.0, 0.1 * OVER)
    assert large is not None and small is not None
    assert small == pytest.approx((0.1 * large[0], large[1]))
