"""Laws that know both loads: moduli by their ratio, yarns that exchange crimp; closed forms."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.card import MaterialCard, certainty_of, read_card
from bubblefit.materials.closed_path import closed_path
from bubblefit.materials.deformation_curves import bar
from bubblefit.materials.forms.base import EVEN, form_named
from bubblefit.materials.forms.polynomial import LoadRatio
from bubblefit.materials.forms.ratio import SplineCrimp
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw, definite_rows
from bubblefit.materials.memory import Memory
from bubblefit.materials.modulus_tables import piece_constants
from bubblefit.materials.point_law import RIGHT, load_angle
from bubblefit.materials.positivity import is_positive
from bubblefit.solvers.base import check_carries
from bubblefit.solvers.exports import FORMATS
from bubblefit.solvers.registry import solver_named
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from ...support.refusals import complaint
from .test_forms import follow

NU = 0.24
#: MPa: G12, E2 at 1:1 and its gain, E1 at 1:1 and its gain.
BETA = (30.0, 800.0, 400.0, 1000.0, -300.0)
RATIOS = ((1, 0), (0, 1), (1, 1), (2, 1), (1, 2), (5, 1))


def law_of(beta=BETA, nu=NU):
    return HypoelasticLaw(np.array(beta, dtype=float), nu, form=LoadRatio())


def moduli(beta, share):
    _, fill, fill_gain, warp, warp_gain = beta
    gamma = np.array(share) / np.hypot(*share) - 1 / np.sqrt(2)
    return warp + warp_gain * gamma[0], fill + fill_gain * gamma[1]


def compliance(beta, share):
    e1, e2 = moduli(beta, share)
    return np.array([[1 / e1, -NU / e1], [-NU / e1, 1 / e2]])


gains = st.floats(-350.0, 350.0)
angles = st.floats(0.0, RIGHT)


@settings(max_examples=60, deadline=None)
@given(gains, gains, angles, st.integers(1, 5))
def test_a_proportional_path_has_the_moduli_of_its_ratio(fill_gain, warp_gain, angle, increments):
    """Strain is the compliance of the ratio times the stress, in any number of increments."""
    beta = (30.0, 500.0, fill_gain, 700.0, warp_gain)
    share = np.array([np.cos(angle), np.sin(angle)])
    strain = [*(20.0 * compliance(beta, share) @ share), 0.0]
    stress = follow(law_of(beta), np.outer(np.linspace(0.0, 1.0, increments + 1), strain))
    np.testing.assert_allclose(stress[:2], 20.0 * share, atol=1e-11)


def test_ratios_are_of_tension_and_go_on_where_yarns_are_pressed():
    for a, b in ((3.0, 1.0), (1.0, 2.0)):
        assert load_angle(a, b)[0] == pytest.approx(np.arctan2(b, a), rel=1e-15)
    assert load_angle(0.0, 0.0) == (RIGHT / 2, 0.0, 0.0)
    assert load_angle(5.0, -1.0) == load_angle(5.0, -9.0) == (0.0, 0.0, 0.0)
    assert load_angle(-2.0, 1.0) == (RIGHT, 0.0, 0.0)
    # Both pressed: the one that is pressed less is that which carries; no jump on the way there.
    assert load_angle(-1.0, -3.0)[0] == pytest.approx(np.arctan2(1.0, 3.0))
    turn = np.linspace(0.0, 2 * np.pi, 4001)[1:-1]
    assert np.abs(np.diff([load_angle(np.cos(t), np.sin(t))[0] for t in turn])).max() < 2e-3


@pytest.mark.parametrize("stress", [(3.0, 1.0), (-1.0, -3.0), (2.0, -1.0)])
def test_derivatives_of_the_ratio(stress):
    ends = [[load_angle(*(stress + s * by))[0] for s in (1, -1)] for by in 1e-6 * np.eye(2)]
    by = [(ahead - behind) / 2e-6 for ahead, behind in ends]
    assert load_angle(*stress)[1:] == pytest.approx(by, abs=1e-9)
    # Without stress it begins at equal loads; without gains it is the constant law.
    none, known = np.zeros(3), HypoelasticLaw.linear(1000.0, 800.0, 30.0, NU)
    _, tangent = law_of().increment(none, none, none)
    np.testing.assert_allclose(tangent, known.increment(none, none, none)[1], rtol=1e-14)
    rng = np.random.default_rng(1)
    path = (*rng.normal(0.0, 0.03, (2, 50, 3)), rng.normal(0.0, 20.0, (50, 3)))
    flat = law_of((30.0, 800.0, 0.0, 1000.0, 0.0))
    for a, b in zip(flat.increment(*path), known.increment(*path), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_yarn_that_is_pressed_beside_a_pulled_one_counts_as_one_without_load():
    known = HypoelasticLaw.linear(*moduli(BETA, (1, 0)), 30.0, NU)
    new, none = np.array([[0.02, -0.02, 0.0]]), np.zeros((1, 3))
    stress, _ = law_of().increment(none, new, none)
    assert stress[0, 1] < 0
    np.testing.assert_allclose(stress, known.increment(none, new, none)[0], rtol=1e-12)


def along(increments):
    """Warp first, then the fill while the warp is let go: nowhere in proportion."""
    share = np.linspace(0.0, 1.0, increments + 1)[1:, None]
    return np.concatenate([share * [20.0, 5.0], [20.0, 5.0] + share * [-10.0, 20.0]])


def test_the_error_goes_with_the_square_of_the_increment():
    ends = {n: biaxial_response(law_of(), along(n), 1.0).strain[-1] for n in (4, 8, 16, 32, 1024)}
    off = [np.abs(ends[n] - ends[1024]).max() for n in (4, 8, 16, 32)]
    orders = np.log2(np.array(off[:-1]) / off[1:])
    assert (orders > 1.9).all() and (orders < 2.1).all()
    assert off[1] < 5e-4 * ends[1024].max()


def slope(law, old, new, stress, step):
    """Differences of the stress after an increment by its strains at the end."""
    ends = [[law.increment(old, new + s, stress)[0][0] for s in (by, -by)]
            for by in step * np.eye(3)]  # fmt: skip
    return np.transpose([(up - down) / (2 * step) for up, down in ends])


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_tangent(seed):
    rng = np.random.default_rng(seed)
    old = rng.normal(0.0, 0.02, 3)
    new, stress = old + rng.normal(0.0, 0.02, 3), rng.normal(0.0, 10.0, 3)
    law = law_of((30.0, 800.0, rng.uniform(-400, 400), 1000.0, rng.uniform(-400, 400)))
    after, tangent = law.increment(old, new, stress)
    if np.abs(0.5 * (stress + after[0])[:2]).min() < 1e-3:  # the ratio has a kink there
        return
    # Near the kink stress bends within some 1e-5 of strain: the error of second order is taken out.
    near, nearer = (slope(law, old, new, stress, step) for step in (2e-7, 1e-7))
    found = (4 * nearer - near) / 3
    np.testing.assert_allclose(tangent[0], found, rtol=1e-6, atol=1e-3)


def test_it_is_refused_where_a_modulus_is_not_positive_at_some_ratio():
    falling = law_of((30.0, 800.0, 0.0, 1000.0, 1500.0))  # E1 < 0 where the warp carries little
    assert falling.modulus("E1", 0.0) == 1000.0
    assert falling.modulus("E1", 0.0, 0.0) == pytest.approx(1000.0 - 1500.0 * EVEN)
    assert is_positive(law_of()) and not is_positive(falling)
    MaterialCard(law_of(), 0.8)
    assert "E1 is -60.66 MPa" in complaint(MaterialCard, falling, 0.8)
    along_fill = np.array([[0.0, 10.0]])
    assert biaxial_response(falling, along_fill, 0.8).reached == 0
    assert biaxial_response(falling, along_fill[:, ::-1], 0.8).reached == 1


def test_where_it_is_definite_in_a_pull_along_either_yarn():
    nu = 0.9
    beta = np.array([30.0, 800.0, 0.0, 1000.0, 800.0])
    rows = definite_rows(LoadRatio(), nu, [0.1, 0.1, 0.1])
    assert 1000.0 > 1.02 * nu**2 * 800.0  # at equal loads
    none = np.array([1000.0 - 800.0 * EVEN])
    assert none < 1.02 * nu**2 * 800.0  # in a pull along the fill
    assert (rows @ beta).min() == pytest.approx(none[0] - 1.02 * nu**2 * 800.0)
    assert (rows @ [30.0, 800.0, 0.0, 1000.0, 0.0]).min() > 0


def test_what_knows_strain_alone_refuses_it_in_one_line():
    card = MaterialCard(law_of(), 0.8, "ratio")
    carry = {"constants", "gsa", "rfem", "calculix"}
    assert {f.name for f in FORMATS.values() if f.load_ratios} == carry
    for one in FORMATS.values():
        if one.load_ratios:
            loads = {} if one.name == "calculix" else {"lowest": 0.5, "highest": 10.0}
            assert one.export(card, **loads).files
        else:
            assert complaint(one.export, card).startswith("form: ")
    assert "solvers membrane" in complaint(piece_constants, card.law)
    for name in ("membrane", "calculix"):
        check_carries(solver_named(name), card.law)
    assert "marc" in complaint(check_carries, solver_named("marc"), card.law)


FORM = SplineCrimp.at([[0.0, 0.06, 0.12]] * 3)
#: MPa: G12, E2 and E1 at three knots; T1, T2 and S.
CRIMP = np.array([20.0, 25.0, 30.0, 300.0, 250.0, 400.0, 500.0, 450.0, 600.0, 1.5, 2.5, 12.0])
STIFF = np.array([20.0] * 3 + [300.0] * 3 + [500.0] * 3 + [1.5, 2.5, 12.0])


def crimped(beta=CRIMP, nu=0.2):
    return HypoelasticLaw(np.array(beta, dtype=float), nu, [0.12] * 3, form=FORM)


def lengthened(stress, beta=CRIMP):
    """Strain of the crimp alone: slopes after the exchange, in which the crossings balance."""
    *_, t1, t2, bed = beta
    r = np.array([t1, t2]) / bed
    w = (r @ (stress * [1, -1])) / (bed + stress.sum())
    after = r + w * np.array([-1, 1])
    assert stress @ (after * [1, -1]) == pytest.approx(bed * w)
    return r**2 - after**2


@settings(max_examples=50, deadline=None)
@given(st.floats(0.0, 60.0), st.floats(0.0, 60.0), st.integers(1, 4))
def test_strain_is_that_of_the_yarns_and_of_their_slopes(warp, fill, increments):
    """Check it for constant moduli in any number of increments, on any path."""
    stress = np.array([warp, fill])
    compliance = np.array([[1 / 500, -0.2 / 500], [-0.2 / 500, 1 / 300]])
    strain = np.array([*(compliance @ stress + lengthened(stress)), 0.0])
    way = np.outer(np.linspace(0.0, 1.0, increments + 1), strain)
    way[1:-1] += np.random.default_rng(increments).normal(0.0, 0.01, (increments - 1, 3))
    np.testing.assert_allclose(follow(crimped(STIFF), way)[:2], stress, atol=1e-8)


def test_a_yarn_pulled_alone_gains_what_it_has_and_two_stiffen_each_other():
    _, stress = bar(crimped(), 1, np.linspace(0.0, 0.1, 40)[1:])
    np.testing.assert_allclose(stress[:, 0], 0.0, atol=1e-9)
    gained = lengthened(stress[-1, :2])
    assert 0 < gained[1] < (2.5 / 12.0) ** 2 and gained[0] < 0
    alone = biaxial_response(crimped(), [[0.0, 5.0]], 1.0).strain[-1, 1]
    assert biaxial_response(crimped(), [[5.0, 5.0]], 1.0).strain[-1, 1] < 0.7 * alone
    none = crimped([*CRIMP[:-3], 1e-9, 1e-9, 12.0])
    plain = HypoelasticLaw(CRIMP[:-3], 0.2, [0.12] * 3, form=Spline(FORM.knots))
    path = np.random.default_rng(1).normal(0.0, 0.02, (6, 3))
    np.testing.assert_allclose(follow(none, path), follow(plain, path), rtol=1e-7)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_tangent_also_where_yarns_are_pressed(seed):
    rng = np.random.default_rng(seed)
    old = rng.normal(0.0, 0.02, 3)
    new, stress = old + rng.normal(0.0, 0.02, 3), rng.normal(3.0, 12.0, 3)
    _, tangent = crimped().increment(old, new, stress)

    near, nearer = (slope(crimped(), old, new, stress, step) for step in (1e-6, 5e-7))
    if np.abs(near - nearer).max() < 1e-4 * np.abs(near).max():  # no kink between
        np.testing.assert_allclose(tangent[0], near, rtol=1e-5, atol=0.02)


def test_the_crimp_of_a_closed_path_of_stress_returns():
    corners = [(0, 0), (20, 0), (20, 30), (0, 30), (0, 0)]
    shares = np.linspace(0.0, 1.0, 50)[1:, None]
    way = np.vstack([a + (np.subtract(b, a)) * shares for a, b in pairwise(corners)])
    flat = crimped(STIFF, 0.0)
    end = biaxial_response(flat, way + 1e-12, 1.0).strain[-1]
    np.testing.assert_allclose(end, 0.0, atol=1e-6)


def test_cards_bounds_and_what_has_no_crimp(tmp_path):
    MaterialCard(crimped(), 0.8, "crimp").write(tmp_path / "card.toml", "MPa")
    back = read_card(tmp_path / "card.toml").law
    assert back.form == FORM and is_positive(back) and back.of_load_ratio
    assert not is_positive(crimped([*CRIMP[:-3], -1.5, 2.5, 12.0]))
    drawn = CRIMP + np.random.default_rng(1).normal(0.0, 0.1, (50, 12)) * (np.arange(12) > 8)
    sure = certainty_of(crimped(), drawn)
    assert np.sqrt(np.diag(sure.covariance)[9:]) == pytest.approx(0.1, rel=0.3)
    assert all(
        min(law.coupling[3:]) > 0 for law in sure.laws(crimped(), 20, np.random.default_rng(1))
    )
    np.testing.assert_allclose(back.coupling, [0.2, 0.0, 0.0, 1.5, 2.5, 12.0])
    assert form_named("spline-crimp", {"knots": 3}, [0.1] * 3).size == 12
    assert FORM.own_rows("S").shape == (3, 12)
    assert (FORM.own_rows("S") @ CRIMP == [12.0, 9.0, 7.0]).all()
    memory = Memory((0.1,) * 3, (1.5,) * 3)
    assert complaint(HypoelasticLaw, CRIMP, form=FORM, memory=memory).startswith("memory: ")


def test_the_work_of_a_closed_path(tmp_path):
    """Closed form of E1 constant, E2 = c + k eps2: a^2 (D11(b) - D11(0)) / 2 + a (b D12(b) - int
    D12); none without coupling, of constants, and of crimp alone."""
    a, b, nu, e1, c, k = 0.1, 0.08, 0.3, 500.0, 200.0, 4000.0
    beta = np.zeros(12)
    beta[[3, 6, 7, 11]] = 20.0, k, c, e1

    def d11(x):
        return e1 / (1 - nu**2 * (c + k * x) / e1)

    def d12(x):
        return nu * (c + k * x) / (1 - nu**2 * (c + k * x) / e1)

    exact = a**2 / 2 * (d11(b) - d11(0)) + a * (b * d12(b) - quad(d12, 0, b)[0])
    law = HypoelasticLaw(beta, nu, [0.2] * 3)
    found = closed_path(law, (a, b), increments=400)
    assert found.work == pytest.approx(exact, rel=1e-5) and 0.01 < found.share < 1
    assert closed_path(law, (a, b)).work == pytest.approx(exact, rel=1e-3)
    for none in (replace(law, nu12=0.0), HypoelasticLaw.linear(e1, c, 20.0), crimped(STIFF)):
        assert abs(closed_path(none, (a, b), 400).share) < 2e-5
    assert abs(closed_path(crimped()).share) > 1e-3
    card = MaterialCard(law, 0.8)
    card.write(tmp_path / "card.toml")
    assert card.closed_path.ends == (0.2, 0.2)
    assert card.closed_path.words in (tmp_path / "card.toml").read_text()


TURNING = np.array([[5.0, 1], [10, 3], [12, 8], [12, 12], [6, 12], [2, 8]])
#: Law, its beta, nu12, loads, step of beta and of others, room, and entries that move nothing.
HISTORIES = (
    (law_of, np.array(BETA), NU, np.concatenate([along(3), [[10.0, 1.0], [2.0, 8.0]]]),
     (1e-2, 1e-6), (1e-7, 1e-13), {"beta_0"}),
    (crimped, CRIMP, 0.2, TURNING, (1e-3, 1e-5), (1e-6, 1e-12), {"beta_0", "beta_1", "beta_2"}),
)  # fmt: skip


@pytest.mark.parametrize(
    ("case", "name"),
    [(case, name) for case in HISTORIES
     for name in (*(f"beta_{i}" for i in range(len(case[1]))), "nu12", "thickness")],
)  # fmt: skip
def test_derivatives_of_a_patch_through_its_history(case, name):
    make, beta, nu, loads, steps, (share, least), none = case
    step = steps[not name.startswith("beta")]

    def strain(by):
        moved = beta + by * np.array([name == f"beta_{i}" for i in range(len(beta))])
        law = make(moved, nu + by * (name == "nu12"))
        return biaxial_response(law, loads, 0.8 + by * (name == "thickness")).strain

    found = biaxial_response(make(), loads, 0.8, [name])
    assert found.reached == len(loads)
    slope = (strain(step) - strain(-step)) / (2 * step)
    room = share * np.abs(slope).max() + least
    np.testing.assert_allclose(found.slope[..., 0], slope, atol=room)
    assert (np.abs(slope).max() > 0) == (name not in none)
