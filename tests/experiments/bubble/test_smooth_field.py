"""experiments/bubble/smooth_field.py: fitted polynomials and small misalignments."""

import numpy as np
import pytest
from bubblefit.experiments.bubble.smooth_field import (
    SmoothField,
    smooth_strains,
    tilt_rotation,
)

POSITIONS = np.random.default_rng(3).uniform(-80.0, 80.0, (600, 2))


def cubic_field(positions):
    x, y = positions.T / 80.0
    return np.column_stack([x**3 - x * y, y**2 + 0.5 * x, 3 - x**2 * y])


def test_polynomials_of_the_degree_are_recovered():
    field = SmoothField.through(POSITIONS, cubic_field(POSITIONS), max_degree=3)
    places = np.array([[0.0, 0.0], [30.0, -50.0], [-70.0, 10.0]])
    fitted = field.shapes(places) @ field.amplitudes
    np.testing.assert_allclose(fitted, cubic_field(places), atol=1e-10)


def test_growth_is_the_change_from_shifted_positions():
    field = SmoothField.through(POSITIONS, cubic_field(POSITIONS), max_degree=3)
    shift = np.array([2.0, -1.0])
    change = cubic_field(POSITIONS) - cubic_field(POSITIONS - shift)
    np.testing.assert_allclose(field.growth(shift), change, atol=1e-10)
    np.testing.assert_allclose(field.growth(np.zeros(2)), 0.0, atol=1e-12)


@pytest.mark.parametrize("shift", [np.zeros(2), np.array([2.0, -1.0])])
def test_slopes_are_derivatives_at_shifted_positions(shift):
    field = SmoothField.through(POSITIONS, cubic_field(POSITIONS), max_degree=3)
    step = 1e-3
    for slope, along in zip(field.slopes(shift), step * np.eye(2), strict=True):
        ahead, behind = (cubic_field(POSITIONS - shift + s * along) for s in (1, -1))
        np.testing.assert_allclose(slope, (ahead - behind) / (2 * step), atol=1e-6)


@pytest.mark.parametrize(("count", "terms"), [(600, 81), (100, 25), (12, 4), (5, 4)])
def test_degree_is_lower_where_there_are_few_points(count, terms):
    field = SmoothField.through(POSITIONS[:count], cubic_field(POSITIONS[:count]))
    assert field.amplitudes.shape == (terms, 3)


def test_tilt_is_a_rotation_with_exact_derivatives():
    degrees, step = np.array([1.5, -2.0]), 1e-4
    rotation, slopes = tilt_rotation(degrees)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    for slope, along in zip(slopes, step * np.eye(2), strict=True):
        ahead, behind = (tilt_rotation(degrees + s * along)[0] for s in (1, -1))
        np.testing.assert_allclose(slope, (ahead - behind) / (2 * step), atol=1e-9)


def test_tilt_turns_about_x_then_stays_in_the_plane_of_y_and_z():
    rotation, _ = tilt_rotation(np.array([90.0, 0.0]))
    np.testing.assert_allclose(rotation @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-15)
    rotation, _ = tilt_rotation(np.array([0.0, 90.0]))
    np.testing.assert_allclose(rotation @ [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], atol=1e-15)


def test_strain_of_an_inclined_sheet_follows_its_yarns():
    """A plane sheet that rises along x is stretched along its warp and sheared in its plane."""
    x, y = POSITIONS.T
    along_warp = np.array([0.8, 0.0, 0.6])
    rest = np.column_stack([x, y, 0.75 * x])
    offset = np.array([1.0, 2.0, 3.0])
    stretch = 0.1 * (rest @ along_warp)[:, None] * along_warp + offset
    shear = 0.2 * y[:, None] * along_warp
    pulled, sheared = smooth_strains(POSITIONS, rest[:, 2], [stretch, shear])
    np.testing.assert_allclose(pulled, np.tile([np.log(1.1), 0, 0], (len(x), 1)), atol=1e-9)
    gradient = np.array([[1.0, 0.2], [0.0, 1.0]])
    values, axes = np.linalg.eigh(gradient.T @ gradient)
    strain = axes @ np.diag(0.5 * np.log(values)) @ axes.T
    closed_form = [strain[0, 0], strain[1, 1], 2 * strain[0, 1]]
    np.testing.assert_allclose(sheared, np.tile(closed_form, (len(x), 1)), atol=1e-9)


def test_strain_is_counted_along_a_turned_warp():
    x, y = POSITIONS.T
    pulled = 0.1 * np.column_stack([x, 0 * y, 0 * x])
    (strain,) = smooth_strains(POSITIONS, 0 * x, [pulled], np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(strain, np.tile([0, np.log(1.1), 0], (len(x), 1)), atol=1e-9)
