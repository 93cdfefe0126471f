"""What a reader of a result is told of its strains."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.experiments.kinds import beyond_card, beyond_range, notes_of, strains_of
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.base import History

CARD = MaterialCard(
    HypoelasticLaw([0] * 3 + [20] + [0] * 3 + [150] + [0] * 3 + [500], 0.24, [0.1, 0.2, 0.3]), 0.81
)


def history(low: tuple[float, ...], high: tuple[float, ...]) -> History:
    return History(np.ones(1), np.zeros((1, 4, 3)), np.array(low), np.array(high))


def test_shear_counts_either_way_and_compression_does_not() -> None:
    assert strains_of(history((-0.5, -0.6, -0.31), (0.1, 0.2, 0.25))) == pytest.approx(
        [0.1, 0.2, 0.31]
    )
    assert strains_of(history((0.0, 0.0, -0.1), (0.1, 0.2, 0.3))) == pytest.approx([0.1, 0.2, 0.3])


def test_shear_beyond_the_card_is_noted_either_way() -> None:
    for low, high in ((-0.31, 0.0), (0.0, 0.31)):
        (note,) = notes_of(history((0.0, 0.0, low), (0.1, 0.2, high)), CARD)
        assert note.startswith("shear strain 0.310 is beyond the card's valid range 0.300")


def test_an_end_itself_is_within_it() -> None:
    ends = np.array([0.1, 0.2, 0.3])
    assert beyond_card(ends, CARD) == beyond_range(ends, ends) == []
    assert len(beyond_card(1.001 * ends, CARD)) == len(beyond_range(1.001 * ends, ends)) == 3
