"""Designers' constants, their exports, and biaxial responses."""

import dataclasses
import io
import math
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.deformation_curves import trellis_curve, uniaxial_curve
from bubblefit.materials.designers import (
    RATIOS,
    SHARES,
    DesignersConstants,
    Options,
    constants_of_law,
    evaluate,
    every_option,
    line_of,
    shares,
)
from bubblefit.materials.exports.curves import yarn_of
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.exports import FORMATS
from hypothesis import given, settings
from hypothesis import strategies as st

from ..builders.biaxial_tests import BENT_LAW, THICKNESS
from ..builders.fortran import LAWS
from ..support.refusals import complaint_with
from .test_exports import few_points

#: Published for a glass/PTFE fabric with free Poisson's ratios (test T2, 2 to 30 kN/m).
FREE = DesignersConstants(1188.0, 864.0, 0.73, 0.69)
FALLING = HypoelasticLaw([0, 0, 0, 30, 0, 0, -8e3, 600, 0, 0, -8e3, 600], 0.2, [0.08] * 3)
RECIPROCAL = DesignersConstants.of_stiffness([[1000.0, 400.0], [400.0, 800.0]])


def paths(constants, ratios=RATIOS, offset=0.0):
    loads = {ratio: np.outer(np.linspace(2, 30, 15), shares(ratio)) for ratio in ratios}
    return [line_of(r, load, constants.strain(load) + offset) for r, load in loads.items()]


def test_the_direct_form_is_the_inverse_of_the_other():
    c = RECIPROCAL
    got = (c.warp, c.fill, c.nu_warp, c.nu_fill)
    np.testing.assert_allclose(got, (800.0, 640.0, 0.4, 0.5), rtol=1e-9)
    np.testing.assert_allclose(c.stiffness, [[1000, 400], [400, 800]], rtol=1e-12)
    np.testing.assert_allclose(c.compliance @ c.stiffness, np.eye(2), atol=1e-12)
    assert c.reciprocal and c.stable and not FREE.reciprocal and FREE.stable
    # nu_warp is how much the warp contracts when the fill is pulled.
    strain = FREE.strain([[0.0, 10.0], [10.0, 0.0]])
    wanted = [[-0.73 * 10 / 864, 10 / 864], [10 / 1188, -0.69 * 10 / 1188]]
    np.testing.assert_allclose(strain, wanted, rtol=1e-6)


@pytest.mark.parametrize("options", every_option(paths(RECIPROCAL)), ids=str)
def test_every_option_finds_the_constants_of_computed_paths(options):
    found = evaluate(paths(RECIPROCAL, offset=0.013), options)
    np.testing.assert_allclose(four(found.constants), four(RECIPROCAL), rtol=1e-9)
    assert found.squares < 1e-20 and max(found.rms.values()) < 1e-10


def four(constants):
    return dataclasses.astuple(constants)[:4]


@settings(max_examples=40, deadline=None)
@given(*[st.floats(50, 5000)] * 2, *[st.floats(-0.3, 0.9)] * 2)
def test_free_constants_are_found_whatever_they_are(a, b, first, second):
    c = DesignersConstants(a, b, first * np.sqrt(b / a), second * np.sqrt(a / b))
    for options in (Options(True, False), Options(False, False), Options(True, False, "load")):
        found = evaluate(paths(c), options).constants
        np.testing.assert_allclose(four(found), four(c), rtol=1e-9, atol=1e-9)


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

    def squares(constants):
        total = 0.0
        for path in lines:
            own = 100 * (path.strain - constants.strain(path.load))
            total += float((SHARES**2).sum()) * (own[~np.array(path.unloaded)] ** 2).sum()
        return total

    # Least squares: nothing near by leaves less; and the sum is that of its definition.
    best, free = evaluate(lines, Options()), evaluate(lines, Options(reciprocal=False))
    for path in lines:
        off = np.outer(SHARES, 100 * (path.strain - best.constants.strain(path.load)))
        assert best.rms[path.ratio] == pytest.approx(np.sqrt(np.mean(off**2)))
    assert best.squares == pytest.approx(squares(best.constants))
    for step in (np.diag([1e-6, 0]), np.diag([0, 1e-6]), np.array([[0, 1e-6], [1e-6, 0]])):
        for near in (best.constants.compliance + step, best.constants.compliance - step):
            assert squares(DesignersConstants.of_compliance(near)) > best.squares
    assert best.constants.reciprocal and not free.constants.reciprocal
    assert best.squares > free.squares + 0.1


def test_paths_that_settle_no_constants_are_refused():
    unstable = DesignersConstants(1000, 1000, 1.2, 1.1)
    assert not unstable.stable
    for words, call, *values in (
        (["two that differ"], evaluate, paths(FREE, ("1:1",)), Options()),
        (["two that differ"], evaluate, paths(FREE), Options(ratios=("3:1",))),
        (["do not change"], line_of, "1:1", np.ones((3, 2)), np.zeros((3, 2))),
        (["get shorter"], DesignersConstants.of_compliance, -np.eye(2)),
        (["no inverse"], DesignersConstants.of_stiffness, [[1, 2], [2, 1]]),
        (["1.32", "below 1"], lambda: unstable.stiffness),
        (["increase", "5 to 2"], constants_of_law, BENT_LAW, THICKNESS, 5.0, 2.0, 0.1),
        (["carries no more", "lower"], constants_of_law, FALLING, THICKNESS, 0, 90, 0.1),
    ):
        complaint_with(words, call, *values)


def test_what_is_lost_of_a_bent_law_is_told_by_ratio():
    found = constants_of_law(BENT_LAW, THICKNESS, 2.0, 25.0, 0.1)
    assert list(found.lost) == list(RATIOS)
    assert 0.005 < min(found.lost.values()) and max(found.lost.values()) < 0.1
    assert found.rms == pytest.approx(np.sqrt(np.mean(np.square(list(found.lost.values())))))
    assert 1.0 < found.largest["1:0"] < 5.0
    assert len(found.others) == 10 and found.evaluation.options == Options()
    bent = HypoelasticLaw([0, 0, 100.0, 30, *BENT_LAW.beta[4:]], 0.24, [0.07, 0.07, 0.1])
    own = constants_of_law(bent, THICKNESS, 2.0, 25.0, 0.1)
    assert own.constants.shear == pytest.approx(THICKNESS * 35.0)
    assert own.shear == pytest.approx((THICKNESS * 30.0, THICKNESS * 40.0))


LINEAR = MaterialCard(HypoelasticLaw.linear(1000.0, 800.0, 30.0, 0.24), 0.8, "linear")
CARD = MaterialCard(BENT_LAW, 0.8, "bent")


def text_of(name, card=LINEAR, **options):
    made = FORMATS[name].export(card, **options)
    (text,) = made.files.values()
    return text, made.says


def fields_of(text):
    rows = [line for line in text.splitlines() if line and not line.startswith("#")]
    cells = {row[:34].strip(): row[34:].split(maxsplit=1) for row in rows}
    assert all(len(pair) == 2 for pair in cells.values() if pair[0] != "not")
    return {name: float(value) for name, (value, _) in cells.items() if value != "not"}


def test_gsa_is_told_stiffnesses_per_width_and_the_fill_s_contraction():
    text, says = text_of("gsa", highest=1e-2)
    found = fields_of(text)
    names = ["Warp modulus", "Weft modulus", "Poisson's ratio (warp-weft)", "Shear modulus"]
    assert list(found) == names and "Poisson" in says.confirm[0]
    np.testing.assert_allclose(list(found.values()), [800, 640, 0.24, 24], rtol=1e-4)
    found = fields_of(text_of("rfem", highest=1e-2)[0])
    np.testing.assert_allclose(list(found.values()), [1000, 800, 0.24, 0.192, 30, 0.8], rtol=1e-4)
    # Coupled so strongly that both contractions multiply to more than one.
    strong = MaterialCard(HypoelasticLaw.linear(100.0, 99.9, 30.0, 0.99), 0.8, "")
    assert fields_of(text_of("gsa", strong, highest=1e-3)[0])[names[2]] < 1.0


@pytest.mark.parametrize("name", ["gsa", "rfem"])
def test_prestress_and_compensation_stand_beside_the_stiffness(name):
    text, says = text_of(name, highest=1e-2)
    assert text.count("not given") == 4
    assert all(word in " ".join(says.loses) for word in ("prestress", "compensation"))
    given = {"prestress_warp": 2.0, "prestress_fill": 1.5, "kept_warp": 0.4, "kept_fill": -1.2}
    text, says = text_of(name, highest=1e-2, **given)
    found = [*fields_of(text).values()][-6:]
    elastic = [100 * (2 / 800 - 0.24 / 800 * 1.5), 100 * (1.5 / 640 - 0.24 / 800 * 2)]
    np.testing.assert_allclose(found, [2, 1.5, *elastic, 0.4, -1.2], rtol=2e-3)
    assert "not given" not in text and "prestress: a card" not in " ".join(says.loses)
    complaint_with(["--kept-warp, --kept-fill", "both"], text_of, name, highest=1.0, kept_warp=1.0)


def test_the_table_holds_every_choice_and_both_forms():
    text, says = text_of("constants", CARD, lowest=2.0, highest=20.0, paths="10", minimise="load")
    table = pd.read_csv(io.StringIO(text), comment="#")
    assert list(table.chosen.fillna("")) == ["yes"] + 10 * [""]
    one = table.iloc[0]
    chosen = (one.minimise, one.reciprocal, one.unloaded_yarns, one.paths)
    assert chosen == ("load", "yes", "yes", 10)
    across = one.A_warp_fill_kN_per_m
    c = np.linalg.inv([[one.A_warp_kN_per_m, across], [across, one.A_fill_kN_per_m]])
    assert 1 / c[0, 0] == pytest.approx(one.E_warp_kN_per_m, rel=1e-7)
    assert -c[0, 1] / c[1, 1] == pytest.approx(one.nu_warp, rel=1e-6)
    assert one.G_kN_per_m == pytest.approx(24.0)
    words = " ".join(says.carries + says.loses)
    assert all(said in words for said in ("2 to 20 kN/m", "loads", "10 paths", "RMS", "choices"))


def test_loads_end_where_the_card_does_unless_they_are_said():
    _, says = text_of("constants", CARD)
    end = float(says.carries[0].split(" to ")[1].split()[0])
    loads = [[end, end], [end, end / 2], [end / 2, end], [end, 0], [0, end]]
    reached = [biaxial_response(BENT_LAW, [load], 0.8).strain.max() for load in loads]
    assert max(reached) == pytest.approx(0.07, rel=2e-3)
    complaint_with(["--highest", "valid_strain"], FORMATS["constants"].export, LINEAR)
    complaint_with(["increase"], FORMATS["gsa"].export, CARD, lowest=5.0, highest=2.0)


def test_what_a_card_does_not_know_of_the_shear_is_said():
    blind = MaterialCard(
        HypoelasticLaw(BENT_LAW.beta, 0.24, [0.07, 0.07, 1e-6]), 0.8, "biaxial only"
    )
    for name in ("constants", "gsa", "rfem", "radioss-law58"):
        for card in (blind, CARD):
            said = "sheared the fabric" in " ".join(
                text_of(name, card, **few_points(name))[1].loses
            )
            assert said == (card is blind), name


def cards_of(text):
    """The numbers of the rows below the title: columns of 20, N1 and N2 of 10."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines[0] == "/MAT/LAW58/1" and all(len(row) <= 100 for row in lines)
    found = []
    for row in lines[2:]:
        ends = np.cumsum([0, 10, 10, *[20] * 4] if row[9] == "1" else [0, *[20] * 5])
        cells = [row[i:j].strip() for i, j in pairwise(ends)]
        found.append([float(cell) for cell in cells if cell])
    return found


def softening(slope):
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
    law = HypoelasticLaw(BENT_LAW.beta, 0.24, BENT_LAW.strain_range, change)
    loads = np.outer(np.linspace(1, 30, 10), [1.0, 0.6])
    found = biaxial_response(law, loads, T)
    stretch = np.exp(found.strain)
    thickness = T if change == "constant" else T / stretch.prod(axis=1)
    force = found.stress * stretch[:, ::-1] * np.reshape(thickness, (-1, 1))
    np.testing.assert_allclose(force, loads, rtol=1e-11)


@settings(max_examples=25, deadline=None)
@given(
    e=st.tuples(*[st.floats(200.0, 2000.0)] * 4),
    nu=st.floats(0.01, 0.4),
    ratio=st.tuples(st.floats(0.0, 1.0), st.floats(0.1, 1.0)),
    change=st.sampled_from(["constant", "incompressible"]),
)
def test_derivatives_by_beta_and_nu12_are_those_of_differences(e, nu, ratio, change):
    beta = np.zeros(12)
    beta[[3, 7, 6, 11, 10]] = 30.0, e[0], 10 * (e[1] - e[0]), e[2], 10 * (e[3] - e[2])
    loads = np.outer(np.linspace(1, 15, 6), ratio)
    names = ("beta_6", "beta_7", "beta_10", "beta_11", "nu12", "thickness", "beta_3")

    def response(moved, name=""):
        entry = np.array([f"beta_{i}" == name for i in range(12)])
        law = HypoelasticLaw(
            beta + moved * entry, nu + moved * (name == "nu12"), [0.1, 0.1, 0.1], change
        )
        return biaxial_response(law, loads, T + moved * (name == "thickness"), names)

    found = response(0.0)
    if found.reached < len(loads):
        return
    for j, name in enumerate(names[:-1]):
        of_beta = name.startswith("beta")
        step, room, floor = (1e-3, 2e-7, 2e-12) if of_beta else (1e-6, 1e-6, 0.0)
        slope = (response(step, name).strain - response(-step, name).strain) / (2 * step)
        atol = room * abs(slope).max() + floor
        np.testing.assert_allclose(found.slope[:, :, j], slope, atol=atol, err_msg=name)
    assert (found.slope[:, :, -1] == 0).all()  # there is no shear


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
    assert biaxial_response(BENT_LAW, np.outer([5.0, 30.0], [1.0, 1.0]), T).stable.all()


def test_a_line_goes_by_least_squares_and_tells_what_it_leaves():
    load = np.outer(np.linspace(2, 12, 11), [1.0, 0.5])
    wave = 1e-4 * np.cos(np.pi * np.arange(11))
    line = line_of("2:1", load, FREE.strain(load) + np.column_stack([wave, 0 * wave]))
    np.testing.assert_allclose(line.load, [10.0, 5.0])
    np.testing.assert_allclose(line.strain, FREE.strain([[10.0, 5.0]])[0], atol=2e-6)
    np.testing.assert_allclose(line.residual, [1e-4, 0.0], rtol=0.02, atol=1e-15)
    assert line.unloaded == (False, False) and paths(FREE, ("1:0",))[0].unloaded == (False, True)
