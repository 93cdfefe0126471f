"""What is too smooth for noise, and how often noise is taken for it."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.inference.misfit import (
    Discrepancy,
    discrepancy,
    notes_of_discrepancies,
    smooth_shapes,
)
from bubblefit.notes import NoteKind
from scipy.ndimage import gaussian_filter

SIDE, BLOCKS = 32, 9
PLACES = 4.0 * np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2)
SHAPES = smooth_shapes(PLACES)
NO_DOUBT = [np.zeros(SIDE**2)] * BLOCKS


def noise(random: np.random.Generator, width: float, size: float = 0.02) -> list[np.ndarray]:
    """Blocks of noise that is alike over a Gaussian of `width` steps."""
    fields = random.standard_normal((BLOCKS, SIDE, SIDE))
    if width:
        fields = np.array([gaussian_filter(one, width, mode="wrap") for one in fields])
    return [size * one.reshape(-1) / one.std() for one in fields]


def judged(blocks: list[np.ndarray], doubts: list[np.ndarray] = NO_DOUBT, unknowns: int = 3):
    found = discrepancy(blocks, doubts, [PLACES] * BLOCKS, unknowns, "mm")
    assert found is not None
    return found


@pytest.mark.parametrize("width", [0.0, 0.7])
def test_noise_is_taken_for_more_in_one_of_a_hundred(width: float) -> None:
    """Whatever its facet: white, or alike over two steps; a fit has taken three shapes away."""
    random = np.random.default_rng(4)
    told = 0
    for _ in range(50):
        blocks = noise(random, width)
        for k in range(3):
            blocks[k] = blocks[k] - SHAPES[:, k] * (SHAPES[:, k] @ blocks[k])
        told += judged(blocks).told
    assert told <= 3  # more in one of 600 such tests, if one of a hundred is told


def test_a_smooth_field_is_found_below_the_noise() -> None:
    """0.005 mm of one shape in every block, beside noise of 0.02 mm."""
    random, shape = np.random.default_rng(6), SHAPES[:, 7] * SIDE
    told = [judged([b + 0.005 * shape for b in noise(random, 0.0)]) for _ in range(6)]
    assert all(one.told for one in told)
    assert np.mean([one.rms for one in told]) == pytest.approx(0.005, rel=0.2)


def test_what_the_mesh_may_be_answerable_for_is_none() -> None:
    random, shape = np.random.default_rng(6), 0.005 * SHAPES[:, 7] * SIDE
    found = judged([b + shape for b in noise(random, 0.0)], [shape] * BLOCKS)
    assert not found.told and found.rms < 0.003


def test_blocks_count_alike_whatever_their_size() -> None:
    blocks = noise(np.random.default_rng(1), 0.7)
    scaled = [k * block for k, block in enumerate(blocks, start=1)]
    assert judged(scaled).ratio == pytest.approx(judged(blocks).ratio, rel=1e-12)


def test_too_little_to_tell() -> None:
    few = [np.arange(20.0)]
    assert discrepancy(few, [np.zeros(20)], [PLACES[:20]], 3, "mm") is None
    assert discrepancy([np.zeros(SIDE**2)], NO_DOUBT[:1], [PLACES], 3, "mm") is None
    whole = noise(np.random.default_rng(0), 0.0)[:1]
    assert discrepancy(whole, NO_DOUBT[:1], [PLACES], 15, "mm") is None


def test_the_shapes() -> None:
    """Orthonormal; the first fifteen are all polynomials up to the fourth degree."""
    assert SHAPES.T @ SHAPES == pytest.approx(np.eye(45), abs=1e-12)
    x, y = PLACES.T
    quartic = x**3 * y - 2 * y**4 + x
    inside = SHAPES[:, :15] @ (SHAPES[:, :15].T @ quartic)
    assert inside == pytest.approx(quartic, rel=1e-9, abs=1e-5)


def test_the_words() -> None:
    found = {
        "bubble": Discrepancy(22.6, 1.25, 0.036, "mm"),
        "other": Discrepancy(1.2, 1.25, 0.001, "mm"),
        "computed": Discrepancy(61.8, 1.66, 2e-8, "mm", least=4e-4),
    }
    (note,) = notes_of_discrepancies(found)
    assert (note.kind, note.of) == (NoteKind.DISCREPANCY, "bubble")
    assert note.startswith(
        "0.036 mm of what the fit leaves is smooth over the whole sheet (22.6 times the power "
        "that noise has in such shapes; chance gives 1.25 in one of a hundred): the form of the "
        "law or the model is wrong"
    )
