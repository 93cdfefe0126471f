"""Constants found in CalculiX' own test decks, from displacements that the decks compute.

The decks are read in place. Starts lie up to a factor off; results have six digits.
"""

import bubblefit as bf
import pytest

from ..builders.computed_decks import ComputedDeck
from ..support import needs

TIP = "LAST"
DECKS = {
    # Neo-Hooke, quadratic hexahedra, large strain.
    "beamnh": (("C10",), ((TIP, "z"),), 1.5),
    # An anisotropic material of 21 constants.
    "aniso": (
        ("D3333", "D1313", "D2323"),
        ((TIP, "z"), (TIP, "x"), (TIP, "y"), ((1, 1, 2), "x"), ((1, 1, 2), "y")),
        1.15,
    ),
    # Young's modulus and Poisson's ratio: tetrahedra, plane stress.
    "beam10p": (("E", "nu"), (("LOAD", "y"), ((1, 1, 2), "x"), ((1, 0, 1), "x")), 1.5),
    "planestress3": (("E", "nu"), (((10, 5, 0), "x"), ((10, 5, 0), "y")), 1.5),
}


@pytest.mark.filterwarnings("ignore::bubblefit.BubblefitWarning")  # no noise at all
@pytest.mark.parametrize("name", DECKS)
def test_constants_of_a_deck_are_found_from_its_own_results(name, tmp_path):
    deck = ComputedDeck(needs.calculix_decks() / f"{name}.inp", *DECKS[name])
    fit = bf.fit(deck.project(tmp_path), jobs=1)
    truth = deck.truth()
    assert {name: value["value"] for name, value in fit.parameters.items()} == {
        name: pytest.approx(value, rel=1e-4) for name, value in truth.items()
    }
