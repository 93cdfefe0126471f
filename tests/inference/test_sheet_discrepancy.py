"""inference/sheet_discrepancy.py: smooth misfit of fields against their noise."""

import numpy as np
import pytest
from bubblefit.inference.discrepancy import DISCREPANCY, Discrepancy, notes_of_discrepancies
from bubblefit.inference.sheet_discrepancy import sheet_discrepancy, smooth_shapes
from scipy.ndimage import gaussian_filter

SIDE, BLOCKS = 32, 9
PLACES = 4.0 * np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2)
SHAPES = smooth_shapes(PLACES)
NO_DOUBT = [np.zeros(SIDE**2)] * BLOCKS


def smooth_noise(random, width, size=0.02):
    fields = random.standard_normal((BLOCKS, SIDE, SIDE))
    if width:
        fields = np.array([gaussian_filter(one, width, mode="wrap") for one in fields])
    return [size * one.reshape(-1) / one.std() for one in fields]


def judged(blocks, doubts=NO_DOUBT, unknowns=3):
    found = sheet_discrepancy(blocks, doubts, [PLACES] * BLOCKS, unknowns, "mm")
    assert found is not None
    return found


@pytest.mark.parametrize("width", [0.0, 0.7])
def test_sheet_discrepancy_rejects_pure_noise_once_in_a_hundred(width):
    random = np.random.default_rng(4)
    told = 0
    for _ in range(50):
        blocks = smooth_noise(random, width)
        for k in range(3):
            blocks[k] = blocks[k] - SHAPES[:, k] * (SHAPES[:, k] @ blocks[k])
        told += judged(blocks).is_significant
    assert told <= 3  # more in one of 600 such tests, if one of a hundred is told


def test_smooth_field_below_the_noise_is_a_sheet_discrepancy():
    """0.005 mm of one shape in every block, beside noise of 0.02 mm."""
    random, shape = np.random.default_rng(6), 0.005 * SHAPES[:, 7] * SIDE
    told = [judged([b + shape for b in smooth_noise(random, 0.0)]) for _ in range(6)]
    assert all(one.is_significant for one in told)
    assert np.mean([one.rms for one in told]) == pytest.approx(0.005, rel=0.2)
    # What the mesh may be answerable for is none.
    found = judged([b + shape for b in smooth_noise(random, 0.0)], [shape] * BLOCKS)
    assert not found.is_significant and found.rms < 0.003


def test_sheet_discrepancy_does_not_depend_on_sizes_of_blocks():
    blocks = smooth_noise(np.random.default_rng(1), 0.7)
    scaled = [k * block for k, block in enumerate(blocks, start=1)]
    assert judged(scaled).f_ratio == pytest.approx(judged(blocks).f_ratio, rel=1e-12)


def test_sheet_with_too_few_values_has_no_discrepancy():
    for few, places, unknowns in (
        (np.arange(20.0), PLACES[:20], 3),
        (np.zeros(SIDE**2), PLACES, 3),
        (smooth_noise(np.random.default_rng(0), 0.0)[0], PLACES, 15),
    ):
        assert sheet_discrepancy([few], [np.zeros(len(few))], [places], unknowns, "mm") is None


def test_note_of_a_discrepancy_needs_relevance():
    found = {
        "bubble": Discrepancy(22.6, 1.25, 0.036, "mm"),
        "other": Discrepancy(1.2, 1.25, 0.001, "mm"),
        "computed": Discrepancy(61.8, 1.66, 2e-8, "mm", noise_of_mean=4e-4),
    }
    (note,) = notes_of_discrepancies(found)
    assert (note.kind, note.of) == (DISCREPANCY, "bubble")
    assert "0.036 mm " in note and "22.6 times" in note and "1.25 in " in note


def test_smooth_shapes_are_orthonormal_and_contain_quartics():
    assert SHAPES.T @ SHAPES == pytest.approx(np.eye(45), abs=1e-12)
    x, y = PLACES.T
    quartic = x**3 * y - 2 * y**4 + x
    inside = SHAPES[:, :15] @ (SHAPES[:, :15].T @ quartic)
    assert inside == pytest.approx(quartic, rel=1e-9, abs=1e-5)
