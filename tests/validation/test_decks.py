"""Constants found in CalculiX' own test decks, from displacements that the decks compute.

The decks are read in place. Starts lie up to a factor off; results have six digits.
"""

import bubblefit as bf
import pytest

from ..builders.computed_decks import DECKS, ComputedDeck
from ..support import needs


@pytest.mark.filterwarnings("ignore::bubblefit.BubblefitWarning")  # no noise at all
@pytest.mark.parametrize("name", DECKS)
def test_constants_of_a_deck_are_found_from_its_own_results(name, tmp_path):
    deck = ComputedDeck(needs.calculix_decks() / f"{name}.inp", *DECKS[name])
    fit = bf.fit(deck.project(tmp_path), jobs=1)
    truth = deck.truth()
    assert {name: value["value"] for name, value in fit.parameters.items()} == {
        name: pytest.approx(value, rel=1e-4) for name, value in truth.items()
    }
