"""experiments/doubts.py: what doubts expect of moduli, and what becomes of them."""

from pathlib import Path

import pytest
from bubblefit.experiments.doubts import DOUBTFUL, Doubt, Expected, Judgement

from ..support.refusals import complaint_with

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
def test_rough_modulus_may_be_off_by_a_factor_of_four(modulus, names, words):
    assert BOUNDS.outside(modulus, names) == words


@pytest.mark.parametrize(("low", "stiffer"), [(60.0, False), (60.1, True)])
def test_bounds_expect_the_warp_to_be_stiffer(low, stiffer):
    assert Expected({"E1": (low, 1000.0), "E2": (100.0, 400.0)}).warp_is_stiffer is stiffer


def test_sure_doubts_stop_a_fit_and_others_are_noted():
    doubts = [Doubt("a", False, "perhaps"), Doubt("b", True, "sure"), Doubt("c", True, "known"),
              Doubt("d", True, "too")]  # fmt: skip
    found = Judgement("t", tuple(doubts), ["c", "a"])
    assert [d.name for d in found.errors] == ["b", "d"]
    assert [(n.kind, str(n), n.of) for n in found.notes] == [
        (DOUBTFUL, f"{text} (trusted: {name})", "t")
        for text, name in (("perhaps", "a"), ("known", "c"))
    ]
    complaint_with(["sure [b]; too [d].", "--trust"], found.demand, Path("p.toml"))
    Judgement("t", tuple(doubts), "abcd").demand(Path("p.toml"))
