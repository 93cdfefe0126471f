"""experiments/forward.py: runs with cards, how they ended, and strains beyond a card."""

import re

import numpy as np
import pytest
from bubblefit.experiments.forward import (
    BEYOND_CARD,
    BEYOND_CARD_WORDS,
    BEYOND_LAW,
    BEYOND_LAW_WORDS,
    by_strain,
    divided,
    notes_beyond,
    notes_of,
    strains_of,
)
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.base import History

from ..support.refusals import complaint


def test_steps_are_divided_into_equal_parts_from_zero():
    assert divided([0.2, 0.8], 3, "bubble") == pytest.approx([0.2 / 3, 0.4 / 3, 0.2, 0.4, 0.6, 0.8])


def test_factor_of_one_leaves_the_steps():
    assert divided([0.1, 0.4], 1, "bubble") == [0.1, 0.4]


def test_steps_are_never_joined():
    refused = complaint(divided, [0.2, 0.8], 0.5, "cylinder")
    assert "the cylinder's steps are divided, never joined" in refused


@pytest.mark.parametrize(
    ("reached", "said"), [(0.1080004, ["10.80004", "10.8"]), (0.313, ["31.3", "10.8"])]
)
def test_strain_beyond_its_end_is_not_printed_as_the_end(reached, said):
    (note,) = notes_beyond(
        np.array([reached, 0.0, 0.0]), np.full(3, 0.108), BEYOND_LAW, BEYOND_LAW_WORDS
    )
    assert re.findall(r"([\d.]+) %", note) == said


CARD = MaterialCard(
    HypoelasticLaw([0] * 3 + [20] + [0] * 3 + [150] + [0] * 3 + [500], 0.24, [0.1, 0.2, 0.3]), 0.81
)


def history(low: tuple[float, ...], high: tuple[float, ...]) -> History:
    return History(np.ones(1), np.zeros((1, 4, 3)), np.array(low), np.array(high))


def test_shear_counts_either_way_and_compression_does_not():
    found = strains_of(history((-0.5, -0.6, -0.31), (0.1, 0.2, 0.25)))
    assert found == pytest.approx([0.1, 0.2, 0.31])
    assert strains_of(history((0.0, 0.0, -0.1), (0.1, 0.2, 0.3))) == pytest.approx([0.1, 0.2, 0.3])


def test_shear_beyond_the_card_is_noted_either_way():
    for low, high in ((-0.31, 0.0), (0.0, 0.31)):
        (note,) = notes_of(history((0.0, 0.0, low), (0.1, 0.2, high)), CARD)
        assert note.startswith("shear strain 31 %") and "30 %" in note


def test_notes_of_strains_beyond_the_card():
    ends, beyond = np.array([0.1, 0.2, 0.3]), np.array([0.1, 0.21, 0.2])
    assert notes_beyond(ends * (1 + 9e-7), ends) == []
    assert len(notes_beyond(ends * (1 + 1.1e-6), ends)) == 3
    for words, kind in ((BEYOND_CARD_WORDS, BEYOND_CARD), (BEYOND_LAW_WORDS, BEYOND_LAW)):
        found = notes_beyond(beyond, ends, kind, words)
        assert [note.kind for note in found] == [kind]
        assert "fill" in found[0] and "21 %" in found[0] and "20 %" in found[0]
    assert by_strain([1, 2, 3]) == {"warp": 1.0, "fill": 2.0, "shear": 3.0}
