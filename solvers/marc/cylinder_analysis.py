"""The cylinder on Marc, run by run: inflate, then inflate and bend."""

from __future__ import annotations

from ...materials.law import HypoelasticLaw
from ...models.cylinder import CylinderModel
from ..base import History
from .analysis import Run
from .cylinder import APPROACH, bending_deck, inflation_deck
from .cylinder_results import cylinder_history, inflated
from .settings import MarcSettings


def analyse(model: CylinderModel, law: HypoelasticLaw, settings: MarcSettings, run: Run) -> History:
    """Inflation alone, to know where collar and supports touch; then all, up to a collapse.

    Raises
    ------
    SolverFailure : a run that did not end well. InputError : as `bending_deck`.
    """
    filling, bending = len(model.inflation), len(model.increments)
    deck = inflation_deck(model, law, settings)
    shape = run(deck, filling, lambda t19, _: inflated(t19, model))
    return run(
        bending_deck(model, law, settings, shape),
        filling + APPROACH + bending,
        lambda t19, n: cylinder_history(t19, model, n),
        lambda t19, n: cylinder_history(t19, model, n, ended=False),
    )
