"""experiments/strips/planning.py: strips proposed as next tests, and the strains they reach."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.fabric import Fabric
from bubblefit.experiments.planning import Planning
from bubblefit.experiments.sections import Place
from bubblefit.experiments.strips.planning import CANDIDATES, candidates
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver

PLACE = Place(Path("p.toml"), "strips", Fabric("made", 0.8))
LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0, 0.2)


def planning_of(noise=None, ends=(0.1, 0.08, 0.2)):
    law = HypoelasticLaw(LAW.beta, LAW.nu12, ends, form=LAW.form)
    return Planning(PLACE, (), {}, law, MembraneSolver, noise)


def test_strips_along_the_yarns_and_at_usual_angles_are_proposed():
    proposed = candidates(planning_of())
    names = [candidate.name for candidate in proposed]
    assert names[:2] == ["warp strip", "fill strip"]
    assert names[2:] == [f"strip at {angle:g} degrees" for angle in sorted(CANDIDATES.angles)]
    assert {candidate.noise_is for candidate in proposed} == {"assumed"}
    assert {candidate.specimens for candidate in proposed} == {CANDIDATES.specimens}


@pytest.mark.parametrize(("number", "end"), [(0, 0.1), (1, 0.08)])
def test_strip_along_a_yarn_is_pulled_to_the_end_of_the_law(number, end):
    prepared = candidates(planning_of())[number].make()
    (strip,) = prepared.test.strips.values()
    assert np.log(strip.final_length / strip.gauge_length) == pytest.approx(end)
    (curve,) = strip.curves
    assert len(curve.load) == CANDIDATES.increments and (np.diff(curve.load) > 0).all()


def test_loads_are_those_of_the_model_with_the_law():
    planning = planning_of()
    (strip,) = candidates(planning)[0].make().test.strips.values()
    model = straight_strip(
        "warp", strip.gauge_length, strip.final_length, 0.8, increments=CANDIDATES.increments
    )
    expected = MembraneSolver().run(model, planning.law).load
    np.testing.assert_allclose(strip.curves[0].load / expected, 1.0, rtol=1e-6)


def test_bias_strip_ends_where_its_shear_does():
    proposed = {candidate.name: candidate for candidate in candidates(planning_of())}
    (strip,) = proposed["strip at 45 degrees"].make().test.strips.values()
    # The area stays: shear is twice the strain of the gauge.
    assert np.log(strip.final_length / strip.gauge_length) == pytest.approx(0.1)


def test_noise_is_the_given_one_or_a_share_of_the_load():
    given = candidates(planning_of(noise=3.0))
    assert {candidate.noise_is for candidate in given} == {"given"}
    assert given[0].make().test.noise == 3.0
    assumed = candidates(planning_of())[0].make().test
    largest = assumed.strips["warp"].curves[0].load.max()
    assert 0.0 < assumed.noise < largest
    stiffer = Planning(PLACE, (), {}, planning_of().law.with_beta(2 * LAW.beta), MembraneSolver)
    assert candidates(stiffer)[0].make().test.noise == pytest.approx(2 * assumed.noise, rel=1e-6)
