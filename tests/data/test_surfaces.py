"""Polynomial surfaces fitted to displacement fields."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from bubblefit.readers.fields import DisplacementField, read_fields
from bubblefit.readers.surfaces import (
    AXES,
    DisplacementSurface,
    fit_surface,
    read_surfaces,
    write_surfaces,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from ..complaints import complaint


def equation_4_4(c: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Eq. 4.4, written out."""
    return (
        c[0] * x**4 * y**4 + c[1] * x**3 * y**4 + c[2] * x**2 * y**4 + c[3] * x * y**4
        + c[4] * y**4
        + c[5] * x**4 * y**3 + c[6] * x**3 * y**3 + c[7] * x**2 * y**3 + c[8] * x * y**3
        + c[9] * y**3
        + c[10] * x**4 * y**2 + c[11] * x**3 * y**2 + c[12] * x**2 * y**2 + c[13] * x * y**2
        + c[14] * y**2
        + c[15] * x**4 * y + c[16] * x**3 * y + c[17] * x**2 * y + c[18] * x * y
        + c[19] * y
        + c[20] * x**4 + c[21] * x**3 + c[22] * x**2 + c[23] * x + c[24]
    )  # fmt: skip


def on_a_disk(count: int, seed: int, radius: float = 100.0) -> np.ndarray:
    """Points (count, 2) spread evenly."""
    random = np.random.default_rng(seed)
    r, angle = radius * np.sqrt(random.random(count)), 2 * np.pi * random.random(count)
    return np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)


def test_coefficients_stand_in_the_order_of_equation_4_4():
    random = np.random.default_rng(4)
    c = random.standard_normal((3, 25))
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
    random = np.random.default_rng(seed)
    terms = random.standard_normal((3, degree + 1, degree + 1))

    def exact(points):
        return np.polynomial.polynomial.polyval2d(*(points / radius).T, terms.transpose(1, 2, 0)).T

    points = on_a_disk(600, seed, radius)
    surface = fit_surface(DisplacementField(0.1, points, exact(points)), min(degree + extra, 8))
    elsewhere = on_a_disk(100, seed + 1, 0.9 * radius)
    np.testing.assert_allclose(surface.evaluate(elsewhere), exact(elsewhere), atol=1e-8)
    np.testing.assert_allclose(surface.r_squared, 1.0, atol=1e-10)


def test_r_squared_is_the_share_explained():
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


def test_points_that_do_not_settle_the_coefficients():
    few = on_a_disk(24, 1)
    field = DisplacementField(0.022, few, np.zeros((24, 3)))
    message = complaint(fit_surface, field, 4)
    assert "degree 4 at 22 kPa" in message
    assert "25 coefficients need as many points, there are 24" in message
    line = np.stack([np.linspace(-1, 1, 100), np.zeros(100)], axis=1)
    message = complaint(fit_surface, DisplacementField(0.022, line, np.zeros((100, 3))), 4)
    assert "5 of 25 coefficients" in message
    for degree in (-1, 13):
        assert complaint(fit_surface, field, degree).startswith("degree")


@pytest.fixture
def surfaces() -> tuple[DisplacementSurface, ...]:
    random = np.random.default_rng(8)
    points = on_a_disk(400, 2)
    return tuple(
        fit_surface(DisplacementField(p, points, random.standard_normal((400, 3))), degree)
        for p, degree in ((0.022, 4), (0.097, 0), (0.3, 8))
    )


def test_surface_files_come_back(tmp_path, surfaces):
    path = tmp_path / "surfaces.csv"
    write_surfaces(surfaces, path)
    back = read_surfaces(path)
    assert len(back) == 3
    for read, written in zip(back, surfaces, strict=True):
        assert (read.pressure, read.degree) == (written.pressure, written.degree)
        assert read.scale == written.scale
        np.testing.assert_array_equal(read.r_squared, written.r_squared)
        np.testing.assert_allclose(read.coefficients, written.coefficients, rtol=1e-14)
        points = on_a_disk(50, 6)
        np.testing.assert_allclose(read.evaluate(points), written.evaluate(points), atol=1e-11)


def test_surface_files_are_plain_equation_4_4_in_mm(tmp_path, surfaces):
    path = tmp_path / "surfaces.csv"
    write_surfaces(surfaces[:1], path)
    with open(path, newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["direction"] for row in rows] == list(AXES)
    assert list(rows[0])[:6] == ["pressure_MPa", "direction", "R2", "degree", "scale_mm", "C0"]
    points = on_a_disk(20, 9)
    by_hand = [
        equation_4_4(np.array([float(row[f"C{i}"]) for i in range(25)]), *points.T) for row in rows
    ]
    np.testing.assert_allclose(np.transpose(by_hand), surfaces[0].evaluate(points), atol=1e-10)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("direction", "way", "column 'direction': this column is missing"),
        ("0.022,y", "0.022,x", "in the order x, y, z"),
        ("0.022,y", "0.023,y", "line 3, column 'pressure_MPa': expected the same number"),
        ("C24", "C25", "column 'C24': this column is missing"),
        ("pressure_MPa", "pressure_MPa\n#", "expected"),
        (None, "1e300", "line 2: coefficients too large for a scale of"),
        ("C0,C1", "C0,C0", "column 'C0': this column appears twice"),
    ],
)
def test_a_damaged_surface_file_is_refused(tmp_path, surfaces, old, new, words):
    path = tmp_path / "surfaces.csv"
    write_surfaces(surfaces[:1], path)
    text = path.read_text()
    old = old or text.splitlines()[1].split(",")[5]  # C0 of x
    assert old in text
    path.write_text(text.replace(old, new, 1))
    message = complaint(read_surfaces, path)
    assert "surfaces.csv" in message
    assert words in message


@settings(deadline=None)
@given(column=st.integers(0, 29), cell=st.sampled_from(["", "nan", "w", "-1", "1e30", "2.5"]))
def test_any_bad_cell_in_a_surface_file_is_refused_or_a_number(tmp_path_factory, column, cell):
    path = tmp_path_factory.getbasetemp() / "bad-surfaces.csv"
    points = on_a_disk(60, 2)
    write_surfaces([fit_surface(DisplacementField(0.1, points, np.ones((60, 3))), 4)], path)
    lines = [line.split(",") for line in path.read_text().splitlines()]
    lines[2][column] = cell
    path.write_text("\n".join(map(",".join, lines)))
    numeric = cell not in ("", "nan", "w")
    # R^2 and the coefficients may be any number; what the three rows share may not change.
    if numeric and column not in (0, 1, 3, 4):
        read_surfaces(path)
    else:
        assert "bad-surfaces.csv" in complaint(read_surfaces, path)


def test_real_fields_are_followed_better_by_higher_degrees(shared_data):
    path = shared_data / "bubble/grid/test1_11.csv"
    (field,) = read_fields([path], [0.1372402], flag_column="flag")
    r_squared = np.array([fit_surface(field, d).r_squared for d in (2, 4, 6, 8)])
    assert (np.diff(r_squared, axis=0) > 0).all()
    # The thesis has 0.92 to 0.997 on its own DIC fields with degree 4 (Table 5.3).
    assert (r_squared[1] > 0.99).all()
