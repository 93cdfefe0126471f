"""From a fit to the certainty that its card keeps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..identification.problem import FitProblem
from ..materials.certainty import CardCertainty, certainty_of, words_of
from ..materials.law import HypoelasticLaw
from .best import BestFit

#: Draws within the bounds of the fit of which the directions are made.
DRAWS = 2000


def card_certainty(
    problem: FitProblem, best: BestFit, law: HypoelasticLaw, tests: Sequence[str]
) -> CardCertainty | None:
    """About the card's law, from draws that keep the bounds of the fit; None where none is known.

    Where the error of the mesh is told and not taken out, the draws lie about the law of ever
    finer meshes: how far that is from the card's counts as a standard deviation does.
    """
    sure = best.certainty
    known = None if sure is None else sure.fine or sure.posterior
    if sure is None or known is None:
        return None
    unknowns = known.unknowns
    drawn = known.sample(DRAWS, np.random.default_rng(0))[:, : unknowns.size]
    values = sum(sum(c.objective.sizes) for c in problem.comparisons)
    words = words_of(tests, values, sure.fine is not None)
    return certainty_of(law, drawn @ unknowns.to_coefficients.T, words)
