"""From unknowns to a law and back, and what is allowed."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.inference.unknowns import LawBounds, Unknowns, allowed, draw
from bubblefit.materials.forms import polynomial as forms
from bubblefit.materials.forms.registry import form_named
from bubblefit.materials.law import HypoelasticLaw

from ..complaints import complaint
from .cases import CONSTANT, CUBIC, EVERYTHING, LAW, LOWER, MARGINS, RANGE, UPPER


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_unknowns_are_moduli_at_chebyshev_points(degree: int) -> None:
    places = np.array([4 * b + k for b in range(3) for k in range(3 - degree, 4)])
    lower, upper = 1e3 * np.array(LOWER)[places], 1e3 * np.array(UPPER)[places]
    bounds = LawBounds.of_entries(lower, upper, MARGINS)
    p = Unknowns.of(forms.Polynomial(degree), 0.24, RANGE, bounds)
    assert p.free == tuple(places) and p.size == p.count == len(places)
    coefficients = LAW.beta[places]
    y = p.at(coefficients)
    assert p.to_coefficients @ y == pytest.approx(coefficients, rel=1e-9)
    full = np.zeros(12)
    full[places] = coefficients
    assert p.beta(y) == pytest.approx(full, rel=1e-9)
    # Unknowns are proportional to the moduli at the points: constant moduli, equal unknowns.
    flat = np.zeros(12)
    flat[[3, 7, 11]] = 10.0, 200.0, 500.0
    n = degree + 1
    values = p.at(flat[places])
    for block in range(3):
        part = values[n * block : n * block + n]
        assert part == pytest.approx(np.full(n, part[0]))


@pytest.mark.parametrize("unknowns", [CUBIC, EVERYTHING, CONSTANT], ids=["12", "16", "3"])
def test_inequalities_say_what_bounds_and_positivity_say(unknowns: Unknowns) -> None:
    random = np.random.default_rng(6)
    a, c = unknowns.inequalities
    agreed = {True: 0, False: 0}
    for _ in range(3000):
        lower, upper = unknowns.box
        coefficients = lower + (upper - lower) * random.uniform(-0.02, 1.02, unknowns.size)
        y = unknowns.at(coefficients)
        y[unknowns.size :] = random.uniform(-21, 21, len(unknowns.nuisance_names))
        full = unknowns.beta(y)
        law = HypoelasticLaw(full, 0.24, RANGE)
        x = np.linspace(0, 0.13, 31)
        low, high = unknowns.nuisance.bounds
        nuisance = y[unknowns.size :]
        expected = bool(
            (coefficients >= lower).all()
            and (coefficients <= upper).all()
            and min(law.E1(x).min(), law.E2(x).min()) >= 5.0
            and law.G12(x).min() >= 0.5
            and (nuisance >= low).all()
            and (nuisance <= high).all()
        )
        assert bool((a @ y >= c).all()) == expected
        agreed[expected] += 1
    assert agreed[False] > 10
    known = unknowns.at(np.clip(LAW.beta[list(unknowns.free)], 1e-9, None)
                                if unknowns is CONSTANT else LAW.beta)  # fmt: skip
    assert (a @ known >= c).all()


SPLINE = form_named("spline", {"knots": {"warp": 5, "fill": 4, "shear": 6}}, RANGE)
RANGES = {"E1": (20.0, 2000.0), "E2": (20.0, 1000.0), "G12": (0.5, 200.0)}


def test_unknowns_of_splines_are_moduli_at_their_knots() -> None:
    p = Unknowns.of(SPLINE, 0.24, RANGE, LawBounds.of_moduli(RANGES))
    assert p.size == p.count == 15 and p.labels[0] == "G12 at 0.000"
    assert p.shear.tolist() == [True] * 6 + [False] * 9
    values = np.concatenate([np.linspace(10, 60, 6), np.full(4, 120.0), np.full(5, 900.0)])
    y = p.at(values)
    assert p.beta(y) == pytest.approx(values)
    # In units of the geometric mean of the bounds of their own modulus.
    assert y[6:10] == pytest.approx(120.0 / np.sqrt(20.0 * 1000.0))
    low, high = p.box
    assert low.tolist() == [0.5] * 6 + [20.0] * 9
    assert high.tolist() == [200.0] * 6 + [1000.0] * 4 + [2000.0] * 5


def test_inequalities_of_splines_ask_between_the_knots() -> None:
    """A curve may leave its bounds between two knots whose values are inside."""
    p = Unknowns.of(SPLINE, 0.24, RANGE, LawBounds.of_moduli(RANGES))
    draws = draw(p, np.random.default_rng(3), 4000)
    good, (a, c) = allowed(p, draws), p.inequalities
    assert 200 < good.sum() < 3800
    lower, upper = p.box
    assert (draws >= lower * (1 - 1e-12)).all() and (draws <= upper * (1 + 1e-12)).all()
    fine = np.linspace(0, RANGE[0], 997)
    for coefficients, inside in zip(draws[:300], good[:300], strict=True):
        law = HypoelasticLaw(coefficients, 0.24, RANGE, form=SPLINE)
        assert bool((a @ p.at(coefficients) >= c - 1e-9).all()) == inside
        for name, (least, largest) in RANGES.items():
            curve = law.modulus(name, fine)
            dip = 0.04 * curve.max()  # between the strains of the grid
            assert not inside or (curve.min() >= least - dip and curve.max() <= largest + dip)


def test_positivity_belongs_to_its_modulus() -> None:
    p = Unknowns.of(SPLINE, 0.24, RANGE, LawBounds.of_moduli(RANGES))
    margin = p.positivity[1]
    counts = [len(p.moduli[name]) for name in ("G12", "E2", "E1")]
    assert margin.tolist() == [0.5] * counts[0] + [20.0] * (counts[1] + counts[2])
    stability = p.stability_rows
    assert len(stability) == counts[0] and not stability[:, ~p.shear].any()
    assert stability == pytest.approx(p.inequalities[0][: counts[0]])


def test_bounds_that_do_not_go_with_the_form_are_refused() -> None:
    only = LawBounds.of_moduli({name: RANGES[name] for name in ("E1", "E2")})
    assert "bounds.G12: this key is missing" in complaint(Unknowns.of, SPLINE, 0.24, RANGE, only)
    twelve = LawBounds.of_entries(LOWER, UPPER, MARGINS)
    assert "expected 15 of a spline law" in complaint(Unknowns.of, SPLINE, 0.24, RANGE, twelve)
    assert "least < largest" in complaint(LawBounds.of_moduli, {"E1": (3.0, 2.0)})
    assert "lower <= upper" in complaint(LawBounds.of_entries, [2.0], [1.0], MARGINS)
