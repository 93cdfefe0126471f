"""Verdicts of fits and of predictions, and the moduli of a fit at a few strains, as reported.

A verdict says up to which strains moduli can be used.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..experiments.base import DIRECTIONS_MISSED
from ..inference.discrepancy import WRONG_FORM
from ..inference.noise import ABOVE_NOISE, MISFIT_ADVICE, Misfit
from ..inference.nuisance_fit import NuisanceVerdict
from ..inference.reported import BOUND_MARK, Flags, ReportedModulus, sigma_words
from ..materials.forms.base import COMPONENTS, SHEAR, Array
from ..materials.forms.symmetry import modulus_labels
from ..notes import Note, NoteKind, Objection, State, Verdict
from ..wording import percent
from .starts import BestFit

NOT_CONVERGED = NoteKind(
    "not converged",
    weight=20,
    objection=Objection(
        "the fit has not converged",
        "let it run longer: raise max_analyses in [fit], and fit again",
        unusable=True,
    ),
)

Span = tuple[float, float]

#: Largest relative half width of the 95 % band with which a modulus counts as usable, and largest
#: error, relative to the largest measured value, with which a prediction does.
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
    "fit with a solver that gives derivatives, such as the embedded one (bubblefit doctor)",
)
WITHIN = f"±{percent(USABLE)}"
NOTHING_USABLE = Objection(f"no modulus is known to {WITHIN} at any strain", "", unusable=True)
COMPARE_CURVES = "see in the charts where model and measured values part: card or data are doubtful"
FURTHER_MEASUREMENT = "compare the filled deck with a measurement that was not fitted"
#: Advice in place of that which names a study of the law, for fits that have none.
ADVICE_WITHOUT_LAW = dict.fromkeys(
    (MISFIT_ADVICE, WRONG_FORM.advice),
    "look for wrong data (bubblefit check), then for what the deck keeps fixed: loads, supports "
    "and further parameters",
)
NO_BANDS = "the moduli have no bands"
BEYOND = "any modulus beyond the strains that the tests reach"


@dataclass(frozen=True)
class UsableRange:
    """The longest intervals of strain, up to `end`, where a modulus is usable or not determined.

    `label` : how the modulus is called where others follow from it, such as "E".
    """

    usable: Span | None
    unknown: Span | None
    end: float
    label: str

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
class FitVerdict(Verdict):
    """The verdict of a fit.

    Attributes
    ----------
    moduli : dict of UsableRange
        By modulus.
    """

    moduli: Mapping[str, UsableRange] = field(default_factory=dict)

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the verdict as it is written to `result.json`."""
        return {
            **super().numbers,
            "within": USABLE,
            "moduli": {
                name: {"usable": r.usable, "not_known": r.unknown}
                for name, r in self.moduli.items()
            },
        }


def verdict_of(
    best: BestFit,
    notes: Sequence[Note],
    misfit_of: Mapping[str, Misfit],
    fitted: Collection[str],
) -> FitVerdict:
    """Judge a fit by its bands, its misfits and the notes that speak against its moduli.

    Parameters
    ----------
    best : BestFit
    notes : sequence of Note
        All notes of the fit.
    misfit_of : mapping of Misfit
        By the name of what was compared; strips at an angle have "bias" or "degrees" in theirs.
    fitted : collection of str
        Moduli with a coefficient that is fitted.

    Returns
    -------
    FitVerdict
    """
    moduli = usable_ranges(best)
    if SHEAR in moduli and any(note.kind == DIRECTIONS_MISSED for note in notes):
        moduli[SHEAR] = replace(moduli[SHEAR], usable=None)
    objections = _objections(best, objections_in(notes, misfit_of), moduli)
    reasons = tuple(objection.reason for objection in objections)
    advice = objections[0].advice if objections else ""
    step = advice or _further_test(moduli, misfit_of, fitted)
    if _are_unusable(objections):
        return FitVerdict("not to be used", "; ".join(reasons), reasons, "", step, moduli)
    state = _state(True, bool(reasons) or _is_short(moduli, fitted))
    sentence = NO_BANDS if best.certainty is None else usable_words(moduli)
    return FitVerdict(state, sentence, reasons, unknown_words(moduli), step, moduli)


def _objections(
    best: BestFit, of_notes: Sequence[Objection], moduli: Mapping[str, UsableRange]
) -> list[Objection]:
    """Return the objections of the notes, then that no uncertainty, or no modulus, is known."""
    objections = [*of_notes]
    if best.certainty is None:
        objections.append(NO_CERTAINTY)
    elif not _are_unusable(objections) and not any(modulus.usable for modulus in moduli.values()):
        objections.append(NOTHING_USABLE)
    return objections


def verdict_of_parameters(
    verdicts: Sequence[NuisanceVerdict],
    notes: Sequence[Note],
    misfit_of: Mapping[str, Misfit],
) -> FitVerdict:
    """Judge a fit that has parameters of decks only, by bands, misfits and notes."""
    objections = objections_in(notes, misfit_of)
    usable = [v.name for v in verdicts if max(v.half_widths) <= USABLE * abs(v.value)]
    unknown = [v.name for v in verdicts if v.name not in usable]
    reasons = [objection.reason for objection in objections]
    step = next((objection.advice for objection in objections), FURTHER_MEASUREMENT)
    step = ADVICE_WITHOUT_LAW.get(step, step)
    sentence = f"known to {WITHIN}: {', '.join(usable) or 'no parameter'}"
    state = _state(bool(usable) and not _are_unusable(objections), bool(reasons or unknown))
    return FitVerdict(state, sentence, tuple(reasons), ", ".join(unknown), step)


def _are_unusable(objections: Sequence[Objection]) -> bool:
    """Return whether an objection forbids the use of the card."""
    return any(objection.unusable for objection in objections)


def _state(is_usable: bool, has_limits: bool) -> State:
    """Return the verdict in one word or phrase."""
    if not is_usable:
        return "not to be used"
    return "usable within limits" if has_limits else "usable"


def state_of_predictions(errors: Mapping[str, float], reasons: Collection[str]) -> State:
    """Return whether predictions can be used.

    Parameters
    ----------
    errors : mapping of str to float
        Error of each prediction that is compared, relative to the largest measured value.
    reasons : collection of str
        What else speaks against them.
    """
    large = large_errors(errors)
    if large and len(large) == len(errors):
        return "not to be used"
    return "usable within limits" if large or reasons else "usable"


def largest_error(errors: Mapping[str, float]) -> float | None:
    """Return the largest error of predictions, NaN if one is no number; None without errors."""
    return float(np.max([*errors.values()])) if errors else None


def large_errors(errors: Mapping[str, float]) -> tuple[str, ...]:
    """Return in words the errors of predictions that are larger than `USABLE`, or no number."""
    return tuple(
        f"{name} is off by {percent(error)} of the largest measured value, more than the "
        f"{percent(USABLE)} that count as usable"
        for name, error in errors.items()
        if not error <= USABLE
    )


def usable_words(moduli: Mapping[str, UsableRange]) -> str:
    """Return in a sentence up to which strains each modulus is usable."""
    first, *further = moduli.values()
    spans = [f"{first.label} is known to {WITHIN} {span_words(first.usable, first.end)}"]
    spans += [f"{r.label} {span_words(r.usable, r.end)}" for r in further]
    return ", ".join(spans)


def unknown_words(moduli: Mapping[str, UsableRange]) -> str:
    """Return in words which moduli are not known at all, within and beyond the strains reached."""
    spans = [f"{r.label} {span_words(r.unknown, r.end)}" for r in moduli.values() if r.unknown]
    return "; ".join([", ".join(spans), BEYOND] if spans else [BEYOND])


def _is_short(moduli: Mapping[str, UsableRange], fitted: Collection[str]) -> bool:
    """Return whether a fitted modulus is not usable over all the strains that were reached."""
    return any(r.is_short for name, r in moduli.items() if r.is_reached and name in fitted)


def objection_to_misfit(misfit_of: Mapping[str, Misfit]) -> Objection | None:
    """Return by how much of what was measured a fit is off at worst, and whether that is too much.

    It is None where measured values are not known, or nothing is off by more than its noise. A fit
    that misses what it was made of by more than counts as usable in a prediction is not usable.
    """
    above = {name: misfit for name, misfit in misfit_of.items() if misfit.ratio > 1.0}
    name = max(above, key=lambda name: above[name].share, default=None)
    if name is None or not above[name].share > 0:
        return None
    misfit = above[name]
    values = {"N": "loads", "mm": "displacements"}.get(misfit.unit, "values")
    reason = (
        f"the fit is off by {percent(misfit.share)} of the {values} of {name} (RMS), "
        f"{misfit.ratio:.3g} times their noise"
    )
    return Objection(reason, MISFIT_ADVICE, unusable=misfit.share > USABLE)


def objections_in(notes: Sequence[Note], misfit_of: Mapping[str, Misfit]) -> list[Objection]:
    """Return the objections of notes to the moduli, each once, those of an unusable fit first.

    Of these, that a fit has not converged comes first: more analyses may remove the others. Within
    each group the heaviest kind of note comes first, but a wrong form of the law last: faults of
    the data look like one.
    """
    by_weight = sorted({note.kind for note in notes}, key=lambda kind: -kind.weight)
    by_kind = {kind: kind.objection for kind in by_weight}
    if ABOVE_NOISE in by_kind:
        by_kind[ABOVE_NOISE] = objection_to_misfit(misfit_of) or ABOVE_NOISE.objection
    objections = dict.fromkeys(item for item in by_kind.values() if item is not None)
    unfinished = NOT_CONVERGED.objection
    return sorted(
        objections,
        key=lambda item: (not item.unusable, item is not unfinished, item is WRONG_FORM),
    )


def _further_test(
    moduli: Mapping[str, UsableRange], comparisons: Collection[str], fitted: Collection[str]
) -> str:
    """Return the test to make next of a fit that nothing speaks against."""
    short_moduli = _short_moduli(moduli, fitted)
    if SHEAR in short_moduli and not any(re.search("bias|degrees$", name) for name in comparisons):
        return "add strips at 45 degrees (bias), which shear the fabric"
    if short_moduli:
        labels = ", ".join(moduli[name].label for name in short_moduli)
        return f"let bubblefit plan rank the tests that would narrow {labels}"
    return "see how well the law predicts a test that was left out: bubblefit validate"


def _short_moduli(moduli: Mapping[str, UsableRange], fitted: Collection[str]) -> list[str]:
    """Return the fitted moduli that a further test should determine better.

    A strap, or strips along one yarn only, say nothing of a fabric's shear, nor are they to.
    """
    has_both_yarns = all(r.is_reached for name, r in moduli.items() if name != SHEAR)
    return [
        name
        for name, modulus in moduli.items()
        if name in fitted
        and modulus.is_short
        and (modulus.is_reached or (name == SHEAR and has_both_yarns))
    ]


def usable_ranges(best: BestFit) -> dict[str, UsableRange]:
    """Return the strains at which each modulus is usable by its 95 % band, or undetermined."""
    ranges = {}
    certainty = best.certainty
    for name, label in modulus_labels(best.law.form).items():
        end = float(best.valid[COMPONENTS[name]])
        if certainty is None:
            ranges[name] = UsableRange(None, (0.0, end), end, label)
            continue
        modulus = certainty.moduli[name]
        strain = modulus.strain
        value = modulus.value
        half_width = np.maximum(modulus.upper - value, value - modulus.lower) / value
        # A bound of the fit is no knowledge from the data.
        is_measured = modulus.determined & ~modulus.on_lower_bound & ~modulus.on_upper_bound
        usable = _longest(strain, (half_width <= USABLE) & is_measured)
        unknown = _longest(strain, ~modulus.determined)
        ranges[name] = UsableRange(usable, unknown, end, label)
    return ranges


def _longest(strain: Array, chosen: Flags) -> Span | None:
    """Return the ends of the longest interval of chosen strains; None if it is too short.

    Parameters
    ----------
    strain : (n,) array
        Log strains, rising.
    chosen : (n,) array of bool
        Which of them are meant.
    """
    # Where a run of chosen strains begins, and the index after its last one, in turn.
    padded = np.concatenate([[0], chosen.astype(int), [0]])
    edges = np.flatnonzero(np.diff(padded))
    lowest = strain[edges[::2]].tolist()
    highest = strain[edges[1::2] - 1].tolist()
    spans = list(zip(lowest, highest, strict=True))
    longest = max(spans, key=lambda span: span[1] - span[0], default=(0.0, 0.0))
    return longest if longest[1] - longest[0] > SHORT * strain[-1] else None


def span_words(span: Span | None, end: float) -> str:
    """Return an interval of strains in words; `end` is the largest fitted strain."""
    if span is None:
        return "at no strain"
    if end < LEAST_STRAIN:
        return "at any strain"
    low, high = (f"{100 * strain:.2g}" for strain in span)
    words = f"from {low} to {high}" if span[0] > 0.0 else f"up to {high}"
    return f"{words}{SPACE}% strain"


#: Logarithmic strains of the summary, to which the largest valid strain is added.
ANSWER_STRAINS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3)


@dataclass(frozen=True)
class Answer:
    """One modulus at one logarithmic strain, as it is reported.

    Attributes
    ----------
    modulus : str
    strain : float
    value : float
        The modulus, MPa.
    per_width : float
        Modulus times thickness, kN/m.
    end : bool
        Whether this is the largest strain for which the modulus is fitted.
    sigma : float or None
        Half the width of the 68 % interval over the modulus; None if not known.
    band : tuple of float, or None
        Ends of the 95 % band, MPa; None if not known.
    bounds : tuple of bool
        Whether a bound of the fit makes the lower and the upper end of the band.
    on_bound : str
        The bound that the value itself lies on ("lower", "upper"), "" for none.
    determined : bool
        Whether the data determine the modulus.
    """

    modulus: str
    strain: float
    value: float
    per_width: float
    end: bool
    sigma: float | None = None
    band: tuple[float, float] | None = None
    bounds: tuple[bool, bool] = (False, False)
    on_bound: str = ""
    determined: bool = False

    def with_certainty(self, reported: ReportedModulus) -> Answer:
        """Return the answer with what is reported of the modulus at this one strain."""
        on_bound = "upper" if reported.on_upper_bound[0] else ""
        return replace(
            self,
            sigma=float(reported.sigma[0]),
            band=(float(reported.lower[0]), float(reported.upper[0])),
            bounds=(bool(reported.at_lower_bound[0]), bool(reported.at_upper_bound[0])),
            on_bound="lower" if reported.on_lower_bound[0] else on_bound,
            determined=bool(reported.determined[0]),
        )

    @property
    def marks(self) -> tuple[str, str, str]:
        """Return the mark of a bound at value, lower and upper end, "" where there is none."""
        lower, upper = self.bounds
        return BOUND_MARK * bool(self.on_bound), BOUND_MARK * lower, BOUND_MARK * upper

    @property
    def value_words(self) -> str:
        """Return the modulus in MPa, marked where it lies on a bound."""
        return f"{self.value:.4g}{self.marks[0]}"

    @property
    def sigma_words(self) -> str:
        """Return one standard deviation in words."""
        if self.sigma is None:
            return "not known"
        return sigma_words(self.sigma, not self.determined)

    @property
    def band_words(self) -> str:
        """Return the ends of the band in MPa, marked where a bound of the fit makes them."""
        if self.band is None:
            return "not known"
        _, lower, upper = self.marks
        return f"{self.band[0]:.4g}{lower} to {self.band[1]:.4g}{upper}"

    @property
    def numbers(self) -> dict[str, Any]:
        """Return the row as it is written to `result.json`."""
        lower, upper = self.bounds
        return {
            "strain": self.strain,
            "MPa": self.value,
            "kN_per_m": self.per_width,
            "sigma": self.sigma,
            "band": self.band,
            "at_lower_bound": lower,
            "at_upper_bound": upper,
            "on_bound": self.on_bound or None,
            "determined": self.determined,
        }


def answers(best: BestFit, thickness: float) -> list[Answer]:
    """Return the moduli that follow from no others, at a few strains up to the last valid one.

    Parameters
    ----------
    best : BestFit
    thickness : float
        mm.
    """
    rows = []
    for name in modulus_labels(best.law.form):
        end = float(best.valid[COMPONENTS[name]])
        strains = [strain for strain in ANSWER_STRAINS if strain < 0.95 * end]
        for strain in (*strains, end):
            value = float(best.law.modulus(name, strain))
            answer = Answer(name, strain, value, value * thickness, strain == end)
            if best.certainty is not None:
                reported = best.certainty.at(best.law, name, np.array([strain]))
                answer = answer.with_certainty(reported)
            rows.append(answer)
    return rows


def answer_numbers(best: BestFit, thickness: float) -> dict[str, list[dict[str, Any]]]:
    """Return the numbers of `answers` by modulus."""
    numbers: dict[str, list[dict[str, Any]]] = {}
    for answer in answers(best, thickness):
        numbers.setdefault(answer.modulus, []).append(answer.numbers)
    return numbers
