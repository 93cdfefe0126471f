"""The linear evaluation of a biaxial test: designers' constants, and what they hang on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...data.biaxial.paths import BiaxialPath, Which, evaluated_paths
from ...errors import InputError
from ...materials.designers.linear import (
    USUAL,
    Evaluation,
    LinearPath,
    Options,
    evaluate,
    evaluate_or_none,
    evaluate_others,
    line_of,
)
from ...materials.designers.rows import spread_of
from ...notes import Note, NoteKind
from .kept import KeptStrain, kept_strains
from .test import BiaxialTest

#: Constants that differ by more between options (largest over smallest) are worth a word.
WIDE = 1.1
#: Of what a spread is told.
NAMES = {"warp": "E warp", "fill": "E fill", "nu_warp": "nu warp", "nu_fill": "nu fill"}


@dataclass(frozen=True, eq=False)
class BiaxialEvaluation:
    """Constants of one test.

    paths, lines : measured, and their regression lines, ratio by ratio. chosen : of the options
    that were asked for; others : of the others that the paths settle. first, last : of the same
    options with the first and the last cycle of each ratio, None where they do not settle it.
    kept : strain that the fabric kept, ratio by ratio.
    """

    test: str
    paths: tuple[BiaxialPath, ...]
    lines: tuple[LinearPath, ...]
    chosen: Evaluation
    others: tuple[Evaluation, ...]
    first: Evaluation | None
    last: Evaluation | None
    kept: tuple[KeptStrain, ...]

    @property
    def notes(self) -> list[Note]:
        """What a reader of the constants should know."""
        c, found = self.chosen.constants, []
        if not c.stable:
            words = (
                f"nu_warp nu_fill is {c.nu_warp * c.nu_fill:.3g}: a fabric with these constants "
                "has no stable strain; no program takes them"
            )
            found.append(Note(NoteKind.UNSTABLE, words, self.test))
        for name, values in self.spread.items():
            low, high = values
            if not low > 0 or high / low > WIDE:
                words = (
                    f"{name} lies between {low:.4g} and {high:.4g} by what is evaluated: say which "
                    "options are meant wherever the constants are given"
                )
                found.append(Note(NoteKind.UNCERTAIN, words, self.test))
        words = f"{self.test} pulls along the yarns only: it says nothing of the shear stiffness"
        return [*found, Note(NoteKind.UNMATCHED, words)]

    @property
    def spread(self) -> dict[str, tuple[float, float]]:
        """Least and largest of each constant over all options."""
        ends = spread_of((self.chosen, *self.others))
        return {NAMES[name]: pair for name, pair in ends.items()}


def evaluate_test(test: BiaxialTest, options: Options = USUAL) -> BiaxialEvaluation:
    """The constants of a test by some options, beside those of all others.

    Raises
    ------
    InputError : paths that do not settle the constants.
    """
    paths = test.data.paths
    lines = _lines(paths)
    there = [line.ratio for line in lines]
    missing = [ratio for ratio in options.ratios if ratio not in there]
    if missing:
        problem = f"there is no ratio {', '.join(missing)}; the test has: {', '.join(there)}"
        raise test.place.error("ratios", problem)
    try:
        chosen = evaluate(lines, options)
    except InputError as error:
        raise test.place.error("data", error.problem) from None
    others = evaluate_others(lines, options)
    return BiaxialEvaluation(
        test.name,
        paths,
        lines,
        chosen,
        tuple(others),
        _of_cycle(test, 1, options),
        _of_cycle(test, "last", options),
        kept_strains(test.data),
    )


def _lines(paths: Sequence[BiaxialPath]) -> tuple[LinearPath, ...]:
    return tuple(line_of(path.ratio, path.load, path.since) for path in paths)


def _of_cycle(test: BiaxialTest, which: Which, options: Options) -> Evaluation | None:
    """With another cycle of the same ratios, without the conditioning that is asked for."""
    section, data = test.section, test.data
    ratios = [path.ratio for path in data.paths]
    paths = evaluated_paths(data.tables, data.cycles, which, section.conditioning, ratios)
    if section.range is not None:
        try:
            paths = [path.between(*section.range) for path in paths]
        except InputError:
            return None
    return evaluate_or_none(_lines(paths), options)
