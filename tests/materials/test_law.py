"""The law: closed forms, tangents, tri-linear moduli."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.forms.base import COMPONENTS, GRID, moduli_on_grid
from bubblefit.materials.forms.polynomial import CUBIC
from bubblefit.materials.forms.trilinear import TriLinear
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.point_law import by_pieces, increment_modulus
from hypothesis import assume, example, given, settings
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
MODULI_3 = ((800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0))
BREAKS = np.array([[0.01, 0.03], [0.02, 0.06], [0.01, 0.04]])
LAW = HypoelasticLaw.trilinear(*MODULI_3, BREAKS, NU)
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


@pytest.mark.parametrize("steps", [1, 2, 7, 400])
def test_uniaxial_integral_of_the_cubic_modulus(steps):
    """The integral of E1 over log strain in any number of increments (fill: held below zero)."""
    stress = follow(cubic(), straight([0.12, -NU * 0.12, 0.0], steps))
    integral = np.polyval(np.polyint(BETA[8:]), 0.12)
    assert stress[0] == pytest.approx(integral, rel=1e-13)
    assert stress[1:] == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("steps", [1, 3])
def test_shear_of_the_cubic_modulus_is_exact(steps):
    stress = follow(cubic(), straight([0.0, 0.0, -0.12], steps))
    integral = np.polyval(np.polyint(BETA[:4]), 0.12)
    assert stress == pytest.approx([0.0, 0.0, -integral], rel=1e-13)


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


@pytest.mark.parametrize("increments", [1, 7, 500])
def test_marc_uniaxial_end_stresses(increments):
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
def test_law_tangent_against_finite_differences():
    random = np.random.default_rng(3)
    law = cubic(strain_range=[0.3, 0.3, 0.6])
    old, new = 0.05 * random.random((2, 60, 3))
    stress = random.standard_normal((60, 3))
    _, tangent = law.increment(old, new, stress)
    step = 1e-6
    for j in range(3):
        shift = step * np.eye(3)[j]
        plus, minus = (law.increment(old, new + s, stress)[0] for s in (shift, -shift))
        near = pytest.approx((plus - minus) / (2 * step), abs=1e-6 * np.abs(tangent).max())
        assert tangent[:, :, j] == near


def away_from_breaks(strain: np.ndarray) -> np.ndarray:
    """Rows in which no strain is where a tangent of the tri-linear law jumps."""
    return (np.abs(np.abs(strain[..., None]) - BREAKS).min(axis=-1) > 1e-5).all(axis=-1)


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
    keep = away_from_breaks(strain) | (form == "cubic")
    assert keep.sum() > 40
    step = 1e-6
    for j, direction in enumerate([[[2, 0], [0, 0]], [[0, 0], [0, 2]], [[0, 1], [1, 0]]]):
        shift = step * np.array(direction, dtype=float)
        ahead, behind = (
            law.second_piola_kirchhoff(gradient_of(c), old, stress)[0]
            for c in (right + shift, right - shift)
        )
        expected = (ahead - behind) / (2 * step)
        off = np.abs(tangent[:, :, j] - expected)[keep].max()
        assert off < 1e-6 * np.abs(tangent).max()


# Kinematics and symmetries
def test_log_strain_is_the_logarithm_of_the_right_stretch():
    f = deformations(size=0.2)
    _, _, strain, _ = HypoelasticLaw.linear(1.0, 1.0, 1.0).second_piola_kirchhoff(f)
    expected = np.array([0.5 * logm(g.T @ g).real for g in f])
    assert strain[:, 0] == pytest.approx(expected[:, 0, 0], abs=1e-12)
    assert strain[:, 1] == pytest.approx(expected[:, 1, 1], abs=1e-12)
    assert strain[:, 2] == pytest.approx(2 * expected[:, 0, 1], abs=1e-12)


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
def test_shear_sign_symmetry(first, second):
    mirror, path = np.array([1.0, 1.0, -1.0]), np.array([np.zeros(3), first, second])
    for law in (cubic(strain_range=RANGE), LAW):
        assert follow(law, path * mirror) == pytest.approx(follow(law, path) * mirror, abs=1e-12)


@given(strains, strains)
def test_there_and_back_leaves_no_stress(first, second):
    path = np.array([np.zeros(3), first, second, first, np.zeros(3)])
    for law in (cubic(strain_range=RANGE), LAW):
        assert follow(law, path) == pytest.approx(np.zeros(3), abs=1e-10)


@given(strains, st.floats(50, 500), st.floats(50, 500), st.floats(1, 50), st.floats(0, 0.45))
def test_warp_and_fill_may_be_exchanged(strain, e1, e2, g12, nu12):
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


# Moduli and their range
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


def test_stress_beyond_the_range_grows_with_the_held_modulus():
    law = cubic(strain_range=RANGE)
    start, change = np.array([0.2, -NU * 0.2, 0.13]), np.array([0.1, -NU * 0.1, 0.3])
    stress, tangent = law.increment(start, start + change, np.zeros(3))
    assert stress[0, 0] == pytest.approx(0.1 * law.E1(0.13), rel=1e-12)
    assert stress[0, 2] == pytest.approx(0.3 * law.G12(0.13), rel=1e-12)
    assert tangent[0, 2, 2] == pytest.approx(float(law.G12(0.13)))


def test_increment_agrees_with_the_vectorised_moduli():
    law = cubic(strain_range=RANGE)
    old, new = np.array([0.02, 0.03, -0.04]), np.array([0.06, 0.05, -0.10])
    at, weight = np.polynomial.legendre.leggauss(2)  # exact for a cubic
    e1, e2, g12 = (
        0.5 * weight @ modulus(0.5 * (a + b) + 0.5 * (b - a) * at)
        for modulus, a, b in zip((law.E1, law.E2, law.G12), old, new, strict=True)
    )
    den = 1 - NU**2 * e2 / e1
    d = new - old
    expected = [(e1 * d[0] + NU * e2 * d[1]) / den, (NU * e2 * d[0] + e2 * d[1]) / den, g12 * d[2]]
    assert law.increment(old, new, np.zeros(3))[0][0] == pytest.approx(expected, rel=1e-13)


def test_a_modulus_that_is_not_positive_gives_nan():
    law = HypoelasticLaw.linear(300.0, -1.0, 5.0)
    stress, tangent = law.increment(np.zeros(3), np.full(3, 0.01), np.zeros(3))
    assert np.isnan(stress).all() and np.isnan(tangent).all()


coefficients = arrays(float, 12, elements=st.floats(-1e3, 1e3))


@given(coefficients, arrays(float, 3, elements=st.floats(0.01, 0.5)))
@settings(max_examples=50)
def test_positivity_rows_are_the_moduli(beta, ends):
    law = HypoelasticLaw(beta, NU, ends)
    rows = moduli_on_grid(CUBIC, list(ends))
    for name, end in zip(("G12", "E2", "E1"), ends[::-1], strict=True):
        direct = law.modulus(name, np.linspace(0, end, GRID))
        assert rows[name] @ beta == pytest.approx(direct, rel=1e-9, abs=1e-6)


def test_the_published_moduli_are_above_their_margins():
    rows = moduli_on_grid(CUBIC, RANGE)
    assert all(part.shape == (GRID, 12) for part in rows.values())
    for name, least in (("G12", 0.5), ("E2", 5.0), ("E1", 5.0)):
        assert (rows[name] @ BETA >= least).all()


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


# Bad input
@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"beta": np.zeros(11)}, "beta"), ({"beta": np.full(12, np.nan)}, "beta"),
        ({"nu12": 1.0}, "nu12"), ({"nu12": -0.1}, "nu12"), ({"nu12": float("nan")}, "nu12"),
        ({"strain_range": [0.1, 0.1]}, "strain_range"),
        ({"strain_range": [0.1, 0.0, 0.1]}, "strain_range"),
        ({"strain_range": [0.1, float("nan"), 0.1]}, "strain_range"),
        ({"thickness_change": "thin"}, "thickness_change"),
    ],
)  # fmt: skip
def test_bad_constants_name_their_field(change, field):
    with pytest.raises(InputError) as caught:
        HypoelasticLaw(**{"beta": BETA, **change})
    assert caught.value.field == field


def test_the_law_cannot_be_changed_in_place():
    with pytest.raises(ValueError, match="read-only"):
        CONSTANT.beta[0] = 1.0
    assert CONSTANT.with_beta(2 * CONSTANT.beta).nu12 == CONSTANT.nu12


#: First coefficient of each modulus.
FIRST = {"E1": 8, "E2": 4, "G12": 0}
VALUES = dict(zip(("E1", "E2", "G12"), MODULI_3, strict=True))
STEPS = pytest.mark.parametrize("steps", [1, 2, 7, 100])


def integral(name: str, strain: float) -> float:
    """Stress of a bar (or a sheared one): the modulus' integral, region by region."""
    (a, b), (low, middle, high) = BREAKS[COMPONENTS[name]], VALUES[name]
    x = abs(strain) if name == "G12" else strain
    size = low * min(x, a) + middle * (min(max(x, a), b) - a) + high * max(x - b, 0.0)
    return -size if name == "G12" and strain < 0 else size


def increment(law: HypoelasticLaw, name: str, x: float, x_old: float) -> tuple[float, float, float]:
    return increment_modulus(law.pieces, COMPONENTS[name], x, x_old)


# The moduli
def test_layout_and_form():
    assert list(LAW.beta) == [0, 40, 14, 20, 0, 240, 110, 140, 0, 900, 450, 800]
    assert LAW.form.name == "trilinear" and LAW.with_beta(2 * LAW.beta).form == LAW.form
    assert HypoelasticLaw(LAW.beta).form == CUBIC
    assert LAW.jumps and not HypoelasticLaw(LAW.beta).jumps
    for array in (LAW.form.breaks, LAW.pieces, LAW.beta):
        with pytest.raises(ValueError, match="read-only"):
            array[:1] = 1.0


@pytest.mark.parametrize("name", COMPONENTS)
def test_moduli_by_region(name):
    (a, b), (low, middle, high) = BREAKS[COMPONENTS[name]], VALUES[name]
    strains = [[0.0, 0.5 * a, a], [1.0001 * a, 0.5 * (a + b), b], [1.0001 * b, 0.3, 5.0]]
    expected = np.repeat([[low], [middle], [high]], 3, axis=1)
    assert (LAW.modulus(name, strains) == expected).all()
    below = -np.array(strains)
    assert (LAW.modulus(name, below) == (expected if name == "G12" else low)).all()
    assert LAW.modulus(name, 0.5 * (a + b)).shape == ()


@pytest.mark.parametrize(
    ("end", "strain", "expected"),
    [(0.02, 0.5, 450.0), (0.03, 0.5, 450.0), (0.01, 0.5, 800.0), (0.005, 0.02, 800.0)],
)
def test_a_range_that_ends_before_a_break_never_reaches_it(end, strain, expected):
    law = HypoelasticLaw.trilinear(*MODULI_3, BREAKS, NU, [end, 0.2, 0.2])
    assert law.E1(strain) == expected
    # From there on the mean of an increment is the held modulus, too.
    assert increment(law, "E1", strain + 0.1, strain)[0] == expected
    assert (law.form.breaks == BREAKS).all()
    assert (law.pieces[0, -1] == [end, 0.0, 0.0, 0.0, expected]).all()


@given(
    st.sampled_from(sorted(COMPONENTS)),
    arrays(float, 8, elements=st.floats(-0.2, 0.2)),
    st.booleans(),
)
def test_rows_times_coefficients_are_the_modulus(name, strain, trilinear):
    law = LAW if trilinear else HypoelasticLaw(np.arange(1.0, 13.0))
    law = HypoelasticLaw(law.beta, NU, [0.1, 0.05, 0.02], "constant", law.form)
    rows, first = law.modulus_rows(name, strain), FIRST[name]
    assert rows.shape == (8, 12)
    assert not np.delete(rows, range(first, first + 4), axis=1).any()
    assert rows @ law.beta == pytest.approx(law.modulus(name, strain), rel=1e-13)
    if trilinear:
        assert (rows.sum(axis=1) == 1).all() and not rows[:, first].any()


# Exact stress
@STEPS
@pytest.mark.parametrize("end", [0.005, 0.02, 0.03, 0.12])
def test_a_warp_bar_has_the_exact_stress_in_any_number_of_increments(steps, end):
    path = straight([end, -NU * end, 0.0], steps)
    assert follow(LAW, path) == pytest.approx([integral("E1", end), 0, 0], rel=1e-12, abs=1e-12)


@STEPS
@pytest.mark.parametrize("end", [0.01, 0.05, 0.06, 0.2])
def test_a_fill_bar_has_the_exact_stress_in_any_number_of_increments(steps, end):
    along = np.linspace(0, end, steps + 1)
    # The warp gets shorter, where E1 is constant: d eps1 = -nu12 E2/E1 d eps2.
    across = [-NU * integral("E2", x) / MODULI_3[0][0] for x in along]
    path = np.column_stack([across, along, np.zeros(steps + 1)])
    assert follow(LAW, path) == pytest.approx([0, integral("E2", end), 0], rel=1e-12, abs=1e-12)


@given(strains, strains)
def test_equal_moduli_are_the_linear_law(first, second):
    law = HypoelasticLaw.trilinear([300.0] * 3, [220.0] * 3, [5.0] * 3, BREAKS, NU)
    path = np.array([np.zeros(3), first, second])
    expected = follow(HypoelasticLaw.linear(300.0, 220.0, 5.0, NU), path)
    assert follow(law, path) == pytest.approx(expected, rel=1e-12, abs=1e-12)


# The mean over an increment
small = st.floats(-0.12, 0.12)


@given(st.sampled_from(sorted(COMPONENTS)), small, small)
def test_the_mean_and_its_derivatives(name, x, x_old):
    component = COMPONENTS[name]
    change, step = x - x_old, 1e-7
    assume(abs(change) > 1e-3)
    breaks = np.concatenate([BREAKS[component], -BREAKS[component]])
    assume(np.abs(np.subtract.outer([x, x_old], breaks)).min() > 2 * step)
    mean, ahead, behind = increment(LAW, name, x, x_old)
    assert mean == pytest.approx((integral(name, x) - integral(name, x_old)) / change, rel=1e-9)
    size = 1e-6 * max(VALUES[name]) / abs(change)
    by_new = [increment(LAW, name, x + s, x_old)[0] for s in (step, -step)]
    assert ahead == pytest.approx((by_new[0] - by_new[1]) / (2 * step), abs=size)
    by_old = [increment(LAW, name, x, x_old + s)[0] for s in (step, -step)]
    assert behind == pytest.approx((by_old[0] - by_old[1]) / (2 * step), abs=size)


@settings(deadline=None)
@given(strains, strains)
def test_shares_are_the_derivatives_by_the_coefficients(h, h_old):
    for name, component in COMPONENTS.items():
        weights = np.full((3, 4), np.nan)
        x, x_old = h[component], h_old[component]
        first, stop = by_pieces(LAW.pieces, component, x, x_old, weights)
        shares = weights[first:stop, 3]
        assert (shares >= 0).all() and shares.sum() == pytest.approx(1.0)
        mean = increment(LAW, name, x, x_old)[0]
        assert shares @ LAW.pieces[component, first:stop, 4] == pytest.approx(mean, rel=1e-13)


@pytest.mark.parametrize("strain", [0.0, 0.01, -0.01, 0.05, 0.1])
@pytest.mark.parametrize("change", [0.0, 1e-14, -1e-14, 3e-12])
def test_no_change_of_strain_has_the_modulus_of_the_point(strain, change):
    for name in COMPONENTS:
        mean, ahead, behind = increment(LAW, name, strain + change, strain)
        near = LAW.modulus(name, np.array([strain, strain + change]))
        assert near.min() - 1e-9 <= mean <= near.max() + 1e-9
        if abs(change) < 1e-12:
            assert ahead == behind == 0


# Tangents


def test_nan_and_moduli_that_are_not_positive_give_nan():
    stress, tangent = LAW.increment(np.zeros(3), [0.01, np.nan, 0.0], np.zeros(3))
    assert np.isnan(stress).all() and np.isnan(tangent).all()
    law = HypoelasticLaw.trilinear(MODULI_3[0], (140.0, -300.0, 240.0), MODULI_3[2], BREAKS, NU)
    assert np.isfinite(law.increment(np.zeros(3), [0.0, 0.02, 0.0], np.zeros(3))[0]).all()
    assert np.isnan(law.increment(np.zeros(3), [0.0, 0.05, 0.0], np.zeros(3))[0]).all()


# Positivity
@given(arrays(float, 3, elements=st.floats(0.005, 0.5)))
def test_positivity_rows_see_every_region_that_the_range_reaches(ends):
    rows = moduli_on_grid(TriLinear.at(BREAKS), list(ends))
    law = HypoelasticLaw.trilinear(*MODULI_3, BREAKS, NU, ends)
    for name, component in COMPONENTS.items():
        assert rows[name].shape == (GRID, 12)
        values = rows[name] @ law.beta
        assert values[0] == VALUES[name][0] and values[-1] == law.modulus(name, 10.0)
        reached = 1 + (BREAKS[component] < ends[component] * (1 - 1e-9)).sum()
        assert len(set(values)) >= reached


# Bad input
BAD_BREAKS = [
    np.zeros((3, 2)), [[0.03, 0.01]] * 3, [[0.01, 0.01]] * 3, [[-0.01, 0.01]] * 3,
    [[0.01, np.inf]] * 3, [[0.01, np.nan]] * 3, [[0.01, 0.02]] * 2, [0.01, 0.02],
    [[0.01, 0.02], [0.01], [0.01, 0.02]], "none",
]  # fmt: skip


@pytest.mark.parametrize("breaks", BAD_BREAKS)
def test_bad_breaks_are_named(breaks):
    with pytest.raises(InputError, match="increasing strains") as caught:
        HypoelasticLaw.trilinear(*MODULI_3, breaks)
    assert caught.value.field == "breaks" and "\n" not in str(caught.value)


@pytest.mark.parametrize("place", [0, 4, 8])
def test_a_coefficient_that_the_law_does_not_have_is_named(place):
    beta = LAW.beta.copy()
    beta[place] = 1.0
    with pytest.raises(InputError, match=f"trilinear law has no beta_{place}") as caught:
        LAW.with_beta(beta)
    assert caught.value.field == "beta"
    with pytest.raises(InputError, match="E2"):
        HypoelasticLaw.trilinear(MODULI_3[0], (1.0, 2.0), MODULI_3[2], BREAKS)
