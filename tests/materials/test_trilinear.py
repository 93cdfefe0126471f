"""The tri-linear law at a point: exact stress, tangents across breaks, symmetries, bad input."""

from __future__ import annotations

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

from .paths import follow

E1, E2, G12 = (800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0)
BREAKS = np.array([[0.01, 0.03], [0.02, 0.06], [0.01, 0.04]])
NU = 0.24
#: First coefficient of each modulus.
FIRST = {"E1": 8, "E2": 4, "G12": 0}
LAW = HypoelasticLaw.trilinear(E1, E2, G12, BREAKS, NU)
VALUES = {"E1": E1, "E2": E2, "G12": G12}
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


def test_layout_and_form() -> None:
    assert list(LAW.beta) == [0, 40, 14, 20, 0, 240, 110, 140, 0, 900, 450, 800]
    assert LAW.form.name == "trilinear" and LAW.with_beta(2 * LAW.beta).form == LAW.form
    assert HypoelasticLaw(LAW.beta).form == CUBIC
    assert LAW.jumps and not HypoelasticLaw(LAW.beta).jumps
    with pytest.raises(ValueError, match="read-only"):
        LAW.form.breaks[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        LAW.pieces[0, 0, 0] = 1.0


@pytest.mark.parametrize("name", COMPONENTS)
def test_moduli_by_region(name: str) -> None:
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
def test_a_range_that_ends_before_a_break_never_reaches_it(
    end: float, strain: float, expected: float
) -> None:
    law = HypoelasticLaw.trilinear(E1, E2, G12, BREAKS, NU, [end, 0.2, 0.2])
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
def test_rows_times_coefficients_are_the_modulus(
    name: str, strain: np.ndarray, trilinear: bool
) -> None:
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
def test_a_warp_bar_has_the_exact_stress_in_any_number_of_increments(
    steps: int, end: float
) -> None:
    path = np.linspace(0, 1, steps + 1)[:, None] * [end, -NU * end, 0.0]
    assert follow(LAW, path) == pytest.approx([integral("E1", end), 0, 0], rel=1e-12, abs=1e-12)


@STEPS
@pytest.mark.parametrize("end", [0.01, 0.05, 0.06, 0.2])
def test_a_fill_bar_has_the_exact_stress_in_any_number_of_increments(
    steps: int, end: float
) -> None:
    along = np.linspace(0, end, steps + 1)
    # The warp gets shorter, where E1 is constant: d eps1 = -nu12 E2/E1 d eps2.
    across = [-NU * integral("E2", x) / E1[0] for x in along]
    path = np.column_stack([across, along, np.zeros(steps + 1)])
    assert follow(LAW, path) == pytest.approx([0, integral("E2", end), 0], rel=1e-12, abs=1e-12)


@given(st.lists(st.floats(-0.1, 0.1), min_size=1, max_size=8), st.sampled_from(sorted(COMPONENTS)))
@example([0.1, -0.1, 0.01, 0.01, 0.04], "G12")
def test_any_path_of_one_strain_ends_on_the_curve(strains: list[float], name: str) -> None:
    """Loading, unloading, reversal: there is one stress for each strain (nu12 = 0: no coupling)."""
    law = HypoelasticLaw.trilinear(E1, E2, G12, BREAKS, 0.0)
    component = COMPONENTS[name]
    path = np.zeros((len(strains) + 1, 3))
    path[1:, component] = strains
    expected = np.zeros(3)
    expected[component] = integral(name, strains[-1])
    assert follow(law, path) == pytest.approx(expected, rel=1e-10, abs=1e-10)


strains = arrays(float, 3, elements=st.floats(-0.12, 0.12))


@given(strains, strains)
def test_shear_sign_symmetry(first: np.ndarray, second: np.ndarray) -> None:
    mirror, path = np.array([1.0, 1.0, -1.0]), np.array([np.zeros(3), first, second])
    assert follow(LAW, path * mirror) == pytest.approx(follow(LAW, path) * mirror, abs=1e-12)


@given(strains, strains)
def test_there_and_back_leaves_no_stress(first: np.ndarray, second: np.ndarray) -> None:
    path = np.array([np.zeros(3), first, second, first, np.zeros(3)])
    assert follow(LAW, path) == pytest.approx(np.zeros(3), abs=1e-10)


@given(strains, strains)
def test_equal_moduli_are_the_linear_law(first: np.ndarray, second: np.ndarray) -> None:
    law = HypoelasticLaw.trilinear([300.0] * 3, [220.0] * 3, [5.0] * 3, BREAKS, NU)
    path = np.array([np.zeros(3), first, second])
    expected = follow(HypoelasticLaw.linear(300.0, 220.0, 5.0, NU), path)
    assert follow(law, path) == pytest.approx(expected, rel=1e-12, abs=1e-12)


# The mean over an increment


small = st.floats(-0.12, 0.12)


@given(st.sampled_from(sorted(COMPONENTS)), small, small)
def test_the_mean_and_its_derivatives(name: str, x: float, x_old: float) -> None:
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
def test_shares_are_the_derivatives_by_the_coefficients(h: np.ndarray, h_old: np.ndarray) -> None:
    for name, component in COMPONENTS.items():
        weights = np.full((3, 4), np.nan)
        x, x_old = h[component], h_old[component]
        first, stop = by_pieces(LAW.pieces, component, x, x_old, weights)
        shares = weights[first:stop, 3]
        assert (shares >= 0).all() and shares.sum() == pytest.approx(1.0)
        mean = increment(LAW, name, x, x_old)[0]
        assert shares @ LAW.pieces[component, first:stop, 4] == pytest.approx(mean, rel=1e-13)


@pytest.mark.parametrize("name", COMPONENTS)
@pytest.mark.parametrize("break_at", [0, 1])
def test_the_stress_does_not_jump_at_a_break(name: str, break_at: int) -> None:
    at, old = BREAKS[COMPONENTS[name], break_at], 0.005
    around = [increment(LAW, name, at + s, old)[0] * (at + s - old) for s in (-1e-12, 0, 1e-12)]
    assert np.ptp(around) < 4e-12 * max(VALUES[name])


@pytest.mark.parametrize("strain", [0.0, 0.01, -0.01, 0.05, 0.1])
@pytest.mark.parametrize("change", [0.0, 1e-14, -1e-14, 3e-12])
def test_no_change_of_strain_has_the_modulus_of_the_point(strain: float, change: float) -> None:
    for name in COMPONENTS:
        mean, ahead, behind = increment(LAW, name, strain + change, strain)
        near = LAW.modulus(name, np.array([strain, strain + change]))
        assert near.min() - 1e-9 <= mean <= near.max() + 1e-9
        if abs(change) < 1e-12:
            assert ahead == behind == 0


# Tangents


def away_from_breaks(strain: np.ndarray) -> np.ndarray:
    """Rows in which no strain is where a tangent jumps."""
    size = np.abs(strain[..., None])
    return (np.abs(size - BREAKS).min(axis=-1) > 1e-5).all(axis=-1)


def test_law_tangent_against_finite_differences() -> None:
    random = np.random.default_rng(3)
    old, new = random.uniform(-0.09, 0.09, (2, 400, 3))
    stress = random.standard_normal((400, 3))
    keep = away_from_breaks(new)
    old, new, stress = old[keep], new[keep], stress[keep]
    inside = np.array([
        [LAW.modulus_rows(n, h[:, c]).argmax(axis=1) for n, c in COMPONENTS.items()]
        for h in (old, new)
    ])  # fmt: skip
    assert (inside[0] != inside[1]).mean() > 0.3  # many straddle a break
    _, tangent = LAW.increment(old, new, stress)
    step = 1e-7
    for j in range(3):
        shift = step * np.eye(3)[j]
        ahead, behind = (LAW.increment(old, new + s, stress)[0] for s in (shift, -shift))
        assert tangent[:, :, j] == pytest.approx(
            (ahead - behind) / (2 * step), abs=1e-6 * np.abs(tangent).max()
        )


@pytest.mark.parametrize("thickness_change", ["constant", "incompressible"])
def test_pk2_tangent_against_finite_differences(thickness_change: str) -> None:
    law = HypoelasticLaw.trilinear(E1, E2, G12, BREAKS, NU, None, thickness_change)
    random = np.random.default_rng(0)
    f = np.eye(2) + 0.1 * random.standard_normal((60, 2, 2))
    old, stress = 0.03 * random.random((60, 3)), random.standard_normal((60, 3))
    right = f.transpose(0, 2, 1) @ f
    _, tangent, strain, _ = law.second_piola_kirchhoff(f, old, stress)
    keep = away_from_breaks(strain)
    assert keep.sum() > 40
    step = 1e-6
    for j, direction in enumerate([[[2, 0], [0, 0]], [[0, 0], [0, 2]], [[0, 1], [1, 0]]]):
        shift = step * np.array(direction, dtype=float)
        ahead, behind = (
            # Any gradient with this C will do: its transposed Cholesky factor.
            law.second_piola_kirchhoff(np.linalg.cholesky(c).transpose(0, 2, 1), old, stress)[0]
            for c in (right + shift, right - shift)
        )
        expected = (ahead - behind) / (2 * step)
        off = np.abs(tangent[:, :, j] - expected)[keep].max()
        assert off < 1e-6 * np.abs(tangent).max()


@given(arrays(float, (3, 3, 2), elements=st.floats(-3, 3)))
@settings(max_examples=50)
def test_any_gradient_gives_finite_numbers_or_nan_rows(f: np.ndarray) -> None:
    s, tangent, strain, stress = LAW.second_piola_kirchhoff(f)
    for i in range(3):
        parts = [s[i], tangent[i], strain[i], stress[i]]
        assert all(np.isnan(p).all() for p in parts) or all(np.isfinite(p).all() for p in parts)


def test_nan_and_moduli_that_are_not_positive_give_nan() -> None:
    stress, tangent = LAW.increment(np.zeros(3), [0.01, np.nan, 0.0], np.zeros(3))
    assert np.isnan(stress).all() and np.isnan(tangent).all()
    law = HypoelasticLaw.trilinear(E1, (140.0, -300.0, 240.0), G12, BREAKS, NU)
    assert np.isfinite(law.increment(np.zeros(3), [0.0, 0.02, 0.0], np.zeros(3))[0]).all()
    assert np.isnan(law.increment(np.zeros(3), [0.0, 0.05, 0.0], np.zeros(3))[0]).all()


# Positivity


@given(arrays(float, 3, elements=st.floats(0.005, 0.5)))
def test_positivity_rows_see_every_region_that_the_range_reaches(ends: np.ndarray) -> None:
    rows = moduli_on_grid(TriLinear.at(BREAKS), list(ends))
    law = HypoelasticLaw.trilinear(E1, E2, G12, BREAKS, NU, ends)
    for name, component in COMPONENTS.items():
        assert rows[name].shape == (GRID, 12)
        values = rows[name] @ law.beta
        assert values[0] == VALUES[name][0] and values[-1] == law.modulus(name, 10.0)
        reached = 1 + (BREAKS[component] < ends[component] * (1 - 1e-9)).sum()
        assert len(set(values)) >= reached


# Bad input


BAD_BREAKS = [
    np.zeros((3, 2)),
    [[0.03, 0.01]] * 3,
    [[0.01, 0.01]] * 3,
    [[-0.01, 0.01]] * 3,
    [[0.01, np.inf]] * 3,
    [[0.01, np.nan]] * 3,
    [[0.01, 0.02]] * 2,
    [0.01, 0.02],
    [[0.01, 0.02], [0.01], [0.01, 0.02]],
    "none",
]


@pytest.mark.parametrize("breaks", BAD_BREAKS)
def test_bad_breaks_are_named(breaks: object) -> None:
    with pytest.raises(InputError, match="increasing strains") as caught:
        HypoelasticLaw.trilinear(E1, E2, G12, breaks)
    assert caught.value.field == "breaks" and "\n" not in str(caught.value)


@pytest.mark.parametrize("place", [0, 4, 8])
def test_a_coefficient_that_the_law_does_not_have_is_named(place: int) -> None:
    beta = LAW.beta.copy()
    beta[place] = 1.0
    with pytest.raises(InputError, match=f"trilinear law has no beta_{place}") as caught:
        LAW.with_beta(beta)
    assert caught.value.field == "beta"


def test_two_moduli_are_too_few() -> None:
    with pytest.raises(InputError, match="E2"):
        HypoelasticLaw.trilinear(E1, (1.0, 2.0), G12, BREAKS)
