"""The linear evaluation of a biaxial test: designers' constants, and what they hang on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ...data.biaxial.paths import BiaxialPath, evaluated_paths
from ...errors import InputError
from ...materials.designers.linear import (
    USUAL,
    Evaluation,
    LinearPath,
    Options,
    evaluate,
    evaluate_others,
    line_of,
)
from ...notes import Note, NoteKind
from .kept import KeptStrain, kept_strains
from .test import BiaxialTest

#: Constants that differ by more between options (largest over smallest) are worth a word.
WIDE = 1.1


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
        every = [one.constants for one in (self.chosen, *self.others)]
        named = {"E warp": "warp", "E fill": "fill", "nu warp": "nu_warp", "nu fill": "nu_fill"}
        return {
            words: (min(getattr(c, key) for c in every), max(getattr(c, key) for c in every))
            for words, key in named.items()
        }


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


def _settled(lines: Sequence[LinearPath], options: Options) -> Evaluation | None:
    try:
        return evaluate(lines, options)
    except InputError:
        return None


def _of_cycle(test: BiaxialTest, which: int | str, options: Options) -> Evaluation | None:
    """With another cycle of the same ratios, without the conditioning that is asked for."""
    section, data = test.section, test.data
    ratios = [path.ratio for path in data.paths]
    paths = evaluated_paths(
        data.tables, data.cycles, "last" if which == "last" else 1, section.conditioning, ratios
    )
    if section.range is not None:
        try:
            paths = [path.between(*section.range) for path in paths]
        except InputError:
            return None
    found = _settled(_lines(paths), options)
    return None if found is None else replace(found, options=options)
