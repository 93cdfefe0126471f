"""Designers' constants, their exports, and biaxial responses."""

import dataclasses
import io
import math
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.designers import (
    POINTS,
    RATIOS,
    DesignersConstants,
    LinearPath,
    Options,
    constants_of_law,
    evaluate,
    every_option,
    line_of,
    shares,
)
from bubblefit.materials.exports.curves import yarn_of
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.responses import biaxial_response, trellis_curve, uniaxial_curve
from bubblefit.solvers.registry import FORMATS
from hypothesis import given, settings
from hypothesis import strategies as st

from ..biaxial_files import BENT, THICKNESS
from ..complaints import complaint_with
from ..fortran_build import LAWS

#: Published for a glass/PTFE fabric with free Poisson's ratios (test T2, 2 to 30 kN/m).
FREE = DesignersConstants(1188.0, 864.0, 0.73, 0.69)
RECIPROCAL = DesignersConstants.of_stiffness([[1000.0, 400.0], [400.0, 800.0]])


def paths(constants: DesignersConstants, ratios=RATIOS, offset=0.0) -> list[LinearPath]:
    found = []
    for ratio in ratios:
        load = np.outer(np.linspace(2, 30, 15), shares(ratio))
        found.append(line_of(ratio, load, constants.strain(load) + offset))
    return found


def test_the_direct_form_is_the_inverse_of_the_other():
    c = RECIPROCAL
    got = (c.warp, c.fill, c.nu_warp, c.nu_fill)
    np.testing.assert_allclose(got, (800.0, 640.0, 0.4, 0.5), rtol=1e-9)
    np.testing.assert_allclose(c.stiffness, [[1000, 400], [400, 800]], rtol=1e-12)
    np.testing.assert_allclose(c.compliance @ c.stiffness, np.eye(2), atol=1e-12)
    assert c.reciprocal and c.stable and not FREE.reciprocal and FREE.stable


def test_nu_warp_is_how_much_the_warp_contracts_when_the_fill_is_pulled():
    strain = FREE.strain([[0.0, 10.0], [10.0, 0.0]])
    assert strain[0, 0] / strain[0, 1] == pytest.approx(-0.73)
    assert strain[1, 1] / strain[1, 0] == pytest.approx(-0.69)
    assert strain[0, 1] == pytest.approx(10 / 864) and strain[1, 0] == pytest.approx(10 / 1188)


@pytest.mark.parametrize("options", every_option(paths(RECIPROCAL)), ids=str)
def test_every_option_finds_the_constants_of_computed_paths(options):
    found = evaluate(paths(RECIPROCAL, offset=0.013), options)
    got, wanted = (dataclasses.astuple(c)[:4] for c in (found.constants, RECIPROCAL))
    np.testing.assert_allclose(got, wanted, rtol=1e-9)
    assert found.squares < 1e-20 and max(found.rms.values()) < 1e-10


@settings(max_examples=40, deadline=None)
@given(
    stiffness=st.tuples(st.floats(50, 5000), st.floats(50, 5000)),
    share=st.tuples(st.floats(-0.3, 0.9), st.floats(-0.3, 0.9)),
)
def test_free_constants_are_found_whatever_they_are(stiffness, share):
    a, b = stiffness
    c = DesignersConstants(a, b, share[0] * np.sqrt(b / a), share[1] * np.sqrt(a / b))
    for options in (Options(True, False), Options(False, False), Options(True, False, "load")):
        found = evaluate(paths(c), options).constants
        got, wanted = dataclasses.astuple(found)[:4], dataclasses.astuple(c)[:4]
        np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9)


def test_which_paths_count_and_their_squares():
    lines = paths(FREE)
    counts = {
        (o.unloaded, o.ratios): evaluate(lines, o).paths
        for o in every_option(lines) if o.minimise == "strain" and o.reciprocal
    }  # fmt: skip
    assert counts == {
        (False, ()): 8, (True, ()): 10, (False, ("1:1", "1:2")): 4, (False, ("1:1", "2:1")): 4,
        (False, ("1:1", "2:1", "1:2")): 6,
    }  # fmt: skip
    # Least squares: nothing near by leaves less; and the sum is that of its definition.
    best = evaluate(lines, Options())
    shares = np.arange(1, POINTS + 1) / POINTS
    for ratio, load, strain in ((p.ratio, p.load, p.strain) for p in lines):
        own = 100 * (strain - best.constants.strain(load))
        off = np.outer(shares, own)
        assert best.rms[ratio] == pytest.approx(np.sqrt(np.mean(off**2)))

    def squares(constants):
        total = 0.0
        for path in lines:
            own = 100 * (path.strain - constants.strain(path.load))
            for yarn, unloaded in enumerate(path.unloaded):
                total += 0.0 if unloaded else float((shares**2).sum()) * own[yarn] ** 2
        return total

    assert best.squares == pytest.approx(squares(best.constants))
    c = best.constants.compliance
    for step in (np.diag([1e-6, 0]), np.diag([0, 1e-6]), np.array([[0, 1e-6], [1e-6, 0]])):
        for sign in (1, -1):
            near = DesignersConstants.of_compliance(c + sign * step)
            assert squares(near) > best.squares


def test_reciprocity_costs_squares_and_is_kept():
    lines = paths(FREE)
    tied, free = evaluate(lines, Options()), evaluate(lines, Options(reciprocal=False))
    assert tied.constants.reciprocal and not free.constants.reciprocal
    assert tied.squares > free.squares + 0.1


def test_a_line_goes_by_least_squares_and_tells_what_it_leaves():
    load = np.outer(np.linspace(2, 12, 11), [1.0, 0.5])
    wave = 1e-4 * np.cos(np.pi * np.arange(11))
    line = line_of("2:1", load, FREE.strain(load) + np.column_stack([wave, 0 * wave]))
    wanted = FREE.strain(load[-1:] - load[:1])[0]
    np.testing.assert_allclose(line.load, [10.0, 5.0])
    np.testing.assert_allclose(line.strain, wanted, atol=2e-6)
    np.testing.assert_allclose(line.residual, [1e-4, 0.0], rtol=0.02, atol=1e-15)
    assert line.unloaded == (False, False) and paths(FREE, ("1:0",))[0].unloaded == (False, True)


def test_paths_that_settle_no_constants_are_refused():
    complaint_with(["two that differ"], evaluate, paths(FREE, ("1:1",)), Options())
    complaint_with(["two that differ"], evaluate, paths(FREE), Options(ratios=("3:1",)))
    complaint_with(["do not change"], line_of, "1:1", np.ones((3, 2)), np.zeros((3, 2)))
    complaint_with(["get shorter"], DesignersConstants.of_compliance, -np.eye(2))
    complaint_with(["no inverse"], DesignersConstants.of_stiffness, [[1, 2], [2, 1]])
    unstable = DesignersConstants(1000, 1000, 1.2, 1.1)
    assert not unstable.stable
    complaint_with(["1.32", "below 1"], lambda: unstable.stiffness)


def test_a_linear_law_gives_its_own_constants_at_small_loads():
    law = HypoelasticLaw.linear(1000.0, 800.0, 30.0, 0.24)
    found = constants_of_law(law, THICKNESS, 0.0, 1e-3, 0.1)
    c = found.constants
    got = (c.warp, c.fill, c.nu_fill, c.nu_warp, c.shear)
    np.testing.assert_allclose(got, (800, 640, 0.24, 0.24 * 0.8, 24.0), rtol=1e-5)
    assert found.rms < 1e-7 and found.shear == (24.0, 24.0)


def test_what_is_lost_of_a_bent_law_is_told_by_ratio():
    found = constants_of_law(BENT, THICKNESS, 2.0, 25.0, 0.1)
    assert list(found.lost) == list(RATIOS)
    assert 0.005 < min(found.lost.values()) and max(found.lost.values()) < 0.1
    assert found.rms == pytest.approx(np.sqrt(np.mean(np.square(list(found.lost.values())))))
    assert 1.0 < found.largest["1:0"] < 5.0
    assert len(found.others) == 10 and found.evaluation.options == Options()
    bent = HypoelasticLaw([0, 0, 100.0, 30, *BENT.beta[4:]], 0.24, [0.07, 0.07, 0.1])
    own = constants_of_law(bent, THICKNESS, 2.0, 25.0, 0.1)
    assert own.constants.shear == pytest.approx(THICKNESS * 35.0)
    assert own.shear == pytest.approx((THICKNESS * 30.0, THICKNESS * 40.0))


def test_loads_that_a_law_does_not_carry_are_refused():
    complaint_with(["increase", "5 to 2"], constants_of_law, BENT, THICKNESS, 5.0, 2.0, 0.1)
    falling = HypoelasticLaw([0, 0, 0, 30, 0, 0, -8e3, 600, 0, 0, -8e3, 600], 0.2, [0.08] * 3)
    complaint_with(["carries no more", "lower"], constants_of_law, falling, THICKNESS, 0, 90, 0.1)


LINEAR = MaterialCard(HypoelasticLaw.linear(1000.0, 800.0, 30.0, 0.24), 0.8, "linear")
CARD = MaterialCard(BENT, 0.8, "bent")


def text_of(name, card=LINEAR, **options):
    made = FORMATS[name].export(card, **options)
    ((_, text),) = made.files.items()
    return text, made.says


def fields_of(text: str) -> dict[str, float]:
    rows = [line for line in text.splitlines() if line and not line.startswith("#")]
    return {row[:34].strip(): float(row[34:48]) for row in rows}


def test_gsa_is_told_stiffnesses_per_width_and_the_fill_s_contraction():
    text, says = text_of("gsa", highest=1e-2)
    found = fields_of(text)
    names = ["Warp modulus", "Weft modulus", "Poisson's ratio (warp-weft)", "Shear modulus"]
    assert list(found) == names
    np.testing.assert_allclose(list(found.values()), [800, 640, 0.24, 24], rtol=1e-4)
    assert "Poisson" in says.confirm[0]
    # RFEM is told stresses of the thickness.
    found = fields_of(text_of("rfem", highest=1e-2)[0])
    np.testing.assert_allclose(list(found.values()), [1000, 800, 0.24, 0.192, 30, 0.8], rtol=1e-4)


def test_the_table_holds_every_choice_and_both_forms():
    text, says = text_of("constants", CARD, lowest=2.0, highest=20.0, paths="10", minimise="load")
    table = pd.read_csv(io.StringIO(text), comment="#")
    assert list(table.chosen.fillna("")) == ["yes"] + 10 * [""]
    one = table.iloc[0]
    assert (one.minimise, one.reciprocal, one.unloaded_yarns, one.paths) == (
        "load", "yes", "yes", 10,
    )  # fmt: skip
    across = one.A_warp_fill_kN_per_m
    c = np.linalg.inv([[one.A_warp_kN_per_m, across], [across, one.A_fill_kN_per_m]])
    assert 1 / c[0, 0] == pytest.approx(one.E_warp_kN_per_m, rel=1e-7)
    assert -c[0, 1] / c[1, 1] == pytest.approx(one.nu_warp, rel=1e-6)
    assert one.G_kN_per_m == pytest.approx(24.0)
    words = " ".join(says.carries + says.loses)
    for said in ("2 to 20 kN/m", "loads", "10 paths", "RMS", "choices"):
        assert said in words


def test_loads_end_where_the_card_does_unless_they_are_said():
    _, says = text_of("constants", CARD)
    end = float(says.carries[0].split(" to ")[1].split()[0])
    shares = {"1:1": (1, 1), "2:1": (1, 0.5), "1:2": (0.5, 1), "1:0": (1, 0), "0:1": (0, 1)}
    reached = [
        biaxial_response(BENT, [[end * a, end * b]], 0.8).strain.max() for a, b in shares.values()
    ]
    assert max(reached) == pytest.approx(0.07, rel=2e-3)
    complaint_with(["--highest", "valid_strain"], FORMATS["constants"].export, LINEAR)
    complaint_with(["increase"], FORMATS["gsa"].export, CARD, lowest=5.0, highest=2.0)


def test_what_a_card_does_not_know_of_the_shear_is_said():
    blind = MaterialCard(HypoelasticLaw(BENT.beta, 0.24, [0.07, 0.07, 1e-6]), 0.8, "biaxial only")
    for name in ("constants", "gsa", "rfem", "radioss-law58"):
        assert "sheared the fabric" in " ".join(text_of(name, blind)[1].loses), name
        assert "sheared the fabric" not in " ".join(text_of(name, CARD)[1].loses), name
    # Coupled so strongly that both contractions multiply to more than one.
    law = HypoelasticLaw.linear(100.0, 99.9, 30.0, 0.99)
    found = FORMATS["gsa"].export(MaterialCard(law, 0.8, ""), highest=1e-3)
    assert fields_of(found.files[".txt"])["Poisson's ratio (warp-weft)"] < 1.0


def cards_of(text: str) -> list[list[float]]:
    """The numbers of the rows below the title: columns of 20, N1 and N2 of 10."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines[0] == "/MAT/LAW58/1" and all(len(row) <= 100 for row in lines)
    found = []
    for row in lines[2:]:
        widths = [10, 10, 20, 20, 20, 20] if row[9] == "1" else [20] * 5
        ends = np.cumsum([0, *widths]).tolist()
        cells = [row[i:j].strip() for i, j in pairwise(ends)]
        found.append([float(cell) for cell in cells if cell])
    return found


def softening(slope: float) -> MaterialCard:
    beta = [0, 0, 0, 30, 0, 0, slope, 600, 0, 0, slope, 900]
    return MaterialCard(HypoelasticLaw(beta, 0.0, [0.07, 0.07, 0.1]), 0.8, "soft")


def test_law58_has_the_yarns_moduli_and_softening():
    card = softening(-4e3)
    text, says = text_of("radioss-law58", card)
    rows = cards_of(text)
    for pulled in (0, 1):
        modulus, b = rows[1][2 * pulled], rows[1][2 * pulled + 1]
        strain, stress = uniaxial_curve(card.law, pulled, np.linspace(0, 0.07, 30), "nominal")
        off = modulus * strain - 0.5 * b * strain**2 - stress
        assert b > 0 and np.abs(off).max() < 0.01 * stress.max()
    assert rows[0] == [1e-9] and rows[1][4] == 1e-3
    assert rows[4] == [1, 1, 1e-4, 1e-4, 1e-3, 1e-3]
    g0, gt, lock = rows[2][:3]
    assert 0 < g0 < gt
    angle, tau, _ = trellis_curve(card.law, np.linspace(0, math.radians(lock), 40), "nominal")
    np.testing.assert_allclose(g0 * np.tan(angle), tau, atol=0.03 * tau.max())
    # Beyond the locking angle the slope over tan(a) is the same.
    assert gt / (1 + math.tan(math.radians(lock)) ** 2) == pytest.approx(g0)
    assert "stiffening" not in " ".join(says.loses) and "density" in " ".join(says.loses)


def test_a_yarn_that_stiffens_has_no_negative_softening_and_it_is_said():
    text, says = text_of("radioss-law58", softening(4e3), density=1.2e-9)
    rows = cards_of(text)
    assert rows[1][1] == 0 and rows[1][3] == 0 and rows[0] == [1.2e-9]
    assert "stiffening along warp and fill" in " ".join(says.loses)
    x = np.linspace(0, 0.1, 20)
    straight = yarn_of(x, 500 * x + 2000 * x**2)
    assert straight.stiffens and 500 < straight.modulus < 700 and straight.off > 0.01
    bent = yarn_of(x, 500 * x - 2000 * x**2)
    assert (bent.modulus, bent.softening) == (pytest.approx(500), pytest.approx(4000))


T = 0.8


def test_small_loads_give_the_strains_of_orthotropic_elasticity():
    law = HypoelasticLaw.linear(1000.0, 800.0, 30.0, 0.24)
    loads = 1e-6 * np.array([[3.0, 2.0]])
    strain = biaxial_response(law, loads, T).strain[0] / 1e-6
    wanted = np.array([3.0 / 1000 - 0.24 * 2.0 / 1000, 2.0 / 800 - 0.24 * 3.0 / 1000]) / T
    np.testing.assert_allclose(strain, wanted, rtol=1e-5)


@pytest.mark.parametrize("name", ["cubic", "incompressible", "tri-linear", "spline"])
@pytest.mark.parametrize("pulled", [0, 1])
def test_a_load_along_one_yarn_is_a_strip(name, pulled):
    law, ends = LAWS[name], np.linspace(0, 0.1, 41)[1:]
    strain, stress = uniaxial_curve(law, pulled, ends, "nominal")
    loads = np.zeros((len(ends), 2))
    loads[:, pulled] = stress * T
    found = biaxial_response(law, loads, T)
    assert found.reached == len(ends)
    np.testing.assert_allclose(found.elongation[:, pulled], strain, rtol=2e-5)


@pytest.mark.parametrize("change", ["constant", "incompressible"])
def test_loads_are_forces_over_the_width_before_the_test(change):
    law = HypoelasticLaw(BENT.beta, 0.24, BENT.strain_range, change)
    loads = np.outer(np.linspace(1, 30, 10), [1.0, 0.6])
    found = biaxial_response(law, loads, T)
    stretch = np.exp(found.strain)
    thickness = T if change == "constant" else T / stretch.prod(axis=1)
    across = stretch[:, ::-1]
    force = found.stress * across * np.reshape(thickness, (-1, 1))
    np.testing.assert_allclose(force, loads, rtol=1e-11)


moduli = st.floats(200.0, 2000.0)


@settings(max_examples=25, deadline=None)
@given(
    e=st.tuples(moduli, moduli, moduli, moduli),
    nu=st.floats(0.01, 0.4),
    ratio=st.tuples(st.floats(0.0, 1.0), st.floats(0.1, 1.0)),
    change=st.sampled_from(["constant", "incompressible"]),
)
def test_derivatives_by_beta_and_nu12_are_those_of_differences(e, nu, ratio, change):
    beta = np.zeros(12)
    beta[[3, 7, 6, 11, 10]] = 30.0, e[0], 10 * (e[1] - e[0]), e[2], 10 * (e[3] - e[2])
    loads = np.outer(np.linspace(1, 15, 6), ratio)

    def law(b=beta, n=nu):
        return HypoelasticLaw(b, n, [0.1, 0.1, 0.1], change)

    names = ("beta_6", "beta_7", "beta_10", "beta_11", "nu12", "beta_3", "thickness")
    found = biaxial_response(law(), loads, T, names)
    if found.reached < len(loads):
        return

    def check(j, step, at, room, floor=0.0):
        ahead, behind = (biaxial_response(*at(s)).strain for s in (step, -step))
        slope = (ahead - behind) / (2 * step)
        np.testing.assert_allclose(
            found.slope[:, :, j], slope, atol=room * abs(slope).max() + floor
        )

    for j, place in enumerate((6, 7, 10, 11)):
        one = np.eye(12)[place]
        check(j, 1e-3, lambda s, one=one: (law(beta + s * one), loads, T), 2e-7, 2e-12)
    check(4, 1e-6, lambda s: (law(n=nu + s), loads, T), 1e-6)
    assert (found.slope[:, :, 5] == 0).all()  # there is no shear
    check(6, 1e-6, lambda s: (law(), loads, T + s), 1e-6)


def test_many_increments_change_nothing_but_by_the_coupling():
    few, many = (np.outer(np.linspace(0, 30, n + 1)[1:], [1.0, 0.5]) for n in (7, 700))
    ends = [biaxial_response(BENT, loads, T).strain[-1] for loads in (few, many)]
    np.testing.assert_allclose(*ends, rtol=1e-4)
    # Unloading goes back the same way.
    up = np.outer(np.linspace(0, 30, 31)[1:], [1.0, 0.5])
    found = biaxial_response(BENT, np.concatenate([up, up[-2::-1]]), T).strain
    np.testing.assert_allclose(found[-1], found[0], atol=2e-6)


def test_where_the_law_softens_there_is_no_equilibrium():
    falling = HypoelasticLaw([0, 0, 0, 30, 0, 0, -8e3, 600, 0, 0, -8e3, 600], 0.2, [0.08] * 3)
    loads = np.outer(np.linspace(1, 60, 60), [1.0, 1.0])
    found = biaxial_response(falling, loads, T)
    assert 10 < found.reached < 60
    assert np.isfinite(found.strain[: found.reached]).all()
    assert np.isnan(found.strain[found.reached :]).all()


def test_an_even_stretch_is_unstable_where_the_stress_is_more_than_an_uneven_one_adds():
    """To first order an uneven stretch adds C11 - C12 = E / (1 + nu), and the stress takes it."""
    e, nu = 100.0, 0.6
    law = HypoelasticLaw.linear(e, e, 5.0, nu)
    loads = np.outer(np.linspace(1, 110, 110), [1.0, 1.0])
    found = biaxial_response(law, loads, T)
    assert found.reached == len(loads)
    stable = found.stress[:, 0] < e / (1 + nu)
    assert 20 < stable.sum() < 90
    np.testing.assert_array_equal(found.stable, stable)
    assert biaxial_response(BENT, np.outer([5.0, 30.0], [1.0, 1.0]), T).stable.all()
