"""The part of a finished fit that concerns one test, and what a presenter finds in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ..light_dataclasses import dataclass
from ..notes import Note, NoteKind, Objection
from ..solvers.base import Array, History

if TYPE_CHECKING:
    from ..inference.assessment import Certainty
    from ..inference.comparison import Comparison
    from ..materials.law import HypoelasticLaw
UNMATCHED = NoteKind("unmatched direction", weight=9)
DIRECTIONS_MISSED = NoteKind(
    "directions missed",
    weight=16,
    objection=Objection(
        "the law cannot follow the directions of the strips",
        'try form = "spline-ratio" in [law], or do not use the law at an angle to the yarns',
    ),
)


@dataclass(frozen=True, eq=False)
class FittedTest:
    """One test with the results of a finished fit.

    Parameters
    ----------
    comparisons : tuple of Comparison
        The test's comparisons of model and data, in its order, weighted by `Weighting()`.
    histories : tuple of History
        The response of each comparison's model with the best law.
    nuisance : mapping of str to float
        Values of the test's nuisance unknowns by their plain names, each in its unit.
    law : HypoelasticLaw
        The law that was identified.
    laws : sequence of HypoelasticLaw
        The laws found from the best starts of the fit, best first.
    reached : (3,) array
        Largest strains (eps1, eps2, gamma12) in all tests of the fit.
    valid : (3,) array
        Largest strains up to which the moduli are identified.
    certainty : Certainty, optional
        The uncertainty of the law, where it was assessed.
    compared_with : sequence of str
        Names of all comparisons of the fit, those of its other tests included.
    """

    comparisons: tuple[Comparison, ...]
    histories: tuple[History, ...]
    nuisance: Mapping[str, float]
    law: HypoelasticLaw
    laws: Sequence[HypoelasticLaw]
    reached: Array
    valid: Array
    certainty: Certainty | None
    compared_with: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class Findings:
    """Hold what a finished fit means for one test, in numbers and words.

    Parameters
    ----------
    numbers : dict
        Entries of result.json.
    warnings : tuple of Note
        Why the result may not be believed.
    lines : tuple of str
        Lines for the terminal.
    quality : str
        The quality of the fit in a few words, for the material card.
    summary : str
        A clause for the head of the page of the report.
    """

    numbers: dict[str, Any]
    warnings: tuple[Note, ...] = ()
    lines: tuple[str, ...] = ()
    quality: str = ""
    summary: str = ""
