"""experiments/bubble/point_doubts.py: points where the correlation failed."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble import doubts

from .cases import FIVE_POINTS, assert_doubted, field_of


def zeros(field, by):
    places, moved = field.points.copy(), field.displacement.copy()
    places[200:206], moved[200:206] = by * places[200:206], 0.0
    return replace(field, points=places, displacement=moved)


def zero_points(zeros, origin):
    points, moved = np.vstack([FIVE_POINTS, [[91.0, 0.0], [89.0, 0.0]]]), np.ones((7, 3))
    moved[zeros] = 0.0
    points[6] *= not origin
    return (field_of(0.2, moved, points),)


#: Where a check begins to speak: how often, whether sure, its words, and what it sees.
POINT_LIMITS = [
    *((doubts.rejected_at_zero, "zero-points", int(bool(words)), True, words,
       {"fields": zero_points(zeros, origin)})
      for zeros, origin, words in (
          ([5], False, []), ([5, 6], False, ["1 of 6 points"]), ([], True, ["2 points lie"]),
          ([5, 6], True, ["1 of 6 points", "2 points lie at exactly x = y = 0", "200 kPa"]))),
]  # fmt: skip


@pytest.mark.parametrize(("check", "name", "count", "sure", "words", "seen"), POINT_LIMITS)
def test_limits_of_point_doubts(check, name, count, sure, words, seen):
    assert_doubted(check, count, name, sure, *words, **seen)
