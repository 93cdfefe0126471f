"""The hypoelastic law: closed forms, tangents, symmetries, published Marc stresses."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.forms.base import GRID, moduli_on_grid
from bubblefit.materials.forms.polynomial import CUBIC
from bubblefit.materials.law import HypoelasticLaw
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import logm, polar, sqrtm

from ..places import PUBLISHED
from ..published_laws import TABLE_4_2
from .paths import follow

BETA = 1e3 * np.array(TABLE_4_2)
RANGE = [0.13, 0.13, 0.13]
E1, E2, G12, NU = 300.0, 220.0, 5.0, 0.24
CONSTANT = HypoelasticLaw.linear(E1, E2, G12, NU)
BOTH = pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])


def cubic(thickness_change: str = "constant", strain_range: list[float] | None = None):
    return HypoelasticLaw(BETA, NU, strain_range, thickness_change)


def straight(end: list[float], steps: int) -> np.ndarray:
    return np.linspace(0.0, 1.0, steps + 1)[:, None] * np.array(end)


def deformations(count: int = 40, size: float = 0.1, directions: int = 2) -> np.ndarray:
    random = np.random.default_rng(7)
    flat = np.eye(directions)[:, :2]
    return flat + size * random.standard_normal((count, directions, 2))


def gradient_of(right: np.ndarray) -> np.ndarray:
    """One F for each right Cauchy-Green tensor: the symmetric root."""
    return np.array([sqrtm(c).real for c in right])


# Closed forms


@pytest.mark.parametrize("steps", [1, 7])
def test_uniaxial_stress_in_warp_is_modulus_times_log_strain(steps: int) -> None:
    stress = follow(CONSTANT, straight([0.1, -NU * 0.1, 0.0], steps))
    assert stress == pytest.approx([E1 * 0.1, 0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("steps", [1, 7])
def test_uniaxial_stress_in_fill_contracts_by_the_other_ratio(steps: int) -> None:
    stress = follow(CONSTANT, straight([-NU * E2 / E1 * 0.1, 0.1, 0.0], steps))
    assert stress == pytest.approx([0.0, E2 * 0.1, 0.0], abs=1e-12)


def test_equibiaxial_strain() -> None:
    stress = follow(CONSTANT, straight([0.05, 0.05, 0.0], 3))
    den = 1.0 - NU**2 * E2 / E1
    expected = [(E1 + NU * E2) / den * 0.05, (NU * E2 + E2) / den * 0.05, 0.0]
    assert stress == pytest.approx(expected, rel=1e-13)


def test_pure_shear_uses_the_engineering_strain() -> None:
    assert follow(CONSTANT, straight([0, 0, 0.2], 5)) == pytest.approx([0, 0, G12 * 0.2])


def test_isotropic_constants_give_an_isotropic_law() -> None:
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


@pytest.mark.parametrize("steps", [1, 2, 7, 400])
def test_uniaxial_integral_of_the_cubic_modulus(steps: int) -> None:
    """The integral of E1 over log strain in any number of increments (fill: held below zero)."""
    stress = follow(cubic(), straight([0.12, -NU * 0.12, 0.0], steps))
    integral = np.polyval(np.polyint(BETA[8:]), 0.12)
    assert stress[0] == pytest.approx(integral, rel=1e-13)
    assert stress[1:] == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("steps", [1, 3])
def test_shear_of_the_cubic_modulus_is_exact(steps: int) -> None:
    stress = follow(cubic(), straight([0.0, 0.0, -0.12], steps))
    integral = np.polyval(np.polyint(BETA[:4]), 0.12)
    assert stress == pytest.approx([0.0, 0.0, -integral], rel=1e-13)


def test_only_what_couples_warp_and_fill_depends_on_the_increments() -> None:
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


@pytest.mark.parametrize("increments", [1, 7, 500])
def test_marc_uniaxial_end_stresses(increments: int) -> None:
    """Composite Structures 2017 preprint (digitised): four digits, all four models."""
    table = PUBLISHED / "marc_uniaxial_end_stress.csv"
    lines = [line for line in table.read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    assert len(rows) == 4
    for row in rows:
        modulus = [1e3 * float(row[f"c{k}"]) for k in (3, 2, 1, 0)]
        end = np.log1p(float(row["end_strain_engineering"]))
        published = float(row["marc_end_stress_MPa"])
        steps = np.linspace(0.0, end, increments + 1)
        beta = np.zeros(12)
        beta[3] = 10.0
        if row["direction"] == "warp":
            beta[8:], beta[7] = modulus, 100.0
            path = np.stack([steps, -NU * steps, 0 * steps], axis=1)
            component = 0
        else:
            beta[4:8], beta[11] = modulus, 1000.0
            # d eps1 = -nu21 d eps2, and nu21 E1 = nu12 E2.
            side = -NU * np.polyval(np.polyint(modulus), steps) / beta[11]
            path = np.stack([side, steps, 0 * steps], axis=1)
            component = 1
        stress = follow(HypoelasticLaw(beta, NU), path)
        assert stress[component] == pytest.approx(published, rel=1e-4), row
        exact = np.polyval(np.polyint(modulus), end)
        assert stress[component] == pytest.approx(exact, rel=1e-12), row
        assert np.delete(stress, component) == pytest.approx([0.0, 0.0], abs=1e-9)


# Tangents


def test_law_tangent_against_finite_differences() -> None:
    random = np.random.default_rng(3)
    law = cubic(strain_range=[0.3, 0.3, 0.6])
    old, new = 0.05 * random.random((2, 60, 3))
    stress = random.standard_normal((60, 3))
    _, tangent = law.increment(old, new, stress)
    step = 1e-6
    for j in range(3):
        shift = step * np.eye(3)[j]
        plus, minus = (
            law.increment(old, new + shift, stress),
            law.increment(old, new - shift, stress),
        )
        assert tangent[:, :, j] == pytest.approx(
            (plus[0] - minus[0]) / (2 * step), abs=1e-6 * np.abs(tangent).max()
        )


@BOTH
def test_pk2_tangent_against_finite_differences(thickness_change: str) -> None:
    random = np.random.default_rng(0)
    law = cubic(thickness_change, [0.3, 0.3, 0.6])
    f = deformations()
    f[0], f[1] = 1.05 * np.eye(2), 1.0001 * np.eye(2)  # equal stretches: the removable 0/0
    old, stress = 0.03 * random.random((len(f), 3)), random.standard_normal((len(f), 3))
    right = f.transpose(0, 2, 1) @ f
    _, tangent, _, _ = law.second_piola_kirchhoff(f, old, stress)
    assert np.isfinite(tangent).all()
    step = 1e-6
    for j, direction in enumerate([[[2, 0], [0, 0]], [[0, 0], [0, 2]], [[0, 1], [1, 0]]]):
        shift = step * np.array(direction, dtype=float)
        ahead, behind = (
            law.second_piola_kirchhoff(gradient_of(c), old, stress)[0]
            for c in (right + shift, right - shift)
        )
        expected = (ahead - behind) / (2 * step)
        assert np.abs(tangent[:, :, j] - expected).max() < 1e-6 * np.abs(tangent).max()


# Kinematics and symmetries


def test_log_strain_is_the_logarithm_of_the_right_stretch() -> None:
    f = deformations(size=0.2)
    _, _, strain, _ = HypoelasticLaw.linear(1.0, 1.0, 1.0).second_piola_kirchhoff(f)
    expected = np.array([0.5 * logm(g.T @ g).real for g in f])
    assert strain[:, 0] == pytest.approx(expected[:, 0, 0], abs=1e-12)
    assert strain[:, 1] == pytest.approx(expected[:, 1, 1], abs=1e-12)
    assert strain[:, 2] == pytest.approx(2 * expected[:, 0, 1], abs=1e-12)


@BOTH
def test_frame_indifference_in_space(thickness_change: str) -> None:
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
def test_shear_sign_symmetry(first: np.ndarray, second: np.ndarray) -> None:
    law, mirror = cubic(strain_range=RANGE), np.array([1.0, 1.0, -1.0])
    path = np.array([np.zeros(3), first, second])
    assert follow(law, path * mirror) == pytest.approx(follow(law, path) * mirror, abs=1e-12)


@given(strains, strains)
def test_there_and_back_leaves_no_stress(first: np.ndarray, second: np.ndarray) -> None:
    """The mean of a step is the mean of the step back: no ratchet."""
    path = np.array([np.zeros(3), first, second, first, np.zeros(3)])
    assert follow(cubic(strain_range=RANGE), path) == pytest.approx(np.zeros(3), abs=1e-10)


@given(strains, st.floats(50, 500), st.floats(50, 500), st.floats(1, 50), st.floats(0, 0.45))
def test_warp_and_fill_may_be_exchanged(
    strain: np.ndarray, e1: float, e2: float, g12: float, nu12: float
) -> None:
    """Renaming the axes: nu12 becomes nu21 = nu12 E2/E1."""
    if nu12**2 * e2 / e1 > 0.9:
        return
    here = HypoelasticLaw.linear(e1, e2, g12, nu12)
    nu21 = nu12 * e2 / e1
    if nu21 >= 1:
        return
    there = HypoelasticLaw.linear(e2, e1, g12, nu21)
    a = follow(here, np.array([np.zeros(3), strain]))
    b = follow(there, np.array([np.zeros(3), strain[[1, 0, 2]]]))
    assert b[[1, 0, 2]] == pytest.approx(a, rel=1e-9, abs=1e-9)


@given(st.floats(0.8, 1.3), st.floats(0.8, 1.3), st.floats(-0.3, 0.3))
def test_incompressible_is_constant_over_the_area_ratio(a: float, b: float, c: float) -> None:
    f = np.array([[[a, c], [0.0, b]]])
    thick = cubic(strain_range=RANGE).second_piola_kirchhoff(f)
    thin = cubic("incompressible", RANGE).second_piola_kirchhoff(f)
    assert thin[0] == pytest.approx(thick[0] / (a * b), rel=1e-12, abs=1e-12)
    assert thin[3] == pytest.approx(thick[3], rel=1e-12, abs=1e-12)


@given(arrays(float, (3, 3, 2), elements=st.floats(-3, 3)))
@example(np.full((3, 3, 2), 3e-48))
@example(np.zeros((3, 3, 2)))
def test_any_gradient_gives_finite_numbers_or_nan_rows(f: np.ndarray) -> None:
    s, tangent, strain, stress = cubic(strain_range=RANGE).second_piola_kirchhoff(f)
    for i in range(3):
        parts = [s[i], tangent[i], strain[i], stress[i]]
        bad = [bool(np.isnan(part).all()) for part in parts]
        good = [bool(np.isfinite(part).all()) for part in parts]
        assert all(bad) or all(good)


# Moduli and their range


def test_moduli_are_held_outside_the_range() -> None:
    law = cubic(strain_range=RANGE)
    for name, first in (("G12", 0), ("E2", 4), ("E1", 8)):
        end = np.polyval(BETA[first : first + 4], 0.13)
        assert law.modulus(name, 0.4) == pytest.approx(end)
        below = end if name == "G12" else BETA[first + 3]
        assert law.modulus(name, -0.4) == pytest.approx(below)
        inside = np.linspace(0, 0.13, 9)
        assert law.modulus(name, inside) == pytest.approx(
            np.polyval(BETA[first : first + 4], inside)
        )
    assert law.G12(-0.05) == law.G12(0.05)


def test_stress_beyond_the_range_grows_with_the_held_modulus() -> None:
    law = cubic(strain_range=RANGE)
    start, change = np.array([0.2, -NU * 0.2, 0.13]), np.array([0.1, -NU * 0.1, 0.3])
    stress, tangent = law.increment(start, start + change, np.zeros(3))
    assert stress[0, 0] == pytest.approx(0.1 * law.E1(0.13), rel=1e-12)
    assert stress[0, 2] == pytest.approx(0.3 * law.G12(0.13), rel=1e-12)
    assert tangent[0, 2, 2] == pytest.approx(float(law.G12(0.13)))


def test_increment_agrees_with_the_vectorised_moduli() -> None:
    law = cubic(strain_range=RANGE)
    old, new = np.array([0.02, 0.03, -0.04]), np.array([0.06, 0.05, -0.10])
    at, weight = np.polynomial.legendre.leggauss(2)  # exact for a cubic
    e1, e2, g12 = (
        0.5 * weight @ modulus(0.5 * (a + b) + 0.5 * (b - a) * at)
        for modulus, a, b in zip((law.E1, law.E2, law.G12), old, new, strict=True)
    )
    den = 1 - NU**2 * e2 / e1
    d = new - old
    expected = [
        (e1 * d[0] + NU * e2 * d[1]) / den,
        (NU * e2 * d[0] + e2 * d[1]) / den,
        g12 * d[2],
    ]
    assert law.increment(old, new, np.zeros(3))[0][0] == pytest.approx(expected, rel=1e-13)


def test_a_modulus_that_is_not_positive_gives_nan() -> None:
    law = HypoelasticLaw.linear(300.0, -1.0, 5.0)
    stress, tangent = law.increment(np.zeros(3), np.full(3, 0.01), np.zeros(3))
    assert np.isnan(stress).all() and np.isnan(tangent).all()


coefficients = arrays(float, 12, elements=st.floats(-1e3, 1e3))


@given(coefficients, arrays(float, 3, elements=st.floats(0.01, 0.5)))
@settings(max_examples=50)
def test_positivity_rows_are_the_moduli(beta: np.ndarray, ends: np.ndarray) -> None:
    law = HypoelasticLaw(beta, NU, ends)
    rows = moduli_on_grid(CUBIC, list(ends))
    for name, end in zip(("G12", "E2", "E1"), ends[::-1], strict=True):
        direct = law.modulus(name, np.linspace(0, end, GRID))
        assert rows[name] @ beta == pytest.approx(direct, rel=1e-9, abs=1e-6)


def test_the_published_moduli_are_above_their_margins() -> None:
    rows = moduli_on_grid(CUBIC, RANGE)
    assert all(part.shape == (GRID, 12) for part in rows.values())
    for name, least in (("G12", 0.5), ("E2", 5.0), ("E1", 5.0)):
        assert (rows[name] @ BETA >= least).all()


def test_a_cubic_positive_on_the_grid_hardly_dips_between() -> None:
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


# Bad input


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"beta": np.zeros(11)}, "beta"),
        ({"beta": np.full(12, np.nan)}, "beta"),
        ({"nu12": 1.0}, "nu12"),
        ({"nu12": -0.1}, "nu12"),
        ({"nu12": float("nan")}, "nu12"),
        ({"strain_range": [0.1, 0.1]}, "strain_range"),
        ({"strain_range": [0.1, 0.0, 0.1]}, "strain_range"),
        ({"strain_range": [0.1, float("nan"), 0.1]}, "strain_range"),
        ({"thickness_change": "thin"}, "thickness_change"),
    ],
)
def test_bad_constants_name_their_field(change: dict, field: str) -> None:
    with pytest.raises(InputError) as caught:
        HypoelasticLaw(**{"beta": BETA, **change})
    assert caught.value.field == field


def test_the_law_cannot_be_changed_in_place() -> None:
    with pytest.raises(ValueError, match="read-only"):
        CONSTANT.beta[0] = 1.0
    assert CONSTANT.with_beta(2 * CONSTANT.beta).nu12 == CONSTANT.nu12
