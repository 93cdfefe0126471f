"""What is compared, subject by subject: one file each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from ...errors import InputError
from .abaqus import abaqus_bubbles
from .bars import marc_bars
from .bent_tube import bent_tubes
from .calculix import with_calculix
from .hencky import hencky_membranes
from .marc_bubble import marc_bubble
from .number import Number
from .poisson import poisson_ratios
from .strips import measured_strips, strips
from .thin_walls import thin_walls

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
    """The numbers of each subject as they are computed; none where its program is not installed.

    Parameters
    ----------
    data : folder of the measured strips, which are not part of the program: they come last.

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
