"""A finished fit as one test sees it, and what it means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..notes import Note, NoteKind
from ..solvers.base import Array, History

if TYPE_CHECKING:
    from ..inference.assessment import Certainty
    from ..inference.comparison import Comparison
    from ..materials.law import HypoelasticLaw
UNMATCHED = NoteKind("unmatched direction", weight=9)


@dataclass(frozen=True, eq=False)
class FittedTest:
    """One test with the results of a finished fit.

    Parameters
    ----------
    comparisons, histories : tuples
        Of the test, in its order, as `Weighting()` gives them.
    nuisance : mapping of str to float
        By plain name, in the unit of each.
    law : HypoelasticLaw
        The best.
    laws : sequence of HypoelasticLaw
        Of the best starts, best first.
    reached : (3,) array
        Largest strain (eps1, eps2, gamma12) in all tests.
    valid : (3,) array
        The ends up to which the moduli are fitted.
    certainty : Certainty, optional
    """

    comparisons: tuple[Comparison, ...]
    histories: tuple[History, ...]
    nuisance: Mapping[str, float]
    law: HypoelasticLaw
    laws: Sequence[HypoelasticLaw]
    reached: Array
    valid: Array
    certainty: Certainty | None


@dataclass(frozen=True, eq=False)
class Findings:
    """The meaning of a fit for one test.

    Parameters
    ----------
    numbers : dict
        For result.json.
    warnings : tuple of Note
    lines : tuple of str
        For the terminal.
    quality : str
        In a few words, for the card.
    summary : str
        A clause for the head of the page.
    """

    numbers: dict[str, Any]
    warnings: tuple[Note, ...] = ()
    lines: tuple[str, ...] = ()
    quality: str = ""
    summary: str = ""
