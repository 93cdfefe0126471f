"""Fits to strips stay inside the bounds of the moduli, where the law is positive definite."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.inference.search import feasible_start
from bubblefit.inference.unknowns import LawBounds, Unknowns, allowed, draw
from bubblefit.materials.forms.base import COMPONENTS, GRID, moduli_on_grid
from bubblefit.materials.law import DEFINITE, HypoelasticLaw

from ...inference.cases import levenberg_marquardt
from .problems import CUBIC, FORMS, LARGEST, LAW, LEAST, RANGE, strips


@pytest.mark.parametrize("form", FORMS)
def test_starts_have_moduli_between_the_bounds_and_the_box_holds_them(form: str) -> None:
    unknowns, _ = FORMS[form]
    draws = draw(unknowns, np.random.default_rng(1), 4000)
    lower, upper = unknowns.box
    room = 1e-9 * (upper - lower)
    assert (draws >= lower - room).all() and (draws <= upper + room).all()
    good = draws[allowed(unknowns, draws)]
    assert len(good) > 20
    a, c = unknowns.inequalities
    for coefficients in good[:100]:
        law = HypoelasticLaw(full(unknowns, coefficients), 0.24, RANGE, "constant",
                             unknowns.form)  # fmt: skip
        for name, component in COMPONENTS.items():
            values = law.modulus(name, np.linspace(0, RANGE[component], 101))
            place = ("E1", "E2", "G12").index(name)
            dip = 0.007 * values.max()  # between the strains of the grid, see GRID
            assert values.min() >= LEAST[place] - dip and values.max() <= LARGEST[place] + dip
        assert (a @ unknowns.at(coefficients) >= c - 1e-9).all()
    for coefficients in draws[~allowed(unknowns, draws)][:100]:
        assert (a @ unknowns.at(coefficients) < c).any()


def full(unknowns: Unknowns, coefficients: np.ndarray) -> np.ndarray:
    beta = np.zeros(12)
    beta[list(unknowns.free)] = coefficients
    return beta


def test_no_analysis_of_a_fit_leaves_the_bounds() -> None:
    """Also where the data ask for more: E1 at its upper, E2 at its lower bound."""
    ranges = {"E1": (100.0, 700.0), "E2": (150.0, 500.0), "G12": (5.0, 300.0)}
    tight = replace(CUBIC, bounds=LawBounds.of_moduli(ranges))
    seen: list[np.ndarray] = []
    fit = strips(tight)
    fit.watch = lambda y, value, status, solver: seen.append(y)
    found = levenberg_marquardt(fit, feasible_start(fit, 2, 0), 1e-7, 100)
    a, c = tight.inequalities
    assert len(seen) > 5 and all((a @ y >= c - 1e-9).all() for y in seen)
    law = LAW.with_beta(tight.beta(found.best.unknowns))
    assert law.E1(np.linspace(0, RANGE[0], GRID)).max() == pytest.approx(700.0, rel=1e-6)
    assert law.E2(np.linspace(0, RANGE[1], GRID)).min() == pytest.approx(150.0, rel=1e-6)


@pytest.mark.parametrize("form", FORMS)
def test_strips_keep_the_law_positive_definite(form: str) -> None:
    """E1 E2 > (nu12 E2)^2 with the modulus across at zero strain, because a strip contracts."""
    unknowns, _ = FORMS[form]
    bounded = replace(unknowns, definite_nu12=0.4)
    draws = draw(unknowns, np.random.default_rng(4), 3000)
    a, c = bounded.inequalities
    agreed = {True: 0, False: 0}
    for coefficients in draws[allowed(unknowns, draws)][:200]:
        law = HypoelasticLaw(full(unknowns, coefficients), 0.4, RANGE, "constant",
                             unknowns.form)  # fmt: skip
        grid = moduli_on_grid(unknowns.form, RANGE)
        e2, e1 = grid["E2"] @ law.beta, grid["E1"] @ law.beta
        worst = min((e1[0] / e2).min(), (e1 / e2[0]).min()) / 0.4**2
        inside = bool((a @ bounded.at(coefficients) >= c - 1e-12).all())
        assert inside == (worst >= DEFINITE)
        agreed[inside] += 1
    assert min(agreed.values()) >= 5, agreed
