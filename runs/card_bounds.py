"""Check that the law of a study's card lies within the bounds of the project's fit."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..inference.unknowns import Unknowns
from ..materials.forms.base import COMPONENTS, Array
from ..project.project import Project
from ..wording import distinct_numbers

#: Relative excess over a bound that is allowed, as the numbers in cards are rounded.
ROUNDING = 1e-4


def check_within_bounds(project: Project, unknowns: Unknowns, coefficients: Array) -> None:
    """Check that a card's law lies within the bounds of the project's fit.

    Parameters
    ----------
    project : Project
    unknowns : Unknowns
        Those of the project's fit, with its bounds.
    coefficients : (size,) array, MPa
        The free coefficients of the card.

    Raises
    ------
    InputError
        A modulus is beyond a bound at some strain, or a coefficient is beyond its own.
    """
    bounds = unknowns.bounds
    for name, rows in unknowns.moduli.items():
        moduli = rows @ coefficients
        smallest, largest = int(np.argmin(moduli)), int(np.argmax(moduli))
        if moduli[smallest] < bounds.smallest[name] * (1 - ROUNDING):
            quantity = _modulus_words(unknowns, name, smallest, len(moduli))
            _refuse(project, quantity, float(moduli[smallest]), "below", bounds.smallest[name])
        if bounds.largest is not None and moduli[largest] > bounds.largest[name] * (1 + ROUNDING):
            quantity = _modulus_words(unknowns, name, largest, len(moduli))
            _refuse(project, quantity, float(moduli[largest]), "above", bounds.largest[name])
    if bounds.lower is None or bounds.upper is None:
        return
    for label, coefficient, lower, upper in zip(
        unknowns.labels, coefficients.tolist(), bounds.lower, bounds.upper, strict=True
    ):
        tolerance = ROUNDING * max(abs(lower), abs(upper))
        if coefficient < lower - tolerance:
            _refuse(project, label, coefficient, "below", lower)
        if coefficient > upper + tolerance:
            _refuse(project, label, coefficient, "above", upper)


def _modulus_words(unknowns: Unknowns, name: str, row: int, row_count: int) -> str:
    """Return a modulus with the strain of a row of its grid, in words."""
    if name not in COMPONENTS:  # a constant of the form, which holds at any strain
        return name
    component = COMPONENTS[name]
    strains = unknowns.form.grid(component, unknowns.strain_range[component])
    strain = np.resize(strains, row_count)[row]  # a grid for each load ratio
    return f"{name} at {100 * strain:.4g} % of strain"


def _refuse(project: Project, quantity: str, value: float, side: str, bound: float) -> None:
    """Raise InputError for a card whose quantity is beyond a bound, both in MPa."""
    card_value, limit = distinct_numbers(value, bound, 4)
    problem = (
        f"expected a card within the bounds of this project; its {quantity} is {card_value} MPa, "
        f"{side} the bound of {limit} MPa: give the card of this project's fit, or move the bound"
    )
    raise InputError(project.path, "--card", problem)
