"""materials/point_law.py: stress and tangent at a point, by closed forms and differences."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.point_law import RIGHT, load_angle
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import logm, polar, sqrtm

from ..builders.fortran import BETA, BREAKS, MODULI
from .cases import STIFF, crimp_law, lengthened, load_ratio_law, stress_along

RATIO_NU = 0.24
#: MPa: G12, E2 at 1:1 and its gain, E1 at 1:1 and its gain.
RATIO_BETA = (30.0, 800.0, 400.0, 1000.0, -300.0)


def moduli(beta, share):
    _, fill, fill_gain, warp, warp_gain = beta
    gamma = np.array(share) / np.hypot(*share) - 1 / np.sqrt(2)
    return warp + warp_gain * gamma[0], fill + fill_gain * gamma[1]


def compliance(beta, share):
    e1, e2 = moduli(beta, share)
    return np.array([[1 / e1, -RATIO_NU / e1], [-RATIO_NU / e1, 1 / e2]])


gains = st.floats(-350.0, 350.0)
angles = st.floats(0.0, RIGHT)


@settings(max_examples=60, deadline=None)
@given(gains, gains, angles, st.integers(1, 5))
def test_proportional_path_has_moduli_of_its_load_ratio(fill_gain, warp_gain, angle, increments):
    """Strain is the compliance of the ratio times the stress, in any number of increments."""
    beta = (30.0, 500.0, fill_gain, 700.0, warp_gain)
    share = np.array([np.cos(angle), np.sin(angle)])
    strain = [*(20.0 * compliance(beta, share) @ share), 0.0]
    stress = stress_along(
        load_ratio_law(beta), np.outer(np.linspace(0.0, 1.0, increments + 1), strain)
    )
    np.testing.assert_allclose(stress[:2], 20.0 * share, atol=1e-11)


def test_load_angle_counts_tension_and_is_continuous():
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
def test_derivatives_of_load_angle_against_differences(stress):
    ends = [[load_angle(*(stress + s * by))[0] for s in (1, -1)] for by in 1e-6 * np.eye(2)]
    by = [(ahead - behind) / 2e-6 for ahead, behind in ends]
    assert load_angle(*stress)[1:] == pytest.approx(by, abs=1e-9)


def test_load_ratio_law_without_gains_is_the_constant_law():
    # Without stress it begins at equal loads; without gains it is the constant law.
    none, known = np.zeros(3), HypoelasticLaw.linear(1000.0, 800.0, 30.0, RATIO_NU)
    _, tangent = load_ratio_law().increment(none, none, none)
    np.testing.assert_allclose(tangent, known.increment(none, none, none)[1], rtol=1e-14)
    rng = np.random.default_rng(1)
    path = (*rng.normal(0.0, 0.03, (2, 50, 3)), rng.normal(0.0, 20.0, (50, 3)))
    flat = load_ratio_law((30.0, 800.0, 0.0, 1000.0, 0.0))
    for a, b in zip(flat.increment(*path), known.increment(*path), strict=True):
        np.testing.assert_array_equal(a, b)


def test_pressed_yarn_counts_as_a_yarn_without_load():
    known = HypoelasticLaw.linear(*moduli(RATIO_BETA, (1, 0)), 30.0, RATIO_NU)
    new, none = np.array([[0.02, -0.02, 0.0]]), np.zeros((1, 3))
    stress, _ = load_ratio_law().increment(none, new, none)
    assert stress[0, 1] < 0
    np.testing.assert_allclose(stress, known.increment(none, new, none)[0], rtol=1e-12)


def stress_slopes(law, old, new, stress, step):
    """Differences of the stress after an increment by its strains at the end."""
    ends = [[law.increment(old, new + s, stress)[0][0] for s in (by, -by)]
            for by in step * np.eye(3)]  # fmt: skip
    return np.transpose([(up - down) / (2 * step) for up, down in ends])


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_tangent_of_load_ratio_law_against_differences(seed):
    rng = np.random.default_rng(seed)
    old = rng.normal(0.0, 0.02, 3)
    new, stress = old + rng.normal(0.0, 0.02, 3), rng.normal(0.0, 10.0, 3)
    law = load_ratio_law((30.0, 800.0, rng.uniform(-400, 400), 1000.0, rng.uniform(-400, 400)))
    after, tangent = law.increment(old, new, stress)
    if np.abs(0.5 * (stress + after[0])[:2]).min() < 1e-3:  # the ratio has a kink there
        return
    # Near the kink stress bends within some 1e-5 of strain: the error of second order is taken out.
    near, nearer = (stress_slopes(law, old, new, stress, step) for step in (2e-7, 1e-7))
    found = (4 * nearer - near) / 3
    np.testing.assert_allclose(tangent[0], found, rtol=1e-6, atol=1e-3)


@settings(max_examples=50, deadline=None)
@given(st.floats(0.0, 60.0), st.floats(0.0, 60.0), st.integers(1, 4))
def test_crimp_law_strain_is_that_of_yarns_and_slopes(warp, fill, increments):
    """Check it for constant moduli in any number of increments, on any path."""
    stress = np.array([warp, fill])
    compliance = np.array([[1 / 500, -0.2 / 500], [-0.2 / 500, 1 / 300]])
    strain = np.array([*(compliance @ stress + lengthened(stress)), 0.0])
    way = np.outer(np.linspace(0.0, 1.0, increments + 1), strain)
    way[1:-1] += np.random.default_rng(increments).normal(0.0, 0.01, (increments - 1, 3))
    np.testing.assert_allclose(stress_along(crimp_law(STIFF), way)[:2], stress, atol=1e-8)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_tangent_of_crimp_law_against_differences(seed):
    rng = np.random.default_rng(seed)
    old = rng.normal(0.0, 0.02, 3)
    new, stress = old + rng.normal(0.0, 0.02, 3), rng.normal(3.0, 12.0, 3)
    _, tangent = crimp_law().increment(old, new, stress)

    near, nearer = (stress_slopes(crimp_law(), old, new, stress, step) for step in (1e-6, 5e-7))
    if np.abs(near - nearer).max() < 1e-4 * np.abs(near).max():  # no kink between
        np.testing.assert_allclose(tangent[0], near, rtol=1e-5, atol=0.02)


RANGE = [0.13, 0.13, 0.13]
WARP_MODULUS, FILL_MODULUS, SHEAR_MODULUS, NU = 300.0, 220.0, 5.0, 0.24
CONSTANT_LAW = HypoelasticLaw.linear(WARP_MODULUS, FILL_MODULUS, SHEAR_MODULUS, NU)
TRILINEAR_LAW = HypoelasticLaw.trilinear(*MODULI, BREAKS, NU)
BOTH = pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])


def cubic_law(thickness_change: str = "constant", strain_range: list[float] | None = None):
    return HypoelasticLaw(BETA, NU, strain_range, thickness_change)


def straight_path(end: list[float], steps: int) -> np.ndarray:
    return np.linspace(0.0, 1.0, steps + 1)[:, None] * np.array(end)


def deformations(count: int = 40, size: float = 0.1, directions: int = 2) -> np.ndarray:
    random = np.random.default_rng(7)
    flat = np.eye(directions)[:, :2]
    return flat + size * random.standard_normal((count, directions, 2))


@pytest.mark.parametrize("steps", [1, 7])
@pytest.mark.parametrize(
    ("strain", "stress"),
    [
        (
            [0.1, -NU * 0.1, 0.0],
            [WARP_MODULUS * 0.1, 0.0, 0.0],
        ),  # a warp bar, a fill bar, shear, both
        ([-NU * FILL_MODULUS / WARP_MODULUS * 0.1, 0.1, 0.0], [0.0, FILL_MODULUS * 0.1, 0.0]),
        ([0.0, 0.0, 0.2], [0.0, 0.0, SHEAR_MODULUS * 0.2]),
        (
            [0.05, 0.05, 0.0],
            [
                0.05
                * (WARP_MODULUS + NU * FILL_MODULUS)
                / (1 - NU**2 * FILL_MODULUS / WARP_MODULUS),
                0.05 * (NU + 1) * FILL_MODULUS / (1 - NU**2 * FILL_MODULUS / WARP_MODULUS),
                0.0,
            ],
        ),
    ],
)
def test_constant_moduli_in_closed_form(strain, stress, steps):
    assert stress_along(CONSTANT_LAW, straight_path(strain, steps)) == pytest.approx(
        stress, rel=1e-13, abs=1e-12
    )


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


def test_only_poissons_coupling_depends_on_the_increments():
    """Without Poisson's ratio nothing does; with it the error is of second order."""
    law, end = cubic_law(), [0.11, 0.09, 0.12]
    free = replace(law, nu12=0.0)
    exact = [np.polyval(np.polyint(BETA[12 - 4 * k : 16 - 4 * k]), end[k - 1]) for k in (1, 2, 3)]
    assert stress_along(free, straight_path(end, 1)) == pytest.approx(exact, rel=1e-13)
    many = stress_along(law, straight_path(end, 4096))
    errors = [np.abs(stress_along(law, straight_path(end, n)) - many) for n in (8, 16, 32)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))[:, :2]
    assert orders == pytest.approx(np.full((2, 2), 2.0), abs=0.05)
    assert (errors[0][:2] < 1e-4 * np.abs(many[:2])).all()
    assert many[2] == pytest.approx(exact[2], rel=1e-12)


@BOTH
@pytest.mark.parametrize("form", ["cubic", "trilinear"])
def test_tangent_of_second_piola_kirchhoff_stress_against_differences(form, thickness_change):
    random = np.random.default_rng(0)
    law = cubic_law(thickness_change, [0.3, 0.3, 0.6])
    if form == "trilinear":
        law = replace(TRILINEAR_LAW, thickness_change=thickness_change)
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
def test_stress_turns_with_the_body(thickness_change):
    """F -> Q F: second Piola-Kirchhoff stays, Cauchy turns with Q and is R T R'."""
    law = cubic_law(thickness_change, [0.3, 0.3, 0.6])
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
def test_stress_is_symmetric_in_shear_and_returns_on_the_way_back(first, second):
    mirror, path = np.array([1.0, 1.0, -1.0]), np.array([np.zeros(3), first, second])
    for law in (cubic_law(strain_range=RANGE), TRILINEAR_LAW):
        assert stress_along(law, path * mirror) == pytest.approx(
            stress_along(law, path) * mirror, abs=1e-12
        )
        back = np.concatenate([path, path[-2::-1]])
        assert stress_along(law, back) == pytest.approx(np.zeros(3), abs=1e-10)


@given(strains, st.floats(50, 500), st.floats(50, 500), st.floats(1, 50), st.floats(0, 0.45))
def test_exchanged_warp_and_fill_give_exchanged_stress(strain, e1, e2, g12, nu12):
    """Renaming the axes: nu12 becomes nu21 = nu12 E2/E1."""
    nu21 = nu12 * e2 / e1
    if nu12 * nu21 > 0.9 or nu21 >= 1:
        return
    a = stress_along(HypoelasticLaw.linear(e1, e2, g12, nu12), np.array([np.zeros(3), strain]))
    there = HypoelasticLaw.linear(e2, e1, g12, nu21)
    b = stress_along(there, np.array([np.zeros(3), strain[[1, 0, 2]]]))
    assert b[[1, 0, 2]] == pytest.approx(a, rel=1e-9, abs=1e-9)


@given(st.floats(0.8, 1.3), st.floats(0.8, 1.3), st.floats(-0.3, 0.3))
def test_incompressible_stress_is_constant_thickness_stress_over_area_ratio(a, b, c):
    f = np.array([[[a, c], [0.0, b]]])
    thick = cubic_law(strain_range=RANGE).second_piola_kirchhoff(f)
    thin = cubic_law("incompressible", RANGE).second_piola_kirchhoff(f)
    assert thin[0] == pytest.approx(thick[0] / (a * b), rel=1e-12, abs=1e-12)
    assert thin[3] == pytest.approx(thick[3], rel=1e-12, abs=1e-12)


@given(arrays(float, (3, 3, 2), elements=st.floats(-3, 3)))
@example(np.full((3, 3, 2), 3e-48))
@example(np.zeros((3, 3, 2)))
def test_any_deformation_gives_finite_numbers_or_nan(f):
    for law in (cubic_law(strain_range=RANGE), TRILINEAR_LAW):
        for parts in zip(*law.second_piola_kirchhoff(f), strict=True):
            assert all(np.isnan(p).all() for p in parts) or all(np.isfinite(p).all() for p in parts)
