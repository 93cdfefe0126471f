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
    comparisons, histories : its own, in its own order, as `Weighting()` gives them. nuisance : by
    plain name, in the unit of each. law : the best; laws : of the best starts, best first.
    reached : (3,) largest strain (eps1, eps2, gamma12) in all tests. valid : (3,) the ends up to
    which the moduli are fitted."""

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
    numbers : for result.json. lines : for the terminal. quality : in a few words, for the card.
    summary : a clause for the head of the page."""

    numbers: dict[str, Any]
    warnings: tuple[Note, ...] = ()
    lines: tuple[str, ...] = ()
    quality: str = ""
    summary: str = ""
