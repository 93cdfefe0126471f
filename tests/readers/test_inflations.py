"""readers/inflations.py: inflations and releases in the order of time."""

import numpy as np
from bubblefit.readers.frame_choice import OTHER_INFLATION, RELEASED, choose_frames
from bubblefit.readers.inflations import branches_of, has_several


def test_inflations_are_found_in_the_order_of_time():
    seen = np.array([np.nan, 0, 10, 20, 19, 30, 30, 12, 5, 0, 11, 21, 33, np.nan])
    found = [branch.tolist() for branch in branches_of(seen)]
    assert found == [[1, 2, 3, 4, 5], [6, 7, 8, 9], [10, 11, 12]]
    assert has_several(seen) and not has_several(seen[[2, 5, 3, 7, 11, 10]])
    assert choose_frames(seen, inflation=1)[0] == (2, 4, 3, 5)
    assert choose_frames(seen, inflation=1)[1][RELEASED] == 3
    second = choose_frames(seen, inflation=2)
    assert second[0] == (10, 11, 12) and second[1][OTHER_INFLATION] == 7
    # The peak that is held counts once.
    assert choose_frames(seen, inflation="all")[0] == (2, 4, 3, 5, 7, 8, 10, 11, 12)
    assert choose_frames(seen, count=2, inflation="all")[0] == (4, 5, 7, 8, 11, 12)
    assert [branch.tolist() for branch in branches_of(seen[8:5:-1])] == [[0, 1, 2]]
