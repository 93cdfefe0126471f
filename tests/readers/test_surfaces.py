"""Surfaces, spheres, outlines and regions of measured points."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.apex import apex_of, apex_shape
from bubblefit.experiments.strips.data import strain_regions
from bubblefit.meshes.outline import Outline
from bubblefit.readers.fields import (
    PLAIN,
    DisplacementField,
    DisplacementSurface,
    fit_surface,
    read_fields,
    surface_table,
)
from bubblefit.readers.frames import Frame
from bubblefit.readers.spheres import _fit_algebraic, fit_sphere, points_of
from hypothesis import given, settings
from hypothesis import strategies as st

from ..support.refusals import complaint


def equation_4_4(c: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Eq. 4.4: C0 x^4 y^4 + C1 x^3 y^4 + ... + C24, by falling powers of y, then of x."""
    powers = [(i, j) for j in (4, 3, 2, 1, 0) for i in (4, 3, 2, 1, 0)]
    return sum(own * x**i * y**j for own, (i, j) in zip(c, powers, strict=True))


def on_a_disk(count: int, seed: int, radius: float = 100.0) -> np.ndarray:
    random = np.random.default_rng(seed)
    r, angle = radius * np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    return np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)


def test_coefficients_stand_in_the_order_of_equation_4_4():
    c = np.random.default_rng(4).standard_normal((3, 25))
    points = on_a_disk(300, 1, radius=1.5)
    u = np.stack([equation_4_4(row, *points.T) for row in c], axis=1)
    surface = fit_surface(DisplacementField(0.3, points, u), 4)
    np.testing.assert_allclose(surface.physical, c, atol=1e-10)
    np.testing.assert_allclose(surface.r_squared, 1.0, atol=1e-12)
    assert surface.scale == np.abs(points).max()


@settings(deadline=None, max_examples=40)
@given(
    degree=st.integers(0, 8),
    extra=st.integers(0, 4),
    seed=st.integers(0, 2**32 - 1),
    radius=st.sampled_from([1e-2, 1.0, 100.0, 1e4]),
)
def test_a_polynomial_of_the_degree_is_met_exactly(degree, extra, seed, radius):
    terms = np.random.default_rng(seed).standard_normal((3, degree + 1, degree + 1))

    def exact(points):
        return np.polynomial.polynomial.polyval2d(*(points / radius).T, terms.transpose(1, 2, 0)).T

    points = on_a_disk(600, seed, radius)
    surface = fit_surface(DisplacementField(0.1, points, exact(points)), min(degree + extra, 8))
    elsewhere = on_a_disk(100, seed + 1, 0.9 * radius)
    np.testing.assert_allclose(surface.evaluate(elsewhere), exact(elsewhere), atol=1e-8)
    np.testing.assert_allclose(surface.r_squared, 1.0, atol=1e-10)


def test_r_squared_is_the_share_explained(shared_data):
    points = on_a_disk(2000, 3)
    random = np.random.default_rng(5)
    x = points[:, 0]
    # Noise as large as the signal explains half; a constant direction is met; pure noise is not.
    u = np.stack([x + np.std(x) * random.standard_normal(2000), 0 * x + 3, 0 * x], axis=1)
    surface = fit_surface(DisplacementField(0.1, points, u), 1)
    assert surface.r_squared[0] == pytest.approx(0.5, abs=0.05)
    np.testing.assert_array_equal(surface.r_squared[1:], 1.0)
    u[:, 2] = random.standard_normal(2000)
    assert fit_surface(DisplacementField(0.1, points, u), 1).r_squared[2] < 0.02
    path = shared_data / "bubble/grid/test1_11.csv"
    (field,) = read_fields([path], [0.1372402], replace(PLAIN, flag_column="flag"))
    r_squared = np.array([fit_surface(field, d).r_squared for d in (2, 4, 6, 8)])
    assert (np.diff(r_squared, axis=0) > 0).all()
    # The thesis has 0.92 to 0.997 on its own DIC fields with degree 4 (Table 5.3).
    assert (r_squared[1] > 0.99).all()


@pytest.fixture
def surfaces() -> tuple[DisplacementSurface, ...]:
    random = np.random.default_rng(8)
    points = on_a_disk(400, 2)
    return tuple(
        fit_surface(DisplacementField(p, points, random.standard_normal((400, 3))), degree)
        for p, degree in ((0.022, 4), (0.097, 0), (0.3, 8))
    )


def test_the_table_of_surfaces_has_equation_4_4(surfaces):
    points, table = on_a_disk(50, 6), surface_table(surfaces)
    assert list(table)[:6] == ["pressure_MPa", "direction", "R2", "degree", "scale_mm", "C0"]
    assert table["direction"].tolist() == [*"xyz"] * 3 and table["degree"].tolist()[::3] == [
        4,
        0,
        8,
    ]
    by_hand = [
        equation_4_4(table.loc[row, "C0":"C24"].to_numpy(float), *points.T) for row in (0, 1, 2)
    ]
    np.testing.assert_allclose(np.transpose(by_hand), surfaces[0].evaluate(points), atol=1e-10)
    assert table.loc[3, "C1":].isna().all() and table.loc[6].notna().all()


CENTRE = np.array([12.0, -7.0, 610.0])


def cap(radius: float = 40.0, half: float = 45.0, count: int = 400, seed: int = 0):
    draw = np.random.default_rng(seed)
    height = draw.uniform(np.cos(np.radians(half)), 1.0, count)
    turn = draw.uniform(0, 2 * np.pi, count)
    across = np.sqrt(1 - height**2)
    ways = np.column_stack([across * np.cos(turn), across * np.sin(turn), -height])
    return CENTRE + radius * ways, ways, draw


@settings(max_examples=20, deadline=None, derandomize=True)
@given(st.floats(0.01, 1e4), st.floats(10, 170), st.integers(0, 10**6))
def test_a_perfect_ball_is_found_exactly(radius, half, seed):
    points, _, _ = cap(radius, half, 60, seed)
    found = fit_sphere(points)
    # Places have 16 digits of 610 mm, and a small cap magnifies them.
    rounding = 1e-13 * (1e3 + radius) / np.radians(half) ** 4 * 100
    assert found.radius == pytest.approx(radius, rel=1e-9, abs=rounding)
    np.testing.assert_allclose(found.centre, CENTRE, atol=rounding + 1e-9 * radius)
    assert found.left_out == 0 and found.rms < rounding + 1e-9 * radius
    # The first guess is exact without noise.
    centre, linear = _fit_algebraic(cap(count=12)[0])
    np.testing.assert_allclose([*centre, linear], [*CENTRE, 40.0], rtol=1e-9)


def test_noise_moves_it_as_far_as_is_said():
    sigma, found = 0.05, []
    for seed in range(60):
        points, ways, draw = cap(seed=seed)
        found.append(fit_sphere(points + sigma * draw.normal(size=(len(ways), 1)) * ways))
        assert found[-1].rms == pytest.approx(sigma, rel=0.2)
    errors = np.mean([[one.radius_error, *one.centre_error] for one in found], axis=0)
    scatter = np.std([[one.radius, *one.centre] for one in found], axis=0)
    # 60 repetitions know a standard deviation to 9 %.
    np.testing.assert_allclose(scatter, errors, rtol=0.3)
    assert abs(np.mean([one.radius for one in found]) - 40.0) < 4 * errors[0] / np.sqrt(60)


def test_the_linear_fit_is_too_small_by_noise():
    """By 0.61 mm of 40 in the mean of repetitions, four of whose errors are 0.15 mm."""
    linear, least = [], []
    for seed in range(60):
        points, ways, draw = cap(seed=seed)
        noisy = points + 0.5 * draw.normal(size=(len(ways), 1)) * ways
        linear.append(_fit_algebraic(noisy)[1])
        least.append(fit_sphere(noisy).radius)
    assert np.mean(linear) == pytest.approx(40 * (1 - 0.015), abs=0.15)
    assert np.mean(least) == pytest.approx(40.0, abs=0.15)


def test_outliers_are_left_out():
    points, ways, draw = cap(count=1000)
    points += 0.02 * draw.normal(size=(1000, 1)) * ways
    points[:30] += 3.0 * ways[:30]
    points[30] = [0.0, 0.0, 0.0]
    found = fit_sphere(points)
    assert not found.is_used[:31].any() and found.left_out < 36
    assert found.radius == pytest.approx(40.0, abs=4 * found.radius_error)
    assert found.deviation[5] == pytest.approx(3.0, abs=0.1)
    assert "10 points or more, got 9" in complaint(fit_sphere, cap(count=9)[0])
    flat = np.random.default_rng(0).normal(size=(50, 3)) * [1, 1, 0] + 5.0
    for noise in (0, 1e-2, 1e-4, 1e-7):
        nearly = flat + np.random.default_rng(1).normal(size=(50, 1)) * [0, 0, noise]
        assert "in a plane" in complaint(fit_sphere, nearly)


def test_the_surface_of_a_frame_is_where_its_points_have_moved():
    points, _, _ = cap(count=20)
    still, moved = np.full_like(points, np.nan), np.tile([1.0, 2.0, 3.0], (20, 1))
    np.testing.assert_array_equal(points_of(Frame(points, still)), points)
    moved[4] = np.nan
    expected = np.delete(points, 4, 0) + np.array([1, 2, 3])
    np.testing.assert_allclose(points_of(Frame(points, moved)), expected)


def test_points_that_are_kept_are_those_near_the_sphere_through_them():
    """Within four robust standard deviations, of noise with long tails: it takes some rounds."""
    for seed in range(1, 6):
        points, ways, draw = cap(count=300, seed=seed)
        points += 0.05 * draw.standard_t(2, size=(300, 1)) * ways
        found = fit_sphere(points)
        off, arms = np.abs(found.deviation), points - found.centre
        lengths = np.linalg.norm(arms, axis=1)
        np.testing.assert_array_equal(found.is_used, off <= 4 * np.median(off) / 0.6744897501960817)
        assert 3 < found.left_out < 20
        np.testing.assert_allclose(found.deviation, lengths - found.radius)
        # Least squares: the deviations of what is kept have no mean, and no way to lean.
        left, kept = found.deviation[found.is_used], (arms / lengths[:, None])[found.is_used]
        assert left.sum() == pytest.approx(0.0, abs=1e-8)
        np.testing.assert_allclose(kept.T @ left, 0.0, atol=1e-8)
        assert found.rms == pytest.approx(np.sqrt(np.mean(left**2)))


@settings(max_examples=20)
@given(major=st.floats(1.0, 500.0), ratio=st.floats(0.25, 1.0), angle=st.floats(-90, 90))
def test_places_and_points_of_the_unit_disk_belong_together(major, ratio, angle):
    outline = Outline(major, major * ratio, angle)
    points = np.random.default_rng(1).uniform(-1, 1, (20, 2))
    np.testing.assert_allclose(outline.unit(outline.places(points)), points, atol=1e-12)
    np.testing.assert_allclose(outline.share(outline.places(points)), np.hypot(*points.T))
    np.testing.assert_allclose(outline.share(outline.edge(9)), 1.0)


def test_the_major_axis_lies_at_its_angle_from_the_warp():
    outline = Outline(120.0, 80.0, 30.0)
    along = np.array([np.cos(np.pi / 6), 0.5])
    ends = np.array([120.0 * along, 80.0 * np.array([-along[1], along[0]])])
    np.testing.assert_allclose(outline.share(ends), 1.0)
    assert (np.hypot(*outline.edge(721).T).max(), outline.radius) == pytest.approx((120.0, 100.0))
    assert not outline.round and not outline.doubly_symmetric
    assert Outline(120.0, 80.0, -90.0).doubly_symmetric
    assert outline.words == "semi-axes 120 and 80 mm"
    points = np.random.default_rng(2).uniform(-1, 1, (20, 2))
    for outline in (Outline.circle(80.0), Outline(80.0, 80.0, 33.0)):
        np.testing.assert_array_equal(outline.places(points), 80.0 * points)
        np.testing.assert_array_equal(outline.unit(points), points / 80.0)
        assert outline.round and outline.doubly_symmetric and outline.words == "radius 80 mm"


def test_a_broken_line_gives_its_own_breaks_back():
    strain = np.linspace(0.0, 0.41, 300)[1:]
    load = 900 * strain - 700 * np.maximum(strain - 0.05, 0) + 400 * np.maximum(strain - 0.3, 0)
    # The places of the grid are a hundredth apart.
    assert strain_regions(strain, load) == pytest.approx((0.05, 0.3), abs=0.005)
    # 40 places between zero and the last strain: the first and the last may be breaks, too.
    strain = np.linspace(0.0, 0.41, 83)[1:]
    load = 900 * strain - 700 * np.maximum(strain - 0.01, 0) + 400 * np.maximum(strain - 0.4, 0)
    assert strain_regions(strain, load) == pytest.approx((0.01, 0.40), abs=1e-9)
    strain = np.linspace(0.0, 0.4, 5)
    assert len(strain_regions(strain, strain)) == 2
    for few in (strain[:4], 0 * strain):
        assert f"five points are needed for regions, got {len(few)}" in complaint(
            strain_regions, few, few
        )


RADIUS, PRESSURE = 80.0, 0.05
#: 1/mm, of the paraboloid along x and y; mm, its top; stretch of the sheet along x and y.
CURVED, TOP, STRETCH = (0.004, 0.006), 12.0, (1.02, 1.05)


def dome(noise=0.0, seed=0, count=400, stretch=STRETCH, sign=(1, 1, 1)) -> DisplacementField:
    draw = np.random.default_rng(seed)
    places = RADIUS * draw.uniform(-0.35, 0.35, (count, 2))
    after = places * stretch
    height = TOP - 0.5 * after**2 @ CURVED + noise * draw.standard_normal(count)
    moved = np.column_stack([after - places, height - 3.0])
    return DisplacementField(PRESSURE, places, moved * sign, z=np.full(count, 3.0))


def test_the_apex_of_a_paraboloid():
    found = apex_of(dome(), RADIUS)
    assert (found.pressure, found.height) == (PRESSURE, pytest.approx(TOP - 3.0))
    assert found.curvature == pytest.approx(sum(CURVED))
    assert found.force == pytest.approx(PRESSURE / sum(CURVED))  # 5 N/mm
    assert found.strain == pytest.approx(np.log(STRETCH))
    assert found.stiffness == pytest.approx(5.0 / np.mean(np.log(STRETCH)))
    assert found.error == pytest.approx(0.0, abs=1e-9)
    found = apex_of(replace(dome(sign=(1, 1, -1)), z=None), RADIUS)
    assert found.curvature == pytest.approx(-sum(CURVED))
    assert found.force == found.error == np.inf
    still = apex_of(replace(dome(sign=(0, 0, 1)), z=None), RADIUS)
    assert still.strain == pytest.approx((0.0, 0.0), abs=1e-12)
    assert apex_of(replace(dome(sign=(-1, -1, 1)), z=None), RADIUS).stiffness == np.inf


def test_the_standard_error_is_that_of_repetitions():
    """Of a sheet that is hardly stretched: what the stretch takes from it is not reckoned."""
    found = [apex_of(dome(0.02, seed, stretch=(1.0, 1.001)), RADIUS) for seed in range(200)]
    scatter = np.std([apex.force for apex in found])
    # 200 repetitions know a standard deviation to 5 %.
    assert np.mean([apex.error for apex in found]) == pytest.approx(scatter, rel=0.15)


def test_points_about_the_centre():
    """Thirty: twice as many as a surface of degree four has coefficients; none beyond half way."""
    good = dome(count=30)
    apex_of(good, RADIUS)
    for points in (good.points[1:], np.vstack([good.points[1:], [[0.5 * RADIUS, 0.0]]])):
        moved = np.zeros((len(points), 3))
        few = complaint(apex_of, DisplacementField(PRESSURE, points, moved), RADIUS)
        assert few == "expected 30 points about the centre, got 29"
    values = np.full((31, 1), 2.0)
    values[30] = np.nan
    shape = apex_shape(np.vstack([good.points, [[0.0, 0.0]]]), values, RADIUS)
    assert shape.is_fitted.tolist() == [True] * 30 + [False]
    # x^3 y / 7: its one derivative that is not zero at the centre is 6 / 7.
    x, y = good.points.T
    cubic = apex_shape(good.points, (x**3 * y / 7)[:, None], RADIUS)
    assert cubic.at_centre(3, 1) == pytest.approx([6 / 7])
    assert cubic.at_centre(1, 1) == pytest.approx([0.0], abs=1e-6)
