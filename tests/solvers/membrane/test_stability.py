"""Stability is judged at every reported load, of bubbles and of strips."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.identification.bounds import LawBounds
from bubblefit.identification.feasibility import allowed, draw
from bubblefit.identification.unknowns import Unknowns
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.models.uniaxial import straight_strip
from bubblefit.solvers.base import instability
from bubblefit.solvers.membrane import bubble, factorisation
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.membrane.stability import named

from ...identification.cases import CUBIC, LAW, MODEL, RANGE

FREE = Unknowns.of(
    CUBIC.form,
    0.24,
    RANGE,
    LawBounds.of_moduli({"E1": (20.0, 2000.0), "E2": (20.0, 1000.0), "G12": (1.0, 200.0)}),
)


@cache
def drawn() -> HypoelasticLaw:
    """The first random law that is stable at the last pressure and not at all of them."""
    draws = draw(FREE, np.random.default_rng([1, 0]), 2000)
    for coefficients in draws[allowed(FREE, draws)][:120]:
        law = LAW.with_beta(FREE.beta(FREE.at(coefficients)))
        try:
            found = MembraneSolver().run(MODEL, law).unstable
        except SolverFailure:
            continue
        if found and "300 kPa" not in found:
            return law
    raise AssertionError("no such law in 120 draws")


def test_a_law_that_is_stable_at_the_last_pressure_only() -> None:
    """A weak shear modulus at small strains that grows later: a fold comes and goes."""
    law = drawn()
    history = MembraneSolver().run(MODEL, law)
    differentiated, _ = MembraneSolver().run_with_sensitivity(MODEL, law)
    assert history.unstable == differentiated.unstable == ("59 kPa",)
    assert history.stable is False
    assert instability(history.unstable) == "unstable equilibrium at 59 kPa"
    # At a pressure that nobody asks for it is no matter.
    last = replace(MODEL, pressures=(0.251, 0.3))
    assert MembraneSolver().run(last, law).unstable == ()


@pytest.mark.parametrize("largest", [factorisation.LARGEST_BAND, 0], ids=["band", "sparse"])
def test_the_judgement_is_that_of_the_least_eigenvalue(
    monkeypatch: pytest.MonkeyPatch, largest: int
) -> None:
    """Of the symmetric part of the tangent as it is assembled, at every increment."""
    monkeypatch.setattr(factorisation, "LARGEST_BAND", largest)
    solver, law, judged = MembraneSolver(), drawn(), []
    membrane = solver._membrane(MODEL, law)
    tangent, count = membrane.tangent, len(membrane.free)
    accept = bubble.Record.accept

    def look(self: bubble.Record, i: int, u: np.ndarray) -> None:
        tangent.factor()
        inverse = tangent.solve(np.eye(count))
        whole = np.linalg.inv(inverse)
        least = float(np.linalg.eigvalsh(0.5 * (whole + whole.T))[0])
        judged.append((least > 0, tangent.definite()))
        accept(self, i, u)

    monkeypatch.setattr(bubble.Record, "accept", look)
    every = replace(MODEL, pressures=MODEL.increments)
    solver._prepared = (every, membrane)
    solver.run(every, law)
    assert len(judged) == len(MODEL.increments) and len({both for both, _ in judged}) == 2
    assert all(expected == found for expected, found in judged)


@pytest.mark.parametrize("shear", [4.0, 8.0])
def test_yarns_slide_where_half_the_stress_along_them_is_more_than_the_shear_modulus(
    shear: float,
) -> None:
    """Sliding by gamma along the load takes G gamma^2/2 and gives back s gamma^2/4.

    ln U shortens along the load by gamma^2/4. Ends that stay straight hold a little against it.
    """
    law = HypoelasticLaw.linear(500.0, 200.0, shear)
    model = straight_strip("warp", 20.0, 21.6, 0.81, increments=40, across=20)
    solver = MembraneSolver()
    plain = solver.run(model, law)
    differentiated, _ = solver.run_with_sensitivity(model, law)
    assert plain.unstable == differentiated.unstable and plain.unstable
    assert plain.unstable[0].endswith(" mm of elongation")
    stress = plain.load / (model.load_factor * 12.5 * np.exp(-0.24 * np.log1p(
        np.array(model.elongations) / 20.0)) * 0.81)  # fmt: skip
    onset = stress[len(stress) - len(plain.unstable)]
    assert 2 * shear < onset < 2.5 * shear


def test_many_loads_are_told_by_the_first_and_the_last() -> None:
    places = named(np.arange(1.0, 6.0), "mm of elongation")
    assert instability(places[:3]).endswith("at 1 mm of elongation, 2 mm of elongation, "
                                            "3 mm of elongation")  # fmt: skip
    assert instability(places) == (
        "unstable equilibrium at 5 of the reported loads, from 1 mm of elongation to 5 mm of "
        "elongation"
    )
    assert instability(()) == instability(None) == ""
