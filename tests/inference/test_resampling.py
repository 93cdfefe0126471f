"""inference/resampling.py: specimens and points left out or drawn again."""

import numpy as np
import pytest
from bubblefit.inference.resampling import folds_of


@pytest.mark.parametrize(
    ("specimens", "count", "shares"),
    [({"warp": [3, 3, 8]}, 2, [1, 2]), ({"warp": [5] * 5}, 3, [1, 2, 2]), ({}, 2, [])],
)
def test_folds_take_equal_shares_of_specimens(specimens, count, shares):
    """Two specimens are left out one by one; of five points of one specimen two, two and one."""
    folds = folds_of(specimens, count, 7)
    assert len(folds) == count and all(list(fold) == list(specimens) for fold in folds)
    assert sorted(int((~fold[name]).sum()) for fold in folds for name in specimens) == shares


def test_folds_leave_out_whole_specimens_or_single_points_once():
    whose = {"warp": [0, 0, 1, 1, 2, 2, 2], "bias": [4] * 9}
    folds, again, other = (folds_of(whose, 3, seed) for seed in (1, 1, 2))
    for name in whose:
        left = np.array([~fold[name] for fold in folds])
        assert (left.sum(axis=0) == 1).all() and left.any(axis=1).all(), name
        np.testing.assert_array_equal(left, [~fold[name] for fold in again])
    assert any((a["bias"] != b["bias"]).any() for a, b in zip(folds, other, strict=True))
    for fold in folds:
        out = np.array(whose["warp"])[~fold["warp"]]
        assert len(set(out)) == 1 and len(out) == whose["warp"].count(out[0])
