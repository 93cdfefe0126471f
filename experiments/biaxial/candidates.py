"""Biaxial tests that could be made next: one load ratio each, of one cruciform."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.designers import RATIOS, shares
from ...materials.law import HypoelasticLaw
from ...materials.responses import biaxial_response, largest_load
from ...readers.biaxial import BiaxialPath, BiaxialTable, Cycle
from ...readers.frames import FrameSource
from ..kinds import Candidate, Planning, Precision
from .objective import EXTENSOMETER, PERCENT
from .prepared import PreparedBiaxial
from .section import BiaxialSection, TablesSection
from .test import BiaxialData, BiaxialTest

Array = NDArray[np.float64]

#: Beside the five of designers' constants.
FURTHER = ("1:5", "5:1")
#: Loads of a path; values of a strain's curve that are taken to be independent where the project
#: has no biaxial test: an extensometer drifts, and errs alike along much of it.
LOADS, INDEPENDENT = 20, 5
#: Of the load at which a strain is at its end: where a path begins.
PRESTRESS = 0.05


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return each ratio by itself, up to the strains that the law is known for."""
    own = [test for test in planning.present if isinstance(test, PreparedBiaxial)]
    noise_is = "assumed" if not own else f"that of {own[0].test.name}"
    if planning.noise is not None:
        noise_is = "given"
    return [
        Candidate(f"biaxial {ratio}", partial(_made, ratio, own, planning), noise_is)
        for ratio in (*RATIOS, *FURTHER)
    ]


def _made(ratio: str, own: Sequence[PreparedBiaxial], planning: Planning) -> PreparedBiaxial:
    """Return the path with the strains that the law gives."""
    thickness = planning.place.fabric.thickness
    highest = _end(planning.law, planning.ends, ratio, thickness)
    loads = np.outer(np.linspace(PRESTRESS, 1.0, LOADS) * highest, shares(ratio))
    strain = biaxial_response(planning.law, loads, thickness).elongation
    table = BiaxialTable(
        Path("computed"), loads, strain, None, np.arange(LOADS), FrameSource("computed")
    )
    path = BiaxialPath(table, Cycle(ratio, 1, 1, 1, 0, LOADS - 1), 1, loads, strain)
    section = BiaxialSection(data=TablesSection(files=["computed"]))
    test = BiaxialTest(
        name=f"biaxial {ratio}",
        place=planning.place,
        weight=1.0,
        data=BiaxialData((table,), (), (path,)),
        section=section,
        noise=_noise(own, planning) / PERCENT,
    )
    return PreparedBiaxial(test)


def _noise(own: Sequence[PreparedBiaxial], planning: Planning) -> float:
    """Return the noise of independent strains, %."""
    if planning.noise is not None:
        return planning.noise
    known = [planning.precision[t.part(p.ratio)] for t in own for p in t.test.data.paths]
    if not known:
        return Precision(PERCENT * EXTENSOMETER, 1.0, INDEPENDENT).at(LOADS - 1)
    return max(one.at(LOADS - 1) for one in known)


def _end(law: HypoelasticLaw, ends: Array, ratio: str, thickness: float) -> float:
    """Return the larger load (kN/m) at which a yarn is at the end of its strain."""
    low = largest_load(law, thickness, [shares(ratio)], ends[:2])
    if not low > 0:
        raise SolverFailure(f"the law carries no load of ratio {ratio}", "membrane")
    return low
