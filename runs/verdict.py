"""The verdict of a fit: whether its moduli can be used, up to which strains, and what is next."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..inference.reported import LEVEL, Flags
from ..materials.forms.base import COMPONENTS, SHEAR, Array
from ..notes import Note, NoteKind, Objection
from ..wording import percent
from .best import BestFit

NOT_CONVERGED = NoteKind(
    "not converged",
    weight=20,
    objection=Objection(
        "the fit has not converged", "raise fit.max_analyses and fit again", unusable=True
    ),
)

State = Literal["usable", "usable within limits", "not to be used"]
Span = tuple[float, float]

#: Largest relative half width of the 95 % band with which a modulus counts as usable.
USABLE = 0.2
#: Share of the strain range below which an interval of strains is too short to count.
SHORT = 0.05
#: Share of the largest strain up to which a modulus must be usable, or else a test is advised.
NEAR_END = 0.95
#: Largest strain below which a modulus counts as not reached by any test.
LEAST_STRAIN = 1e-4
#: Between words that stay on one line.
SPACE = "\u00a0"

NO_CERTAINTY = Objection(
    "the solver gives no derivatives, so that the uncertainty is not known",
    "fit with a solver that differentiates (bubblefit doctor lists them)",
)
NOTHING_USABLE = f"no modulus is known to within {percent(USABLE)} at any strain"


@dataclass(frozen=True)
class UsableRange:
    """The longest intervals of strain, up to `end`, where a modulus is usable or not determined."""

    usable: Span | None
    unknown: Span | None
    end: float

    @property
    def is_reached(self) -> bool:
        """Return whether a test strained the fabric so that this modulus acts."""
        return self.end >= LEAST_STRAIN

    @property
    def is_short(self) -> bool:
        """Return whether the modulus is usable over a part of its strains only, or nowhere."""
        if self.usable is None:
            return True
        return self.usable[0] > 0.0 or self.usable[1] < NEAR_END * self.end


@dataclass(frozen=True)
class FitVerdict:
    """The verdict of a fit, as terminal, page and result.json show it.

    Attributes
    ----------
    state : str
    reasons : tuple of str
        What speaks against the moduli, the gravest first.
    moduli : dict of UsableRange
        By modulus.
    next_step : str
        What brings the fit furthest, in words that follow "next:".
    """

    state: State
    reasons: tuple[str, ...]
    moduli: Mapping[str, UsableRange]
    next_step: str

    @property
    def words(self) -> str:
        """Return the verdict in one sentence."""
        reasons = "; ".join(self.reasons)
        if self.state == "not to be used":
            return f"Not to be used: {reasons}; next: {self.next_step}."
        usable = [f"{name} {span_words(r.usable, r.end)}" for name, r in self.moduli.items()]
        unknown = [
            f"{name} {span_words(r.unknown, r.end)}" for name, r in self.moduli.items() if r.unknown
        ]
        within = f"to within {percent(USABLE)} ({percent(LEVEL)} band)"
        begin = f"Usable {within}: "
        if self.reasons:
            begin = f"Usable within limits ({reasons}), {within}: "
        return (
            f"{begin}{', '.join(usable)}; not known: {', '.join(unknown) or 'nothing'}; "
            f"next: {self.next_step}."
        )

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the verdict as it is written to `result.json`."""
        return {
            "state": self.state,
            "reasons": list(self.reasons),
            "within": USABLE,
            "next": self.next_step,
            "moduli": {
                name: {"usable": r.usable, "not_known": r.unknown}
                for name, r in self.moduli.items()
            },
        }


def verdict_of(
    best: BestFit, notes: Sequence[Note], comparisons: Collection[str], fitted: Collection[str]
) -> FitVerdict:
    """Judge a fit by its bands and by the notes that speak against its moduli.

    Parameters
    ----------
    best : BestFit
    notes : sequence of Note
        All notes of the fit.
    comparisons : collection of str
        Names of what was compared; a 45 degree strip has "bias" in its name.
    fitted : collection of str
        Moduli with a coefficient that is fitted.

    Returns
    -------
    FitVerdict
    """
    objections = objections_in(notes)
    if best.certainty is None:
        objections.append(NO_CERTAINTY)
    moduli = usable_ranges(best)
    reasons = [objection.reason for objection in objections]
    is_unusable = any(objection.unusable for objection in objections)
    if not is_unusable and best.certainty is not None:
        is_unusable = not any(modulus.usable for modulus in moduli.values())
        reasons += [NOTHING_USABLE] * is_unusable
    state: State = "usable"
    if is_unusable:
        state = "not to be used"
    elif objections or _is_short(moduli, fitted):
        state = "usable within limits"
    step = objections[0].advice if objections else _further_test(moduli, comparisons, fitted)
    return FitVerdict(state, tuple(reasons), moduli, step)


def _is_short(moduli: Mapping[str, UsableRange], fitted: Collection[str]) -> bool:
    """Return whether a fitted modulus is not usable over all the strains that were reached."""
    return any(r.is_short for name, r in moduli.items() if r.is_reached and name in fitted)


def objections_in(notes: Sequence[Note]) -> list[Objection]:
    """Return the objections of notes to the moduli, each once, those of an unusable fit first.

    A fit that has not converged is that before all else: the rest may go with more analyses.
    """
    by_weight = sorted({note.kind for note in notes}, key=lambda kind: -kind.weight)
    objections = dict.fromkeys(kind.objection for kind in by_weight if kind.objection is not None)
    unfinished = NOT_CONVERGED.objection
    return sorted(objections, key=lambda item: (not item.unusable, item is not unfinished))


def _further_test(
    moduli: Mapping[str, UsableRange], comparisons: Collection[str], fitted: Collection[str]
) -> str:
    """Return the test to make next of a fit that nothing speaks against."""
    short = _short_moduli(moduli, fitted)
    if SHEAR in short and not any("bias" in name for name in comparisons):
        return "add strips at 45 degrees (bias), which shear the fabric"
    if short:
        return f"rank the tests that narrow {', '.join(short)} (bubblefit plan)"
    return "predict a test that was not fitted (bubblefit validate)"


def _short_moduli(moduli: Mapping[str, UsableRange], fitted: Collection[str]) -> list[str]:
    """Return the fitted moduli that a further test should determine better.

    A strap, or strips along one yarn only, say nothing of a fabric's shear, nor are they to.
    """
    has_both_yarns = all(r.is_reached for name, r in moduli.items() if name != SHEAR)
    short = []
    for name, modulus in moduli.items():
        is_of_use = modulus.is_reached or (name == SHEAR and has_both_yarns)
        if name in fitted and modulus.is_short and is_of_use:
            short.append(name)
    return short


def usable_ranges(best: BestFit) -> dict[str, UsableRange]:
    """Return the strains at which each modulus is usable by its 95 % band, or undetermined."""
    ranges = {}
    sure = best.certainty
    for name, component in COMPONENTS.items():
        end = float(best.valid[component])
        if sure is None:
            ranges[name] = UsableRange(None, (0.0, end), end)
            continue
        modulus = sure.moduli[name]
        strain = modulus.strain
        value = modulus.value
        off = np.maximum(modulus.upper - value, value - modulus.lower) / value
        usable = _longest(strain, (off <= USABLE) & modulus.determined)
        unknown = _longest(strain, ~modulus.determined)
        ranges[name] = UsableRange(usable, unknown, end)
    return ranges


def _longest(strain: Array, chosen: Flags) -> Span | None:
    """Return the ends of the longest interval of chosen strains; None if it is too short."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(int), [0]])))
    runs = [(float(strain[a]), float(strain[b - 1])) for a, b in edges.reshape(-1, 2)]
    longest = max(runs, key=lambda run: run[1] - run[0], default=(0.0, 0.0))
    return longest if longest[1] - longest[0] > SHORT * strain[-1] else None


def span_words(span: Span | None, end: float) -> str:
    """Return an interval of strains in words; `end` is the largest fitted strain."""
    if span is None:
        return "nowhere"
    if end < LEAST_STRAIN:
        return "at any strain"
    low, high = (f"{100 * v:.2g}{SPACE}%" for v in span)
    return f"from {low} to {high}" if span[0] > 0.0 else f"up to {high}"
