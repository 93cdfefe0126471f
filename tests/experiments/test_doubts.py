"""Doubts of any kind of test: what is far from its bounds, what stops a fit, what is trusted."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.kinds import (
    Doubt,
    Expected,
    beyond_card,
    beyond_range,
    by_strain,
    judged,
    notes_of_record,
    other_thickness,
    unstable_words,
)
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.notes import NoteKind

from ..complaints import complaint

BOUNDS = Expected({"E1": (200.0, 1000.0), "E2": (100.0, 400.0)})


@pytest.mark.parametrize(
    ("modulus", "names", "words"),
    [
        (50.0, ("E1",), ""),
        (49.9, ("E1",), "49.9 MPa, and the bounds of E1 are 200 to 1e+03"),
        (4000.0, ("E1",), ""),
        (4001.0, ("E1",), "4e+03 MPa, and the bounds of E1 are 200 to 1e+03"),
        (25.0, ("E1", "E2"), ""),
        (24.9, ("E1", "E2"), "24.9 MPa, and the bounds of E1 and E2 are 100 to 1e+03"),
        (1601.0, ("E2",), "1.6e+03 MPa, and the bounds of E2 are 100 to 400"),
    ],
)
def test_a_rough_modulus_may_be_off_by_four(modulus, names, words) -> None:
    assert BOUNDS.outside(modulus, names) == words


@pytest.mark.parametrize(("low", "stiffer"), [(60.0, False), (60.1, True)])
def test_bounds_that_mean_the_warp_to_be_stiffer(low: float, stiffer: bool) -> None:
    """The products of the bounds, by more than one and a half."""
    assert Expected({"E1": (low, 1000.0), "E2": (100.0, 400.0)}).warp_is_stiffer is stiffer


def test_what_stops_a_fit_and_what_is_noted() -> None:
    doubts = [Doubt("a", False, "perhaps"), Doubt("b", True, "sure"), Doubt("c", True, "known"),
              Doubt("d", True, "too")]  # fmt: skip
    found = judged("t", doubts, ["c", "a"])
    assert [d.name for d in found.doubts] == ["b", "c", "d", "a"]
    assert [d.name for d in found.errors] == ["b", "d"]
    assert [(n.kind, str(n), n.of) for n in found.notes] == [
        (NoteKind.DOUBTFUL, "known (trusted: c)", "t"),
        (NoteKind.DOUBTFUL, "perhaps (trusted: a)", "t"),
    ]
    assert complaint(found.demand, Path("p.toml")) == (
        "p.toml: the data of 't': sure [b]; too [d]. Correct the data, or let it pass with --trust "
        "NAME"
    )
    judged("t", doubts, "abcd").demand(Path("p.toml"))


def test_the_words_of_notes() -> None:
    law = HypoelasticLaw.linear(300.0, 200.0, 5.0)
    card = MaterialCard(HypoelasticLaw(law.beta, 0.2, [0.1, 0.2, 0.3], form=law.form), 0.8)
    within, beyond = np.array([0.1, 0.2, 0.3]) * (1 + 9e-7), np.array([0.1, 0.21, 0.2])
    ends = np.array([0.1, 0.2, 0.3])
    assert beyond_card(within, card) == beyond_range(within, ends) == []
    assert len(beyond_card(ends * (1 + 1.1e-6), card)) == 3
    assert [(n.kind, str(n)) for n in beyond_card(beyond, card)] == [(
        NoteKind.BEYOND_CARD,
        "fill strain 0.210 is beyond the card's valid range 0.200: modulus held there",
    )]  # fmt: skip
    assert [(n.kind, str(n)) for n in beyond_range(beyond, ends)] == [(
        NoteKind.BEYOND_LAW,
        "fill strain reached 0.210, beyond law.strain_range 0.2: the modulus was held at its end "
        "value there; a wider range would let it vary",
    )]  # fmt: skip
    assert by_strain([1, 2, 3]) == {"warp": 1.0, "fill": 2.0, "shear": 3.0}
    assert other_thickness(card, 0.8) == []
    (note,) = other_thickness(card, 0.4)
    assert note.kind is NoteKind.THICKNESS and note.endswith(
        "with the card's moduli the fabric is 50 % softer; it was run with the card's thickness"
    )
    record = SimpleNamespace(strain=beyond, remarks=("made up",), unstable=("132 kPa",))
    assert [n.kind for n in notes_of_record(record, card)] == [
        NoteKind.SOLVER, NoteKind.BEYOND_CARD, NoteKind.UNSTABLE
    ]  # fmt: skip
    record.strain = None
    assert [n.kind for n in notes_of_record(record, card)] == [NoteKind.SOLVER, NoteKind.UNSTABLE]
    assert unstable_words(None) == unstable_words(()) == []
    (note,) = unstable_words(("132 kPa",))
    assert note.kind is NoteKind.UNSTABLE and note.endswith(": the model would not stay there")
    assert "132 kPa" in note
