"""Folds of a cross-validation."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.inference.resampling import folds_of


@pytest.mark.parametrize(
    ("specimens", "count"), [({"warp": [3, 3, 8]}, 2), ({"warp": [5, 5, 5, 5, 5]}, 3), ({}, 2)]
)
def test_every_fold_has_its_share(specimens: dict[str, list[int]], count: int) -> None:
    """Two specimens are left out one by one; of five points of one specimen two, two and one."""
    folds = folds_of(specimens, count, 7)
    assert len(folds) == count and all(list(fold) == list(specimens) for fold in folds)
    lost = sorted(int((~fold[name]).sum()) for fold in folds for name in specimens)
    assert lost == ([1, 2] if len(specimens.get("warp", [])) == 3 else [1, 2, 2][: 3 * len(lost)])


def test_folds_leave_out_whole_specimens_or_single_points_once() -> None:
    whose = {"warp": [0, 0, 1, 1, 2, 2, 2], "bias": [4] * 9}
    folds = folds_of(whose, 3, 1)
    for name, numbers in whose.items():
        left = np.array([~fold[name] for fold in folds])
        assert (left.sum(axis=0) == 1).all() and left.any(axis=1).all(), name
        if len(set(numbers)) > 1:
            for row in left:
                assert len({n for n, out in zip(numbers, row, strict=True) if out}) == 1
                assert all(row[i] == row[j] for i in range(7) for j in range(7)
                           if numbers[i] == numbers[j])  # fmt: skip
    assert all((a[n] == b[n]).all() for a, b in zip(folds, folds_of(whose, 3, 1), strict=True)
               for n in whose)  # fmt: skip
    assert any((a["bias"] != b["bias"]).any()
               for a, b in zip(folds, folds_of(whose, 3, 2), strict=True))  # fmt: skip
