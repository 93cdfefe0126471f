"""The one stiffness that data tell which do not tell warp from fill.

Heights at the centre of a circular sheet are such data: laws along a valley, from E1 above E2 to E1
below E2, fit them alike. All of them have about the curve of one balanced law, E1 = E2, which is
therefore what the data tell. Its modulus is the geometric mean of E1 and E2 within 2 %, if E1 is up
to 2.5 times E2; at 4 times it is 11 % above. (With a given nu12, warp and fill are exchanged with
slightly different moduli.) It falls with G12, by 3 % where this is an eighth of E, 12 % at two
thirds.
"""

from __future__ import annotations

import numpy as np

from ..notes import Note, NoteKind, Objection
from .noise import Noise
from .posterior import DRAWS
from .problem import Evaluation, FitProblem
from .reported import ReportedModulus
from .shear_valley import ValleySearch

ONE_STIFFNESS = NoteKind(
    "one stiffness",
    weight=18.5,
    objection=Objection(
        "heights at the centre of a circular sheet tell one stiffness, and not warp from fill",
        "add gauges off the apex along warp and fill, strips, or an elliptic rim (bubblefit plan "
        'ranks them), or fit a law of E1 = E2: [law] symmetry = "balanced"',
        unusable=True,
    ),
)


def balanced_modulus(
    problem: FitProblem, best: Evaluation, noise: Noise, end: float
) -> ReportedModulus | None:
    """Return the modulus of laws with E1 = E2 that fit the data, with its band.

    G12 may be any between its bounds: its logarithm counts as evenly distributed but for the data.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The best fit, from which the search starts.
    noise : Noise
    end : float
        Largest log strain of the modulus.

    Returns
    -------
    ReportedModulus or None
        None where analyses fail.
    """
    strain = np.linspace(0.0, end, 11)
    search = ValleySearch(problem, best, noise, strain)
    valley = search.valley(search.balance())
    if valley is None:
        return None
    draws = valley.draws(DRAWS, np.random.default_rng(0))
    samples = draws @ problem.unknowns.modulus_rows("E1", strain).T
    value = np.median(samples, axis=0)
    return ReportedModulus.of_samples(strain, value, samples, "E1", problem.unknowns)


def note_of_one_stiffness(modulus: ReportedModulus | None) -> Note:
    """Return the note on data that do not tell warp from fill, with the stiffness they tell."""
    words = "heights at the centre of a circular sheet do not tell warp from fill"
    if modulus is not None:
        values = [
            f"{modulus.value[k]:.4g} MPa ({modulus.lower[k]:.4g} to {modulus.upper[k]:.4g}) at "
            f"{100 * modulus.strain[k]:.2g} %"
            for k in (0, -1)
        ]
        words += (
            "; they tell one stiffness, that of a balanced sheet with E1 = E2 and any G12 between "
            f"its bounds: {' and '.join(values)} of strain. It is about the geometric mean of E1 "
            "and E2 unless E1 is several times E2"
        )
    return Note(ONE_STIFFNESS, words)
