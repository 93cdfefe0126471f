"""Modulus tables against the law they stand for."""

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.tables import JUMP, REACH, modulus_table, modulus_tables
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import trapezoid

from ..fortran_build import KNOTS, LAWS
from ..published_laws import TABLE_4_2

# MPa.
BETA = 1e3 * np.array(TABLE_4_2)
CUBIC = HypoelasticLaw(BETA, strain_range=np.array([0.13, 0.12, 0.14]))
MODULI_3 = ((800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0))
BREAKS = [[0.01, 0.03], [0.02, 0.06], [0.01, 0.04]]
TRILINEAR = HypoelasticLaw.trilinear(*MODULI_3, BREAKS, strain_range=[0.13, 0.05, 0.008])


def test_the_published_cubic_to_the_stated_error():
    tables = modulus_tables(CUBIC)
    assert set(tables) == set(COMPONENTS)
    for name, table in tables.items():
        end = CUBIC.strain_range[COMPONENTS[name]]
        # Beyond both ends, too: held, as the law does.
        strain = np.linspace(-0.3, 0.3, 20001)
        off = np.abs(table.at(strain) / CUBIC.modulus(name, strain) - 1)
        assert off.max() <= 1.01 * table.error
        assert table.error < 1e-3 and table.reaches
        assert len(table.strain) >= 121 and table.strain[-1] == end
        assert (np.diff(table.strain) > 0).all()
        assert np.array_equal(table.modulus, CUBIC.modulus(name, table.strain))


def test_the_error_falls_with_the_square_of_the_spacing():
    coarse, fine = (modulus_table(CUBIC, "E1", points).error for points in (61, 121))
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


def test_stress_of_a_bar_from_the_tables_is_that_of_the_law():
    """The tabulated curve of a bar: the integral of E1 over log strain."""
    table = modulus_table(CUBIC, "E1")
    stress = trapezoid(table.modulus, table.strain)
    antiderivative = np.polyint(BETA[8:])
    assert stress == pytest.approx(np.polyval(antiderivative, 0.13), rel=1e-4)


def test_shear_is_even():
    table = modulus_table(CUBIC, "G12")
    assert np.array_equal(table.strain, -table.strain[::-1])
    assert np.array_equal(table.modulus, table.modulus[::-1])
    assert table.strain[0] == -0.14
    assert modulus_table(CUBIC, "E1").strain[0] == 0


def test_a_jump_is_one_steep_line_after_its_break():
    table = modulus_table(TRILINEAR, "E1")
    assert table.error == 0
    assert table.at(0.01) == 800 and table.at(0.01 + JUMP) == pytest.approx(450, rel=1e-12)
    assert table.at(0.03) == pytest.approx(450, rel=1e-12) and table.at(0.03 + JUMP) == 900
    away = np.linspace(-0.02, 0.2, 4001)
    away = away[(np.abs(away[:, None] - [0.01, 0.03]) > 2 * JUMP).all(axis=1)]
    assert np.allclose(table.at(away), TRILINEAR.E1(away), rtol=1e-12)


def test_breaks_beyond_the_range_are_not_in_the_table():
    assert set(modulus_table(TRILINEAR, "E2").modulus) == {140.0, 110.0}
    assert set(modulus_table(TRILINEAR, "G12").modulus) == {20.0}


def test_a_spline_to_the_stated_error_with_a_point_at_every_knot():
    law = LAWS["spline"]
    for name, component in (("E1", 0), ("E2", 1), ("G12", 2)):
        table = modulus_table(law, name)
        end, knots = law.strain_range[component], KNOTS[component]
        strain = np.linspace(-0.3, 0.3, 20001)
        off = np.abs(table.at(strain) / law.modulus(name, strain) - 1)
        assert off.max() <= 1.01 * table.error and table.error < 2e-3
        assert np.abs(table.strain[:, None] - knots).min(axis=0).max() == 0
        # A knot does not lie beside an equally spaced strain, but instead of it.
        assert np.diff(table.strain).min() > 1e-5 and not len(table.jumps)
        assert table.strain[-1] == end and table.reaches


def test_jumps_and_kinks_are_in_the_table():
    law = LAWS["jumps and kinks"]
    warp, fill = modulus_table(law, "E1"), modulus_table(law, "E2")
    assert warp.jumps.tolist() == [0.01, 0.04] and fill.jumps.tolist() == []
    assert 0.03 in fill.strain and fill.error < 1e-12
    away = np.linspace(-0.02, 0.2, 4001)
    away = away[(np.abs(away[:, None] - warp.jumps) > 2 * JUMP).all(axis=1)]
    assert np.abs(warp.at(away) / law.E1(away) - 1).max() <= 1.01 * warp.error


@pytest.mark.parametrize("left", [1e-9, 5e-7, 1e-6, 2e-6, 1e-5])
def test_a_jump_just_before_the_end_of_the_range_is_in_the_table(left):
    short = HypoelasticLaw.trilinear(*MODULI_3, BREAKS, strain_range=[0.01 + left, 0.2, 0.2])
    table = modulus_table(short, "E1")
    assert table.strain[-1] == 0.01 + left and table.error == 0
    assert table.at(0.01) == 800 and table.at(0.02) == 450


def test_a_law_without_a_range_is_tabulated_as_far_as_asked():
    law = HypoelasticLaw(BETA)
    table = modulus_table(law, "E1")
    assert not table.reaches and table.strain[-1] == REACH
    assert modulus_table(law, "E1", reach=0.1).strain[-1] == 0.1


@settings(max_examples=50, deadline=None)
@given(
    st.lists(st.floats(-100, 100), min_size=12, max_size=12),
    st.lists(st.floats(0.005, 0.5), min_size=3, max_size=3),
    st.integers(100, 300),
)
def test_any_cubic_to_the_bound_of_linear_interpolation(beta, ends, points):
    """|f - table| <= h^2/8 max |f''|, in MPa; a modulus through zero has no relative error."""
    law = HypoelasticLaw(np.array(beta), strain_range=np.array(ends))
    for first, (name, component) in zip((8, 4, 0), COMPONENTS.items(), strict=True):
        table = modulus_table(law, name, points)
        curvature = np.abs([np.polyval([6 * beta[first], 2 * beta[first + 1]], x)
                            for x in (0.0, ends[component])]).max()  # fmt: skip
        bound = (ends[component] / (points - 1)) ** 2 / 8 * curvature
        strain = np.linspace(-0.6, 0.6, 2001)
        assert (np.abs(table.at(strain) - law.modulus(name, strain)) <= bound + 1e-11).all()


def test_what_cannot_be_is_refused():
    with pytest.raises(InputError, match="points"):
        modulus_table(CUBIC, "E1", 1)
    with pytest.raises(InputError, match="reach"):
        modulus_table(CUBIC, "E1", reach=0.0)
