"""Verification of an installation: each subject compared in turn, and what came of it."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...arguments import checked_arguments
from ...errors import check_one_of
from ...lazy_modules import LazyFunction
from ...lazy_modules import pandas as pd
from ...notes import Verdict
from ..folder import Reported
from ..progress import Listener, listener
from . import SUBJECTS, Number


@dataclass(frozen=True, eq=False)
class Verification(Reported):
    """Hold numbers beside published ones.

    Attributes
    ----------
    subjects : mapping of str to sequence of Number
        By subject; none where the program for it is not installed.
    """

    subjects: Mapping[str, Sequence[Number]]

    @property
    def missed(self) -> list[Number]:
        """Return the numbers whose deviation is larger than allowed."""
        return [
            number for numbers in self.subjects.values() for number in numbers if not number.met
        ]

    @property
    def verdict(self) -> Verdict:
        """Return whether this installation computes the published numbers."""
        count = sum(map(len, self.subjects.values()))
        absent = [subject for subject, numbers in self.subjects.items() if not numbers]
        missed = tuple(number.quantity for number in self.missed)
        step = "see which solvers and libraries are installed (bubblefit doctor)"
        sentence = f"all {count} numbers are met"
        if missed:
            sentence = f"{len(missed)} of {count} numbers are missed"
        return Verdict(
            "not to be used" if missed else "usable",
            sentence,
            missed,
            f"{', '.join(absent)}: not installed, nothing compared" if absent else "",
            step if missed else "",
        )

    @property
    def result(self) -> dict[str, Any]:
        """Return all numbers as plain values, as the command prints them with --json."""
        rows = [
            {"subject": subject, **number.row}
            for subject, numbers in self.subjects.items()
            for number in numbers
        ]
        return {
            "command": "verify",
            "ok": not self.missed,
            "verdict": self.verdict.numbers,
            "numbers": rows,
        }

    def table(self) -> pd.DataFrame:
        """Return the numbers.

        Returns
        -------
        DataFrame
            One row per number: `subject`, `what` (quantity and case), `ours`, `theirs`, `unit`,
            `allowed`, `source`, `absolute`, `deviation`, `met`.
        """
        return pd.DataFrame(self.result["numbers"])


@checked_arguments
def verify(
    subjects: Sequence[str] | None = None,
    *,
    data: Path | str | None = None,
    progress: Listener = None,
    saw: Callable[[str, Sequence[Number]], None] = lambda subject, numbers: None,
) -> Verification:
    """Compare this installation with published numbers and closed forms; takes a few minutes.

    Parameters
    ----------
    subjects : sequence of str, optional
        Names of the subjects to verify; by default all.
    data : path, optional
        Folder of the measured strips, compared at last.
    progress : callable or bool, optional
        Receives the subjects done, their number, and the one that begins.
    saw : callable
        Receives each subject and its numbers as it ends.

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        There is no such subject, or no measured data.
    """
    chosen = list(SUBJECTS if subjects is None else subjects)
    for subject in chosen:
        check_one_of(subject, SUBJECTS, "--subject")
    comparisons: dict[str, Callable[[], Iterable[Number]]] = {n: SUBJECTS[n] for n in chosen}
    if data is not None:
        measured_strips = LazyFunction(f"{__package__}.uniaxial", "measured_strips")
        comparisons["measured strips"] = functools.partial(measured_strips, Path(data))
    on_event = listener(progress)
    numbers = dict[str, Sequence[Number]]()
    for count, (subject, compare) in enumerate(comparisons.items()):
        on_event(count, len(comparisons), subject)
        numbers[subject] = list(compare())
        saw(subject, numbers[subject])
    on_event(len(comparisons), len(comparisons), "")
    return Verification(numbers)
