"""Where a bubble test's data come from: a known solution, or files of measured points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..base import Place
from .increments import merge_increments
from .point_files import PointFiles
from .section import BubbleSection, KnownSolutionSection


@dataclass(frozen=True, eq=False)
class KnownSolution:
    """Data to be computed by the forward model.

    beta : MPa, of the form `form`. elements : of the full disk. increments : MPa, containing the
    pressures. solver : who computes them, the one that fits unless named.
    """

    beta: NDArray[np.float64]
    form: str
    elements: int
    increments: tuple[float, ...]
    symmetry: Literal["full", "quarter"]
    solver: str | None = None


def data_source(
    section: BubbleSection,
    place: Place,
    pressures: Sequence[float],
    increments: Sequence[float],
    measured: PointFiles | None,
) -> KnownSolution | PointFiles:
    """What was measured, or the known solution; pressures and increments are in MPa.

    Raises
    ------
    InputError : a folder of files for computed data, more or fewer files than pressures.
    """
    known, points = section.data.known_solution, section.data.points
    if known is not None:
        return _known(section, known, place, pressures, increments)
    assert points is not None and measured is not None
    found, count = len(measured.files), len(pressures)
    # Where no data are needed, the files may not be there to be counted.
    counted = place.need_data or found
    if (
        measured.recorded is None
        and points.pressure is None
        and counted
        and found not in (count, 1)
    ):
        field = "data.points.files" if points.files is not None else "data.points.indices"
        problem = f"expected one file for each of the {count} pressures, got {found}"
        if points.files is not None:
            problem += "; [bubble.data.points.pressure] says at which pressures they were recorded"
        raise place.error(field, problem)
    return measured


def _known(
    section: BubbleSection,
    known: KnownSolutionSection,
    place: Place,
    pressures: Sequence[float],
    increments: Sequence[float],
) -> KnownSolution:
    field = "data.known_solution"
    if known.increments is not None:
        increments = merge_increments(place, f"{field}.increments", known.increments, pressures)
    return KnownSolution(
        beta=np.array(known.beta) * place.scales.modulus,
        form=known.form,
        elements=known.elements or section.elements,
        increments=tuple(increments),
        symmetry=known.symmetry or section.symmetry,
        solver=known.solver,
    )
