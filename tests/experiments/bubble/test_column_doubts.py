"""experiments/bubble/column_doubts.py: columns exchanged, flipped or of another unit."""

import numpy as np
import pytest
from bubblefit.experiments.bubble import doubts
from bubblefit.experiments.bubble.column_consistency import CentreMotion

from .cases import assert_doubted, doubts_said


def motion(xx, yy, xy=0.0, yx=0.0, *, rise=30.0, error=1e-4):
    gradient = np.array([[xx, xy], [yx, yy], [0.0, 0.0]])
    return CentreMotion(np.array([0.0, 0.0, rise]), gradient, error)


#: Where a check begins to speak: how often, whether sure, its words, and what it sees.
COLUMN_LIMITS = [
    # 2/3 (30 / 100)^2 is 0.06; ratios from 0.15 to 6 are possible, from 0.4 to 3 usual.
    *((doubts.strain_unlike_rise, name, int(bool(words)), sure, words, {"centre_motions": motions})
      for motions, name, sure, words in (
          ((None, None), "", True, []),
          ((motion(0.05, 0.07),), "", True, []), ((motion(0.05, 0.0239),), "", True, []),
          ((motion(0.05, 0.0236),), "strain-rise", False, ["about 0.06: are dx, dy and dz"]),
          ((motion(0.05, 0.0088),), "strain-rise", True, ["a rise of 30 mm calls for"]),
          ((motion(0.05, 0.0088, error=0.016),), "", True, []),
          ((motion(0.165, 0.05),), "", True, []),
          ((motion(0.168, 0.05),), "strain-rise", False, ["0.18"]),
          ((motion(0.35, 0.05),), "strain-rise", True, ["0.41"]),
          ((motion(-0.05, 0.07),), "axis-flipped", True, ["x and dx have"]),
          ((motion(0.05, -0.07),), "axis-flipped", True, ["y and dy have"]),
          ((motion(-0.05, -0.07),), "axis-flipped", True, ["x and dx have", "y and dy have"]),
          ((motion(0, 0, 0.07, 0.05),), "exchanged", True, ["take dy for dx and dx for dy"]),
          ((motion(0, 0, 0.07, -0.05),), "exchanged", True, ["minus dy for dx and dx for dy"]),
          ((motion(0, 0, -0.07, 0.05),), "exchanged", True, ["take dy for dx and minus dx for dy"]),
          # What a slack sheet lacks is in both frames; a frame nearly as high cancels nothing.
          ((motion(-0.02, -0.01, rise=20.0), motion(0.01, 0.02)), "", True, []),
          ((motion(0.0, 0.0, rise=20.0), motion(0.0, 0.0)), "strain-rise", True,
           ["from 20 to 30 mm", "about 0.033"]),
          ((motion(0.045, 0.045, rise=25.0), motion(0.06, 0.06)), "", True, []))),
]  # fmt: skip


@pytest.mark.parametrize(("check", "name", "count", "sure", "words", "seen"), COLUMN_LIMITS)
def test_limits_of_column_doubts(check, name, count, sure, words, seen):
    assert_doubted(check, count, name, sure, *words, **seen)


def test_centre_that_goes_down_is_doubted():
    down = doubts.upside_down
    assert doubts_said(down, rises=np.array([-3.0, 0.0])) == []
    assert_doubted(down, 1, "z-flipped", True, "-2.5 mm", "200 kPa", rises=np.array([3.0, -2.5]))
