"""meshes/tube.py: graded rows of quads along a tube."""

from itertools import pairwise

import numpy as np
from bubblefit.errors import InputError
from bubblefit.meshes.tube import GROWTH, RefinedZone, rows
from hypothesis import given, settings
from hypothesis import strategies as st


@settings(deadline=None, max_examples=60)
@given(
    end=st.floats(500, 3000),
    size=st.floats(10, 80),
    places=st.lists(st.floats(0.05, 0.9), max_size=3),
    finer=st.floats(0.1, 1),
)
def test_tube_rows_are_graded(end, size, places, finer):
    fine = [RefinedZone(f"r{i}", end * f, 20.0, size * finer) for i, f in enumerate(places)]
    try:
        z = rows(end, size, fine)
    except InputError as error:
        assert error.field.endswith("position")  # two of them too near to each other
        return
    assert z[0] == 0 and z[-1] == end
    steps, middles = np.diff(z), 0.5 * (z[1:] + z[:-1])
    assert (steps > 0).all()
    assert {r.position for r in fine} <= set(z)
    wanted = np.full(len(middles), size)
    for r in fine:
        away = np.maximum(abs(middles - r.position) - r.reach, 0)
        wanted = np.minimum(wanted, r.size + GROWTH * away)
    # A whole number of rows must fit between two places: 1.5 of them become 1 or 2.
    assert (steps <= 1.6 * wanted).all()
    for a, b in pairwise(sorted({0.0, end, *(r.position for r in fine)})):
        assert (np.abs(np.diff(np.log(np.diff(z[(z >= a) & (z <= b)])))) < np.log(1.6)).all()
