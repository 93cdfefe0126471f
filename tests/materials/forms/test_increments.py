"""The modulus of one increment, for every form: its mean, its derivatives, exact stresses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.forms.base import COMPONENTS, map_in_range
from bubblefit.materials.point_law import by_pieces, increment_modulus, point_modulus
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from ..paths import follow
from .pieces_of_laws import LAWS, integral, turning_points

FORMS = pytest.mark.parametrize("form", LAWS)
STEPS = pytest.mark.parametrize("steps", [1, 2, 7, 50])
names = st.sampled_from(sorted(COMPONENTS))
forms = st.sampled_from(sorted(LAWS))
strains = st.floats(-0.2, 0.2)


def mean_of(form: str, name: str, x: float, x_old: float) -> tuple[float, float, float]:
    return increment_modulus(LAWS[form].pieces, COMPONENTS[name], x, x_old)


@settings(max_examples=400, deadline=None)
@given(forms, names, strains, strains)
@example("spline", "G12", 0.2, -0.2)
@example("trilinear", "E1", 0.03, 0.01)
def test_the_mean_is_the_integral_over_the_increment(
    form: str, name: str, x: float, x_old: float
) -> None:
    law = LAWS[form]
    mean, ahead, behind = mean_of(form, name, x, x_old)
    assert mean == pytest.approx(mean_of(form, name, x_old, x)[0], rel=1e-14)
    assume(abs(x - x_old) > 1e-9)
    assert mean == pytest.approx(integral(law, name, x_old, x) / (x - x_old), rel=1e-9)
    # Whatever the path between the two ends is made of, the moduli there bound the mean.
    way = np.concatenate([np.linspace(x_old, x, 200), turning_points(law, name)])
    way = way[(way >= min(x, x_old)) & (way <= max(x, x_old))]
    moduli = law.modulus(name, way)
    room = 1e-3 * moduli.max()
    assert moduli.min() - room <= mean <= moduli.max() + room
    # d(stress)/d(strain) is the modulus at the end of the increment.
    end = float(law.modulus(name, x))
    assert mean + (x - x_old) * ahead == pytest.approx(end, rel=1e-9)
    assume(x_old not in turning_points(law, name))  # there it may jump, and the way tells
    start = float(law.modulus(name, x_old))
    assert mean - (x - x_old) * behind == pytest.approx(start, rel=1e-9)


@settings(deadline=None)
@given(forms, names, strains, strains, strains)
def test_two_increments_make_the_stress_of_one(
    form: str, name: str, a: float, b: float, c: float
) -> None:
    rise = [mean_of(form, name, y, x)[0] * (y - x) for x, y in ((a, b), (b, c), (a, c))]
    assert rise[0] + rise[1] == pytest.approx(rise[2], rel=1e-12, abs=1e-12)


@settings(max_examples=400, deadline=None)
@given(forms, names, strains, strains)
def test_derivatives_against_finite_differences(
    form: str, name: str, x: float, x_old: float
) -> None:
    law, step = LAWS[form], 1e-6
    near = turning_points(law, name)
    assume(np.abs(np.subtract.outer([x, x_old], near)).min() > 2 * step)
    assume(abs(x - x_old) > 1e-3)
    _, ahead, behind = mean_of(form, name, x, x_old)
    size = 1e-5 * float(law.pieces[COMPONENTS[name], 0, 4]) / abs(x - x_old)
    by_new = [mean_of(form, name, x + s, x_old)[0] for s in (step, -step)]
    assert ahead == pytest.approx((by_new[0] - by_new[1]) / (2 * step), rel=1e-4, abs=size)
    by_old = [mean_of(form, name, x, x_old + s)[0] for s in (step, -step)]
    assert behind == pytest.approx((by_old[0] - by_old[1]) / (2 * step), rel=1e-4, abs=size)


@settings(deadline=None)
@given(forms, names, strains, st.sampled_from([0.0, 1e-18, -1e-15, 1e-13, 1e-10, -1e-8, 1e-7]))
def test_small_increments_lose_no_digits(form: str, name: str, x: float, change: float) -> None:
    """Inside a piece, mean and half slopes are those of the point, however small the change."""
    law, component = LAWS[form], COMPONENTS[name]
    near = turning_points(law, name)
    assume(np.abs(x - near).min() > 1e-6)
    mean, ahead, behind = mean_of(form, name, x + change, x)
    assert mean == pytest.approx(point_modulus(law.pieces, component, x + change / 2), rel=1e-12)
    step = 1e-7
    half = (law.modulus(name, x + step) - law.modulus(name, x - step)) / (4 * step)
    scale = 1e-6 * float(law.pieces[component, :, 4].max()) / step * 1e-3
    assert [ahead, behind] == pytest.approx([half, half], rel=1e-4, abs=scale)


@settings(max_examples=400, deadline=None)
@given(forms, names, strains, strains)
@example("trilinear", "E1", 0.01, 0.01)
@example("trilinear", "E1", 0.01 + 1e-13, 0.01 - 1e-13)
@example("spline", "G12", 0.0, 0.0)
@example("cubic", "E2", 0.13, 0.13)
@example("cubic", "G12", -0.2, 0.15)
def test_rows_by_piece_are_the_derivatives_by_the_coefficients(
    form: str, name: str, x: float, x_old: float
) -> None:
    law, component = LAWS[form], COMPONENTS[name]
    weights = np.full((law.pieces.shape[1], 4), np.nan)
    first, stop = by_pieces(law.pieces, component, x, x_old, weights)
    rows = map_in_range(law.form, law.strain_range)[component, first:stop]
    mean = mean_of(form, name, x, x_old)[0]
    assert weights[first:stop, 3].sum() == pytest.approx(1.0)
    by_beta = np.einsum("ki,kij->j", weights[first:stop], rows)
    assert by_beta @ law.beta == pytest.approx(mean, rel=1e-9)


@FORMS
@pytest.mark.parametrize("name", COMPONENTS)
def test_stress_is_continuous_where_a_piece_ends(form: str, name: str) -> None:
    law = LAWS[form]
    for at in turning_points(law, name):
        for old in (-0.17, 0.0, 0.005, 0.15):
            rises = [
                mean_of(form, name, at + s, old)[0] * (at + s - old) for s in (-1e-12, 0, 1e-12)
            ]
            assert np.ptp(rises) < 3e-12 * law.modulus(name, np.linspace(0, 0.2, 99)).max()


@pytest.mark.parametrize("bad", [(np.nan, 0.0), (0.0, np.nan), (np.nan, np.nan), (np.nan, 0.5)])
@FORMS
def test_what_is_no_number_gives_none(form: str, bad: tuple[float, float]) -> None:
    for name in COMPONENTS:
        assert np.isnan(mean_of(form, name, *bad)[0])


@FORMS
@STEPS
@pytest.mark.parametrize("end", [0.005, 0.06, 0.11, 0.16])
def test_bars_are_exact_in_any_number_of_increments(form: str, steps: int, end: float) -> None:
    """Along the warp and along the fill; E of the yarn across is held, because it gets shorter."""
    law = LAWS[form]
    along = np.linspace(0.0, end, steps + 1)
    path = np.column_stack([along, -law.nu12 * along, 0 * along])
    warp = integral(law, "E1", 0.0, end)
    assert follow(law, path) == pytest.approx([warp, 0, 0], rel=1e-10, abs=1e-10)
    across = [-law.nu12 * integral(law, "E2", 0.0, x) / law.E1(0.0) for x in along]
    path = np.column_stack([across, along, 0 * along])
    fill = integral(law, "E2", 0.0, end)
    assert follow(law, path) == pytest.approx([0, fill, 0], rel=1e-10, abs=1e-10)


@FORMS
@settings(max_examples=50, deadline=None)
@given(names, st.lists(strains, min_size=1, max_size=6))
def test_any_path_of_one_strain_ends_on_the_curve(form: str, name: str, path: list[float]) -> None:
    """Loading, unloading, reversal: one stress for each strain (without Poisson's ratio)."""
    law, component = replace(LAWS[form], nu12=0.0), COMPONENTS[name]
    whole = np.zeros((len(path) + 1, 3))
    whole[1:, component] = path
    expected = np.zeros(3)
    expected[component] = integral(law, name, 0.0, path[-1])
    assert follow(law, whole) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@FORMS
def test_the_tangent_of_the_law_is_that_of_its_stress(form: str) -> None:
    law, step = LAWS[form], 1e-7
    random = np.random.default_rng(3)
    old, new = random.uniform(-0.15, 0.15, (2, 300, 3))
    stress = random.standard_normal((300, 3))
    near = [np.abs(np.subtract.outer(new[:, c], turning_points(law, n))).min(axis=1)
            for n, c in COMPONENTS.items()]  # fmt: skip
    keep = (np.array(near) > 1e-5).all(axis=0)
    assert keep.sum() > 200
    old, new, stress = old[keep], new[keep], stress[keep]
    _, tangent = law.increment(old, new, stress)
    for j in range(3):
        shift = step * np.eye(3)[j]
        ahead, behind = (law.increment(old, new + s, stress)[0] for s in (shift, -shift))
        off = tangent[:, :, j] - (ahead - behind) / (2 * step)
        assert np.abs(off).max() < 1e-6 * np.abs(tangent).max()
