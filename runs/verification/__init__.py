"""Compare published and closed-form numbers with those of the program as it is installed.

from . import numbers
for subject, several in numbers(): print(subject, [(n.what, n.ours, n.theirs) for n in several])
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from ...errors import InputError
from .closed_forms import bent_tubes, hencky_membranes, thin_walls
from .number import Number
from .published import (
    abaqus_bubbles,
    marc_bars,
    marc_bubble,
    measured_strips,
    poisson_ratios,
    strips,
    with_calculix,
)

SUBJECTS: Mapping[str, Callable[[], Iterable[Number]]] = {
    "bars": marc_bars,
    "hencky": hencky_membranes,
    "abaqus": abaqus_bubbles,
    "marc bubble": marc_bubble,
    "strips": strips,
    "thin walls": thin_walls,
    "bent tube": bent_tubes,
    "nu12": poisson_ratios,
    "calculix": with_calculix,
}


def numbers(
    subjects: Iterable[str] = SUBJECTS, data: Path | None = None
) -> Iterator[tuple[str, list[Number]]]:
    """Yield the numbers of each subject; none where its program is not installed.

    Parameters
    ----------
    data : folder of the measured strips, which are not part of the program; they come last.

    Raises
    ------
    InputError : there is no such subject, or no such data. SolverFailure : an analysis did not
        end well.
    """
    for subject in (chosen := list(subjects)):
        if subject not in SUBJECTS:
            problem = f"{subject!r} is not one of: {', '.join(SUBJECTS)}"
            raise InputError(None, "--subject", problem)
    for subject in chosen:
        yield subject, list(SUBJECTS[subject]())
    if data is not None:
        yield "measured strips", list(measured_strips(data))


__all__ = ["SUBJECTS", "Number", "numbers"]
