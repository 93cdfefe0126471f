"""The law: closed forms, tangents, tri-linear moduli."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.forms.base import COMPONENTS, GRID
from bubblefit.materials.forms.polynomial import CUBIC
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.positivity import check_positive, is_positive, smallest_modulus
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import logm, polar, sqrtm

from ..builders.fortran import BETA, BREAKS, MODULI
from ..support.refusals import complaint
from .forms.test_forms import follow

RANGE = [0.13, 0.13, 0.13]
E1, E2, G12, NU = 300.0, 220.0, 5.0, 0.24
CONSTANT = HypoelasticLaw.linear(E1, E2, G12, NU)
LAW = HypoelasticLaw.trilinear(*MODULI, BREAKS, NU)
BOTH = pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])


def cubic(thickness_change: str = "constant", strain_range: list[float] | None = None):
    return HypoelasticLaw(BETA, NU, strain_range, thickness_change)


def straight(end: list[float], steps: int) -> np.ndarray:
    return np.linspace(0.0, 1.0, steps + 1)[:, None] * np.array(end)


def deformations(count: int = 40, size: float = 0.1, directions: int = 2) -> np.ndarray:
    random = np.random.default_rng(7)
    flat = np.eye(directions)[:, :2]
    return flat + size * random.standard_normal((count, directions, 2))


@pytest.mark.parametrize("steps", [1, 7])
@pytest.mark.parametrize(
    ("strain", "stress"),
    [
        ([0.1, -NU * 0.1, 0.0], [E1 * 0.1, 0.0, 0.0]),  # a warp bar, a fill bar, shear, both
        ([-NU * E2 / E1 * 0.1, 0.1, 0.0], [0.0, E2 * 0.1, 0.0]),
        ([0.0, 0.0, 0.2], [0.0, 0.0, G12 * 0.2]),
        ([0.05, 0.05, 0.0],
         [0.05 * (E1 + NU * E2) / (1 - NU**2 * E2 / E1),
          0.05 * (NU + 1) * E2 / (1 - NU**2 * E2 / E1), 0.0]),
    ],
)  # fmt: skip
def test_constant_moduli_in_closed_form(strain, stress, steps):
    assert follow(CONSTANT, straight(strain, steps)) == pytest.approx(stress, rel=1e-13, abs=1e-12)


def test_isotropic_constants_give_an_isotropic_law():
    """Turning the material frame must not matter when G = E/2/(1 + nu)."""
    law = HypoelasticLaw.linear(100.0, 100.0, 100.0 / 2 / 1.3, 0.3)
    f = deformations()
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    s, _, _, _ = law.second_piola_kirchhoff(f)
    turned, _, _, _ = law.second_piola_kirchhoff(f @ turn)
    whole = np.array([[[a, c], [c, b]] for a, b, c in s])
    expected = turn.T @ whole @ turn
    assert turned[:, 0] == pytest.approx(expected[:, 0, 0], rel=1e-10, abs=1e-9)
    assert turned[:, 2] == pytest.approx(expected[:, 0, 1], rel=1e-10, abs=1e-9)


def test_only_what_couples_warp_and_fill_depends_on_the_increments():
    """Without Poisson's ratio nothing does; with it the error is of second order."""
    law, end = cubic(), [0.11, 0.09, 0.12]
    free = replace(law, nu12=0.0)
    exact = [np.polyval(np.polyint(BETA[12 - 4 * k : 16 - 4 * k]), end[k - 1]) for k in (1, 2, 3)]
    assert follow(free, straight(end, 1)) == pytest.approx(exact, rel=1e-13)
    many = follow(law, straight(end, 4096))
    errors = [np.abs(follow(law, straight(end, n)) - many) for n in (8, 16, 32)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))[:, :2]
    assert orders == pytest.approx(np.full((2, 2), 2.0), abs=0.05)
    assert (errors[0][:2] < 1e-4 * np.abs(many[:2])).all()
    assert many[2] == pytest.approx(exact[2], rel=1e-12)


@BOTH
@pytest.mark.parametrize("form", ["cubic", "trilinear"])
def test_pk2_tangent_against_finite_differences(form, thickness_change):
    random = np.random.default_rng(0)
    law = cubic(thickness_change, [0.3, 0.3, 0.6])
    if form == "trilinear":
        law = replace(LAW, thickness_change=thickness_change)
    f = deformations(60)
    f[0], f[1] = 1.05 * np.eye(2), 1.0001 * np.eye(2)  # equal stretches: the removable 0/0
    old, stress = 0.03 * random.random((len(f), 3)), random.standard_normal((len(f), 3))
    right = f.transpose(0, 2, 1) @ f
    _, tangent, strain, _ = law.second_piola_kirchhoff(f, old, stress)
    assert np.isfinite(tangent).all()
    near = np.abs(np.abs(strain[..., None]) - BREAKS).min(axis=(1, 2))
    keep = (near > 1e-5) | (form == "cubic")
    assert keep.sum() > 40
    step = 1e-6
    for j, direction in enumerate([[[2, 0], [0, 0]], [[0, 0], [0, 2]], [[0, 1], [1, 0]]]):
        ahead, behind = (
            law.second_piola_kirchhoff(np.array([sqrtm(c).real for c in moved]), old, stress)[0]
            for moved in (right + step * np.array(direction), right - step * np.array(direction))
        )
        off = np.abs(tangent[:, :, j] - (ahead - behind) / (2 * step))[keep].max()
        assert off < 1e-6 * np.abs(tangent).max()


def test_log_strain_is_the_logarithm_of_the_right_stretch():
    f = deformations(size=0.2)
    _, _, strain, _ = HypoelasticLaw.linear(1.0, 1.0, 1.0).second_piola_kirchhoff(f)
    exact = np.array([0.5 * logm(g.T @ g).real for g in f])
    wanted = np.stack([exact[:, 0, 0], exact[:, 1, 1], 2 * exact[:, 0, 1]], axis=1)
    assert strain == pytest.approx(wanted, abs=1e-12)


@BOTH
def test_frame_indifference_in_space(thickness_change):
    """F -> Q F: second Piola-Kirchhoff stays, Cauchy turns with Q and is R T R'."""
    law = cubic(thickness_change, [0.3, 0.3, 0.6])
    f = deformations(directions=3, size=0.05)
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    s, tangent, strain, corotated = law.second_piola_kirchhoff(f)
    again = law.second_piola_kirchhoff(turn @ f)
    for before, after in zip((s, tangent, strain, corotated), again, strict=True):
        assert after == pytest.approx(before, abs=1e-10 * max(np.abs(before).max(), 1.0))
    for i, g in enumerate(f):
        area = np.sqrt(np.linalg.det(g.T @ g))
        thinning = 1.0 if thickness_change == "constant" else area
        pk2 = np.array([[s[i, 0], s[i, 2]], [s[i, 2], s[i, 1]]])
        cauchy = g @ pk2 @ g.T / area * thinning
        h = turn @ g
        assert h @ pk2 @ h.T / area * thinning == pytest.approx(turn @ cauchy @ turn.T)
        rotation, _ = polar(g)
        t = np.array([[corotated[i, 0], corotated[i, 2]], [corotated[i, 2], corotated[i, 1]]])
        assert cauchy == pytest.approx(rotation @ t @ rotation.T, abs=1e-9)


strains = arrays(float, 3, elements=st.floats(-0.12, 0.12))


@given(strains, strains)
def test_shear_sign_symmetry_and_the_way_back(first, second):
    mirror, path = np.array([1.0, 1.0, -1.0]), np.array([np.zeros(3), first, second])
    for law in (cubic(strain_range=RANGE), LAW):
        assert follow(law, path * mirror) == pytest.approx(follow(law, path) * mirror, abs=1e-12)
        back = np.concatenate([path, path[-2::-1]])
        assert follow(law, back) == pytest.approx(np.zeros(3), abs=1e-10)


@given(strains, st.floats(50, 500), st.floats(50, 500), st.floats(1, 50), st.floats(0, 0.45))
def test_warp_and_fill_may_be_exchanged(strain, e1, e2, g12, nu12):
    """Renaming the axes: nu12 becomes nu21 = nu12 E2/E1."""
    nu21 = nu12 * e2 / e1
    if nu12 * nu21 > 0.9 or nu21 >= 1:
        return
    a = follow(HypoelasticLaw.linear(e1, e2, g12, nu12), np.array([np.zeros(3), strain]))
    there = HypoelasticLaw.linear(e2, e1, g12, nu21)
    b = follow(there, np.array([np.zeros(3), strain[[1, 0, 2]]]))
    assert b[[1, 0, 2]] == pytest.approx(a, rel=1e-9, abs=1e-9)


@given(st.floats(0.8, 1.3), st.floats(0.8, 1.3), st.floats(-0.3, 0.3))
def test_incompressible_is_constant_over_the_area_ratio(a, b, c):
    f = np.array([[[a, c], [0.0, b]]])
    thick = cubic(strain_range=RANGE).second_piola_kirchhoff(f)
    thin = cubic("incompressible", RANGE).second_piola_kirchhoff(f)
    assert thin[0] == pytest.approx(thick[0] / (a * b), rel=1e-12, abs=1e-12)
    assert thin[3] == pytest.approx(thick[3], rel=1e-12, abs=1e-12)


@given(arrays(float, (3, 3, 2), elements=st.floats(-3, 3)))
@example(np.full((3, 3, 2), 3e-48))
@example(np.zeros((3, 3, 2)))
def test_any_gradient_gives_finite_numbers_or_nan_rows(f):
    for law in (cubic(strain_range=RANGE), LAW):
        for parts in zip(*law.second_piola_kirchhoff(f), strict=True):
            assert all(np.isnan(p).all() for p in parts) or all(np.isfinite(p).all() for p in parts)


def test_moduli_are_held_outside_the_range():
    law = cubic(strain_range=RANGE)
    for name, first in (("G12", 0), ("E2", 4), ("E1", 8)):
        end = np.polyval(BETA[first : first + 4], 0.13)
        assert law.modulus(name, 0.4) == pytest.approx(end)
        below = end if name == "G12" else BETA[first + 3]
        assert law.modulus(name, -0.4) == pytest.approx(below)
        inside = np.linspace(0, 0.13, 9)
        curve = np.polyval(BETA[first : first + 4], inside)
        assert law.modulus(name, inside) == pytest.approx(curve)
    assert law.G12(-0.05) == law.G12(0.05)


def test_a_cubic_positive_on_the_grid_hardly_dips_between():
    """The bound stated at GRID, and cubics that come within a factor of three of it."""
    fine = np.vander(np.linspace(0, 1, 30 * (GRID - 1) + 1), 4)
    coarse = fine[::30]
    random = np.random.default_rng(5)
    nodes = 0.5 * (1 - np.cos((2 * np.arange(4) + 1) * np.pi / 8))
    worst = 0.0
    for beta in random.uniform(-1, 1, (4000, 4)) @ np.linalg.inv(np.vander(nodes, 4)).T:
        beta[3] -= (coarse @ beta).min()  # touches zero on the grid
        whole = fine @ beta
        worst = max(worst, -whole.min() / whole.max())
    assert 0.007 / 3 < worst < 0.007


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("beta", np.zeros(11)), ("beta", np.full(12, np.nan)),
        ("nu12", 1.0), ("nu12", -0.1), ("nu12", float("nan")),
        *(("strain_range", [0.1, *rest]) for rest in ([0.1], [0.0, 0.1], [float("nan"), 0.1])),
        ("thickness_change", "thin"),
    ],
)  # fmt: skip
def test_bad_constants_name_their_field(field, value):
    assert field in complaint(HypoelasticLaw, **{"beta": BETA, field: value})


VALUES = dict(zip(("E1", "E2", "G12"), MODULI, strict=True))


def test_layout_and_form():
    assert list(LAW.beta) == [0, 40, 14, 20, 0, 240, 110, 140, 0, 900, 450, 800]
    assert LAW.form.name == "trilinear" and LAW.with_beta(2 * LAW.beta).form == LAW.form
    assert HypoelasticLaw(LAW.beta).form == CUBIC
    assert LAW.jumps and not HypoelasticLaw(LAW.beta).jumps
    assert CONSTANT.with_beta(2 * CONSTANT.beta).nu12 == CONSTANT.nu12
    for array in (LAW.form.breaks, LAW.pieces, LAW.beta, CONSTANT.beta):
        with pytest.raises(ValueError, match="read-only"):
            array[:1] = 1.0
    for name, (a, b) in zip(COMPONENTS, BREAKS, strict=True):
        low, *_ = VALUES[name]
        strains = np.array(
            [[0.0, 0.5 * a, a], [1.0001 * a, 0.5 * (a + b), b], [1.0001 * b, 0.3, 5]]
        )
        expected = np.repeat(np.transpose([VALUES[name]]), 3, axis=1)
        assert (LAW.modulus(name, strains) == expected).all()
        assert (LAW.modulus(name, -strains) == (expected if name == "G12" else low)).all()
    stress, tangent = LAW.increment(np.zeros(3), [0.01, np.nan, 0.0], np.zeros(3))
    assert np.isnan(stress).all() and np.isnan(tangent).all()
    law = HypoelasticLaw.trilinear(MODULI[0], (140.0, -300.0, 240.0), MODULI[2], BREAKS, NU)
    assert np.isfinite(law.increment(np.zeros(3), [0.0, 0.02, 0.0], np.zeros(3))[0]).all()
    assert np.isnan(law.increment(np.zeros(3), [0.0, 0.05, 0.0], np.zeros(3))[0]).all()


BAD_BREAKS = [
    np.zeros((3, 2)), [[0.03, 0.01]] * 3, [[0.01, 0.01]] * 3, [[-0.01, 0.01]] * 3,
    [[0.01, np.inf]] * 3, [[0.01, np.nan]] * 3, [[0.01, 0.02]] * 2, [0.01, 0.02],
    [[0.01, 0.02], [0.01], [0.01, 0.02]], "none",
]  # fmt: skip


@pytest.mark.parametrize("breaks", BAD_BREAKS)
def test_bad_breaks_are_named(breaks):
    assert "breaks" in complaint(HypoelasticLaw.trilinear, *MODULI, breaks)


@pytest.mark.parametrize("place", [0, 4, 8])
def test_a_coefficient_that_the_law_does_not_have_is_named(place):
    beta = LAW.beta + (np.arange(12) == place)
    assert f"beta_{place}" in complaint(LAW.with_beta, beta)
    assert "E2" in complaint(HypoelasticLaw.trilinear, MODULI[0], (1.0, 2.0), MODULI[2], BREAKS)


def test_the_smallest_modulus_is_exact_between_any_strains_of_a_grid():
    # A dip below zero that is 2e-4 of strain wide, and lies at no strain of a grid.
    dip = 0.0437
    beta = np.zeros(12)
    beta[4:8] = 0.0, 1e6, -2e6 * dip, 1e6 * dip**2 - 0.01
    beta[[3, 11]] = 10.0, 500.0
    law = HypoelasticLaw(beta, 0.2, [0.1, 0.1, 0.1])
    smallest, strain = smallest_modulus(law, "E2")
    assert (smallest, strain) == (pytest.approx(-0.01, abs=1e-9), pytest.approx(dip))
    assert not is_positive(law) and "E2 is -0.01 MPa at 4.37 %" in complaint(check_positive, law)
    above = replace(law, beta=beta + 0.02 * (np.arange(12) == 7))
    assert is_positive(above)
    # Before the dip the card holds.
    assert is_positive(replace(law, strain_range=[0.1, 0.04, 0.1]))
    regions = HypoelasticLaw.trilinear(
        (500, 400, 300), (90, -1, 80), (9, 8, 7), [[0.01, 0.03]] * 3, strain_range=[0.1] * 3
    )
    assert smallest_modulus(regions, "E2")[0] == -1.0
    assert smallest_modulus(regions, "E1")[0] == 300.0
