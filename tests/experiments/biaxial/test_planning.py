"""experiments/biaxial/planning.py: load ratios proposed as next tests."""

import numpy as np
import pytest
from bubblefit.experiments.base import Weighting
from bubblefit.experiments.biaxial.planning import candidates
from bubblefit.experiments.planning import Planning, Precision
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.law import HypoelasticLaw

from ...builders.biaxial_tests import THICKNESS, biaxial_project, biaxial_rows, write_biaxial_rows
from ...builders.projects import fit_setup

TRUE = HypoelasticLaw.linear(900.0, 600.0, 30.0, 0.24)


def planning_of(tmp_path, noise=None, own=True) -> Planning:
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(TRUE, ["1:1", "2:1"]))
    setup = fit_setup(biaxial_project(tmp_path, form="constant"))
    (prepared,) = setup.tests
    law = HypoelasticLaw(TRUE.beta, 0.24, [0.03, 0.04, 0.1], form=TRUE.form)
    precision = {"biaxial: 1:1": Precision(0.02, 2.0, 29), "biaxial: 2:1": Precision(0.03, 4.0, 29)}
    tests = [prepared] if own else []
    place = prepared.test.place
    return Planning(place, tests, precision if own else {}, law, setup.make_solver, noise)


def test_candidate_ratios_reach_to_the_strains_of_the_law(tmp_path):
    offered = candidates(planning_of(tmp_path))
    assert [c.name for c in offered] == [
        f"biaxial {r}" for r in ("1:1", "2:1", "1:2", "1:0", "0:1", "1:5", "5:1")
    ]
    assert {c.noise_is for c in offered} == {"that of biaxial"}
    for candidate in offered:
        (path,) = candidate.make().test.paths
        share = np.log1p(path.strain[-1]) / [0.03, 0.04]
        assert share.max() == pytest.approx(1.0, rel=1e-6) and len(path.load) == 20
        wanted = biaxial_response(TRUE, path.load, THICKNESS).elongation
        np.testing.assert_allclose(path.strain, wanted, rtol=1e-12)
        np.testing.assert_allclose(path.load[0], 0.05 * path.load[-1])


def test_noise_of_a_candidate_ratio_is_measured_given_or_assumed(tmp_path):
    def noise(**options):
        candidate = candidates(planning_of(tmp_path, **options))[0]
        (one,) = candidate.make().comparisons(lambda *a: None, Weighting())
        return candidate.noise_is, one.objective.least_noise

    # The worse of both ratios, of which four neighbours err as one.
    own, known = noise()
    assert own == "that of biaxial" and known == pytest.approx(0.03 * np.sqrt(4.0 * 19 / 29))
    assert noise(noise=0.05) == ("given", pytest.approx(0.05))
    assert noise(own=False) == ("assumed", pytest.approx(0.01 * np.sqrt(19 / 5)))
