"""experiments/cylinder/measures.py: numbers of a bending run, and of its braid."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.cylinder.measures import (
    angle_sensitivity,
    bending_measures,
    inflation_strain,
    is_near_neutral,
    wrinkle_onset,
)
from bubblefit.experiments.cylinder.run import BendingRun, run_of
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.beam_model import BeamModel, BraidedWall, PlainWall, TubeCrossSection
from bubblefit.meshes.cylinder_model import Cord, axial_table, curve_reading, inflated_cylinder
from bubblefit.meshes.mesh import surface_strain
from bubblefit.meshes.tube import cylinder_mesh
from bubblefit.project.project import read_project
from bubblefit.runs.predictions import predict
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.bent_cylinders import ran
from .cases import BEAM, NONE, OVER, WAY, run_of_curve


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
