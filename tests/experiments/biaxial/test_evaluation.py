"""experiments/biaxial/evaluation.py: constants of a test and their spread."""

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.biaxial.evaluation import by_yarn, evaluate_test
from bubblefit.experiments.fitted import UNMATCHED
from bubblefit.materials.designers import Options
from bubblefit.materials.law import HypoelasticLaw

from ...builders.biaxial_tests import THICKNESS, biaxial_project, biaxial_rows, write_biaxial_rows
from ...support.refusals import complaint

#: So stiff that strains are small, and the constants those of linear elasticity.
LINEAR = HypoelasticLaw.linear(1e5, 8e4, 3e3, 0.24)
CONSTANTS = (1e5 * THICKNESS, 8e4 * THICKNESS, 0.24 * 8e4 / 1e5, 0.24)


@pytest.fixture(scope="module")
def biaxial_test(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluated")
    write_biaxial_rows(folder / "test.csv", biaxial_rows(LINEAR, cycles=2, kept=0.01))
    return bf.read_project(biaxial_project(folder)).tests["biaxial"]


def test_constants_of_a_linear_law_are_recovered(biaxial_test):
    c = evaluate_test(biaxial_test).chosen.constants
    assert (c.warp, c.fill) == pytest.approx(CONSTANTS[:2], rel=2e-3)
    assert sorted((c.nu_warp, c.nu_fill)) == pytest.approx(sorted(CONSTANTS[2:]), rel=5e-3)


def test_options_hardly_change_the_constants_of_a_linear_law(biaxial_test):
    found = evaluate_test(biaxial_test)
    assert len(found.alternatives) > 5
    for low, high in found.spread.values():
        assert high / low == pytest.approx(1.0, abs=0.01)
    (note,) = found.notes
    assert note.kind == UNMATCHED and "shear stiffness" in note


def test_first_and_last_cycles_of_a_linear_law_are_equal(biaxial_test):
    found = evaluate_test(biaxial_test)
    first, last = found.first_cycle.constants, found.last_cycle.constants
    assert (first.warp, first.fill) == pytest.approx((last.warp, last.fill), rel=1e-6)


def test_residual_strain_grows_by_what_each_cycle_leaves(biaxial_test):
    table = evaluate_test(biaxial_test).residual_strains
    assert table.ratio.tolist() == ["1:1", "2:1", "1:2", "1:0", "0:1"]
    assert (table.cycles == 2).all()
    # Only 1:1 comes back to the loads of the first row, before it starts and after it.
    assert table.warp_before_percent[0] == 0.0
    assert np.isnan(table.warp_before_percent[1:]).all()


def test_ratio_that_was_not_tested_is_refused(biaxial_test):
    words = complaint(evaluate_test, biaxial_test, Options(ratios=("3:1",)))
    assert "there is no ratio 3:1; the test has: 1:1, 2:1, 1:2" in words


def test_pairs_become_columns_of_warp_and_fill():
    assert by_yarn(load=[1, 2], strain=np.array([0.5, np.nan]))["fill_load"] == 2.0
    assert list(by_yarn(load=[1, 2])) == ["warp_load", "fill_load"]
