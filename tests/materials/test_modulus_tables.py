"""materials/modulus_tables.py: tables of moduli and their error."""

import numpy as np
import pytest
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.modulus_tables import JUMP, REACH, modulus_table, modulus_tables
from hypothesis import given, settings
from hypothesis import strategies as st

from ..builders.fortran import BETA, KNOTS, LAWS, trilinear
from ..support.refusals import complaint

CUBIC = HypoelasticLaw(BETA, strain_range=np.array([0.13, 0.12, 0.14]))
TRILINEAR = LAWS["tri-linear, held"]


def test_table_of_published_cubic_has_the_stated_error():
    tables = modulus_tables(CUBIC)
    assert set(tables) == set(COMPONENTS)
    for name, table in tables.items():
        # Beyond both ends, too: held, as the law does.
        strain = np.linspace(-0.3, 0.3, 20001)
        off = np.abs(table.at(strain) / CUBIC.modulus(name, strain) - 1)
        assert off.max() <= 1.01 * table.error
        assert table.error < 1e-3 and table.reaches
        assert len(table.strain) >= 121
        assert table.strain[-1] == CUBIC.strain_range[COMPONENTS[name]]
        assert (np.diff(table.strain) > 0).all()
        assert np.array_equal(table.modulus, CUBIC.modulus(name, table.strain))
    shear = tables["G12"]
    assert np.array_equal(shear.strain, -shear.strain[::-1]) and tables["E1"].strain[0] == 0
    coarse, fine = (modulus_table(CUBIC, "E1", points).error for points in (61, 121))
    assert coarse / fine == pytest.approx(4.0, rel=0.1)
    table = modulus_table(HypoelasticLaw(BETA), "E1")
    assert not table.reaches and table.strain[-1] == REACH
    assert modulus_table(HypoelasticLaw(BETA), "E1", reach=0.1).strain[-1] == 0.1
    assert "points" in complaint(modulus_table, CUBIC, "E1", 1)
    assert "reach" in complaint(modulus_table, CUBIC, "E1", reach=0.0)


def test_table_of_a_jump_is_a_steep_line_after_its_break():
    table = modulus_table(TRILINEAR, "E1")
    assert table.error == 0
    assert table.at(0.01) == 800 and table.at(0.01 + JUMP) == pytest.approx(450, rel=1e-12)
    assert table.at(0.03) == pytest.approx(450, rel=1e-12) and table.at(0.03 + JUMP) == 900
    assert set(modulus_table(TRILINEAR, "E2").modulus) == {140.0, 110.0}
    assert set(modulus_table(TRILINEAR, "G12").modulus) == {20.0}
    law = LAWS["jumps and kinks"]
    mixed, fill = modulus_table(law, "E1"), modulus_table(law, "E2")
    assert mixed.jumps.tolist() == [0.01, 0.04] and fill.jumps.tolist() == []
    assert 0.03 in fill.strain and fill.error < 1e-12
    for own, made, breaks in ((TRILINEAR, table, [0.01, 0.03]), (law, mixed, mixed.jumps)):
        away = np.linspace(-0.02, 0.2, 4001)
        away = away[(np.abs(away[:, None] - breaks) > 2 * JUMP).all(axis=1)]
        assert np.abs(made.at(away) / own.E1(away) - 1).max() <= 1.01 * made.error + 1e-12


def test_table_of_a_spline_has_the_stated_error_and_its_knots():
    law = LAWS["spline"]
    for name, component in (("E1", 0), ("E2", 1), ("G12", 2)):
        table = modulus_table(law, name)
        end, knots = law.strain_range[component], KNOTS[component]
        strain = np.linspace(-0.3, 0.3, 20001)
        off = np.abs(table.at(strain) / law.modulus(name, strain) - 1)
        assert off.max() <= 1.01 * table.error and table.error < 2e-3
        assert np.abs(table.strain[:, None] - knots).min(axis=0).max() == 0
        assert np.diff(table.strain).min() > 1e-5 and not len(table.jumps)
        assert table.strain[-1] == end and table.reaches


@pytest.mark.parametrize("left", [1e-9, 5e-7, 1e-6, 2e-6, 1e-5])
def test_table_has_a_jump_just_before_the_end_of_the_range(left):
    table = modulus_table(trilinear(strain_range=[0.01 + left, 0.2, 0.2]), "E1")
    assert table.strain[-1] == 0.01 + left and table.error == 0
    assert table.at(0.01) == 800 and table.at(0.02) == 450


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.floats(-100, 100), min_size=12, max_size=12),
    st.lists(st.floats(0.005, 0.5), min_size=3, max_size=3),
    st.integers(100, 300),
)
def test_table_of_any_cubic_keeps_the_bound_of_linear_interpolation(beta, ends, points):
    """|f - table| <= h^2/8 max |f''|, in MPa; a modulus through zero has no relative error."""
    law = HypoelasticLaw(np.array(beta), strain_range=np.array(ends))
    for first, (name, component) in zip((8, 4, 0), COMPONENTS.items(), strict=True):
        table = modulus_table(law, name, points)
        curvature = np.abs([np.polyval([6 * beta[first], 2 * beta[first + 1]], x)
                            for x in (0.0, ends[component])]).max()  # fmt: skip
        bound = (ends[component] / (points - 1)) ** 2 / 8 * curvature
        strain = np.linspace(-0.6, 0.6, 2001)
        assert (np.abs(table.at(strain) - law.modulus(name, strain)) <= bound + 1e-11).all()
