"""Yarns that exchange crimp: the geometry, its potential, derivatives, and what carries it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from bubblefit.materials.card import MaterialCard, certainty_of, positive, read_card
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.forms.ratio import SplineCrimp
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.memory import Memory
from bubblefit.materials.responses import bar, biaxial_response, closed_path
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from ...complaints import complaint
from .test_forms import follow

FORM = SplineCrimp.at([[0.0, 0.06, 0.12]] * 3)
#: MPa: G12, E2 and E1 at three knots; T1, T2 and S.
BETA = np.array([20.0, 25.0, 30.0, 300.0, 250.0, 400.0, 500.0, 450.0, 600.0, 1.5, 2.5, 12.0])
STIFF = np.array([20.0] * 3 + [300.0] * 3 + [500.0] * 3 + [1.5, 2.5, 12.0])


def law_of(beta=BETA, nu=0.2):
    return HypoelasticLaw(np.array(beta, dtype=float), nu, [0.12] * 3, form=FORM)


def lengthened(stress, beta=BETA):
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
    """Of constant moduli in any number of increments, on any path."""
    stress = np.array([warp, fill])
    compliance = np.array([[1 / 500, -0.2 / 500], [-0.2 / 500, 1 / 300]])
    strain = np.array([*(compliance @ stress + lengthened(stress)), 0.0])
    way = np.outer(np.linspace(0.0, 1.0, increments + 1), strain)
    way[1:-1] += np.random.default_rng(increments).normal(0.0, 0.01, (increments - 1, 3))
    found = follow(law_of(STIFF), way)
    np.testing.assert_allclose(found[:2], stress, atol=1e-8)


def test_a_yarn_pulled_alone_gains_what_it_has_and_two_stiffen_each_other():
    _, stress = bar(law_of(), 1, np.linspace(0.0, 0.1, 40)[1:])
    np.testing.assert_allclose(stress[:, 0], 0.0, atol=1e-9)
    gained = lengthened(stress[-1, :2])
    assert 0 < gained[1] < (2.5 / 12.0) ** 2 and gained[0] < 0
    alone = biaxial_response(law_of(), [[0.0, 5.0]], 1.0).strain[-1, 1]
    assert biaxial_response(law_of(), [[5.0, 5.0]], 1.0).strain[-1, 1] < 0.7 * alone
    none = law_of([*BETA[:-3], 1e-9, 1e-9, 12.0])
    plain = HypoelasticLaw(BETA[:-3], 0.2, [0.12] * 3, form=Spline(FORM.knots))
    path = np.random.default_rng(1).normal(0.0, 0.02, (6, 3))
    np.testing.assert_allclose(follow(none, path), follow(plain, path), rtol=1e-7)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_tangent_also_where_yarns_are_pressed(seed):
    rng = np.random.default_rng(seed)
    old = rng.normal(0.0, 0.02, 3)
    new, stress = old + rng.normal(0.0, 0.02, 3), rng.normal(3.0, 12.0, 3)
    _, tangent = law_of().increment(old, new, stress)

    def slope(step):
        ends = [[law_of().increment(old, new + s, stress)[0][0] for s in (by, -by)]
                for by in step * np.eye(3)]  # fmt: skip
        return np.transpose([(up - down) / (2 * step) for up, down in ends])

    near, nearer = slope(1e-6), slope(5e-7)
    if np.abs(near - nearer).max() < 1e-4 * np.abs(near).max():  # no kink between
        np.testing.assert_allclose(tangent[0], near, rtol=1e-5, atol=0.02)


@pytest.mark.parametrize("name", [*(f"beta_{i}" for i in range(12)), "nu12", "thickness"])
def test_derivatives_of_a_patch_through_its_history(name):
    loads = np.array([[5.0, 1.0], [10.0, 3.0], [12.0, 8.0], [12.0, 12.0], [6.0, 12.0], [2.0, 8.0]])
    step = 1e-3 if name.startswith("beta") else 1e-5

    def strain(by):
        law = law_of(BETA + by * np.array([name == f"beta_{i}" for i in range(12)]),
                     0.2 + by * (name == "nu12"))  # fmt: skip
        return biaxial_response(law, loads, 0.8 + by * (name == "thickness")).strain

    found = biaxial_response(law_of(), loads, 0.8, [name])
    slope = (strain(step) - strain(-step)) / (2 * step)
    room = 1e-6 * np.abs(slope).max() + 1e-12
    np.testing.assert_allclose(found.slope[..., 0], slope, atol=room)
    assert found.reached == len(loads) and (np.abs(slope).max() > 0) == (
        name[-2:] not in ("_0", "_1", "_2")
    )


def test_the_crimp_of_a_closed_path_of_stress_returns():
    corners = [(0, 0), (20, 0), (20, 30), (0, 30), (0, 0)]
    shares = np.linspace(0.0, 1.0, 50)[1:, None]
    way = np.vstack([a + (np.subtract(b, a)) * shares for a, b in pairwise(corners)])
    flat = law_of(STIFF, 0.0)
    end = biaxial_response(flat, way + 1e-12, 1.0).strain[-1]
    np.testing.assert_allclose(end, 0.0, atol=1e-6)


def test_cards_bounds_and_what_has_no_crimp(tmp_path):
    card = MaterialCard(law_of(), 0.8, "crimp")
    card.write(tmp_path / "card.toml", "MPa")
    back = read_card(tmp_path / "card.toml").law
    assert back.form == FORM and positive(back) and back.of_load_ratio
    assert not positive(law_of([*BETA[:-3], -1.5, 2.5, 12.0]))
    drawn = BETA + np.random.default_rng(1).normal(0.0, 0.1, (50, 12)) * (np.arange(12) > 8)
    sure = certainty_of(law_of(), drawn)
    assert np.sqrt(np.diag(sure.covariance)[9:]) == pytest.approx(0.1, rel=0.3)
    assert all(
        min(law.coupling[3:]) > 0 for law in sure.laws(law_of(), 20, np.random.default_rng(1))
    )
    np.testing.assert_allclose(back.coupling, [0.2, 0.0, 0.0, 1.5, 2.5, 12.0])
    assert form_named("spline-crimp", {"knots": 3}, [0.1] * 3).size == 12
    assert FORM.own_rows("S").shape == (3, 12)
    assert (FORM.own_rows("S") @ BETA == [12.0, 9.0, 7.0]).all()
    memory = Memory((0.1,) * 3, (1.5,) * 3)
    assert complaint(HypoelasticLaw, BETA, form=FORM, memory=memory).startswith("memory: ")


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
    found = closed_path(law, (a, b), side=400)
    assert found.work == pytest.approx(exact, rel=1e-5) and 0.01 < found.share < 1
    assert closed_path(law, (a, b)).work == pytest.approx(exact, rel=1e-3)
    for none in (replace(law, nu12=0.0), HypoelasticLaw.linear(e1, c, 20.0), law_of(STIFF)):
        assert abs(closed_path(none, (a, b), 400).share) < 2e-5
    assert abs(closed_path(law_of()).share) > 1e-3
    card = MaterialCard(law, 0.8)
    card.write(tmp_path / "card.toml")
    assert card.closed_path.ends == (0.2, 0.2)
    assert card.closed_path.words in (tmp_path / "card.toml").read_text()
