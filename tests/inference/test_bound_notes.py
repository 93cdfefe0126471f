"""inference/bound_notes.py: values on their bounds."""

import numpy as np
from bubblefit.inference.bound_notes import BOUND, notes_on_box


def test_value_lies_on_bound_within_a_millionth_of_the_width():
    values = np.array([2.0 + 1e-6, 2.0 + 3e-6, 4.0 - 1e-6, 4.0 - 3e-6, 3.0])
    notes = notes_on_box("abcde", values, np.full(5, 2.0), np.full(5, 4.0))
    assert [str(note)[:19] for note in notes] == ["a lies on its lower", "c lies on its upper"]
    assert {note.kind for note in notes} == {BOUND}
