"""A braid near 54.7 degrees: what half a degree of its angle does to the load is said."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.cylinder.measures import angle_sensitivity, is_near_neutral
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.beam_model import (
    BeamModel,
    BraidedWall,
    PlainWall,
    TubeCrossSection,
    axial_table,
)
from bubblefit.meshes.cylinder_model import Cord
from bubblefit.project.project import read_project
from bubblefit.runs.predictions import predict
from bubblefit.solvers.membrane.solver import MembraneSolver

from .test_section import BEAM

PLACES = {"20 mm": 20.0, "60 mm": 60.0, "90 mm": 90.0}


def braided(angle):
    wall = BraidedWall(angle, 2000.0, 2.0, 9.6, 3.33)
    cords = [Cord(around, axial_table(800e3)) for around in (0.0, 120.0, 240.0)]
    return BeamModel(TubeCrossSection(170.0, 0.1, wall, cords), 3200.0, [20.0, 60.0], 1000.0)


def load_of(model):
    return MembraneSolver().run(model, HypoelasticLaw.linear(1.0, 1.0, 1.0)).load


def test_the_change_by_half_a_degree_is_that_of_beams_with_other_angles():
    loads = {angle: load_of(braided(angle))[-1] for angle in (56.0, 56.5, 57.0)}
    said = angle_sensitivity(braided(56.5), load_of(braided(56.5)), PLACES)
    less, more = (100 * (loads[angle] / loads[56.5] - 1) for angle in (56.0, 57.0))
    assert less < -5 and more > 5
    for words, change in (("less", less), ("more", more)):
        assert f"half a degree {words} changes the load at 60 mm by {change:+.0f} %" in said
    assert said.startswith("the braid's 56.5 degrees are near 54.7, where it leaves no thrust")


def test_an_angle_at_which_nothing_is_left_to_the_cords_has_no_equilibrium():
    said = angle_sensitivity(braided(55.0), load_of(braided(55.0)), PLACES)
    assert "half a degree less leaves no equilibrium, half a degree more changes the" in said
    nowhere = angle_sensitivity(braided(55.0), np.array([0.0, 10.0]), {"500 mm": 500.0})
    assert nowhere.endswith("the load depends much on the angle")


def test_only_a_braid_near_the_neutral_angle_is_looked_at():
    assert is_near_neutral(braided(57.9)) and not is_near_neutral(braided(58.1))
    beam = braided(60.0)
    plain = replace(beam.section, wall=PlainWall(400.0, 300.0, 60.0, 0.2))
    assert not is_near_neutral(replace(beam, section=plain)) and not is_near_neutral(None)


@pytest.mark.parametrize(("angle", "count"), [(56.5, 1), (65.0, 0)])
def test_bend_says_it_and_nothing_of_a_card_that_a_beam_does_not_have(tmp_path, angle, count):
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
