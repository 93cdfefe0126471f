"""Warnings of a finished fit: moduli that the data do not determine, and unknowns on a bound."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..materials.forms.base import Array
from ..notes import Note, NoteKind, Objection
from ..wording import percent
from .problem import Evaluation, FitProblem
from .reported import ReportedModulus

UNCERTAIN = NoteKind("uncertain", weight=6)
BOUNDS_REACHED = Objection(
    "bounds are reached",
    "widen the bounds that the warnings name, or add a test that determines these moduli",
)
MARGIN = NoteKind("on its margin", weight=17, objection=BOUNDS_REACHED)
BOUND = NoteKind("on a bound", weight=18, objection=BOUNDS_REACHED)

NOTED_SIGMA = 0.25  # relative standard deviation from which on a modulus is noted as uncertain
ON_BOUND = 1e-6  # of the width of the bounds, or of a modulus: what is closer lies on the bound


def uncertain_words(name: str, modulus: ReportedModulus, noise_words: str) -> str:
    """Return a sentence on where a modulus is not determined, or on how uncertain it is.

    Parameters
    ----------
    name : str
        "E1", "E2" or "G12".
    modulus : ReportedModulus
    noise_words : str
        What the uncertainty stems from ("at 0.02 mm noise"), which the sentence has in brackets.

    Returns
    -------
    str
        Empty where the modulus is determined and uncertain by at most `NOTED_SIGMA`.
    """
    strain = modulus.strain
    undetermined = strain[~modulus.determined]
    if len(undetermined):
        span = f"between {100 * undetermined[0]:.3g} and {100 * undetermined[-1]:.3g} % of strain"
        where = "at any strain" if len(undetermined) == len(strain) else span
        return f"{name} is not determined {where} ({noise_words})"
    worst = int(modulus.sigma.argmax())
    if modulus.sigma[worst] <= NOTED_SIGMA:
        return ""
    return (
        f"{name} is uncertain by up to {percent(modulus.sigma[worst])} (1 sigma {noise_words}), "
        f"worst at {100 * strain[worst]:.3g} % of strain"
    )


def bound_reached(value: float, lower: float, upper: float) -> str:
    """Return the bound on which a value lies ("lower", "upper"), "" for none."""
    room = ON_BOUND * (upper - lower)
    if value - lower <= room:
        return "lower"
    return "upper" if upper - value <= room else ""


def notes_of_bounds(problem: FitProblem, best: Evaluation, open_modulus: str) -> list[Note]:
    """Return notes on moduli, coefficients and nuisance parameters on a bound of the fit.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The optimum.
    open_modulus : str
        A modulus that the data leave open, "" for none: where it lies says nothing.
    """
    unknowns = problem.unknowns
    bounds = unknowns.bounds
    notes = []
    for name, rows in unknowns.moduli.items():
        if name == open_modulus:
            continue
        moduli = rows @ best.coefficients
        smallest = bounds.smallest[name]
        if (moduli - smallest <= ON_BOUND * max(smallest, 1.0)).any():
            words = f"{name} touches its positivity margin: the data ask for less stiffness"
            notes.append(Note(MARGIN, words))
        largest = np.inf if bounds.largest is None else bounds.largest[name]
        if (largest - moduli <= ON_BOUND * largest).any() and largest < np.inf:
            words = f"{name} touches its upper bound: the data ask for more stiffness"
            notes.append(Note(BOUND, words))
    if bounds.largest is None:
        notes += notes_on_box(unknowns.labels, best.coefficients, *unknowns.box)
    nuisance = best.unknowns[unknowns.size :]
    return notes + notes_on_box(unknowns.nuisance.names, nuisance, *unknowns.nuisance.bounds)


def notes_on_box(
    names: Sequence[str],
    values: Array,
    lower: Array,
    upper: Array,
) -> list[Note]:
    """Return notes on values (n,) that lie on their lower or upper bound (n,)."""
    notes = []
    for name, value, low, high in zip(names, values, lower, upper, strict=True):
        bound = bound_reached(value, low, high)
        if bound:
            notes.append(Note(BOUND, f"{name} lies on its {bound} bound"))
    return notes
