"""Propose biaxial tests, one load ratio at a time, as candidates of a test plan."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ...errors import SolverFailure
from ...materials.biaxial_patch import biaxial_response, largest_load
from ...materials.designers import RATIOS, shares
from ...readers.biaxial import BiaxialTable
from ...readers.frames import FrameSource
from ..measured import PERCENT, USUAL_NOISE
from ..planning import Candidate, Planning, Precision
from .paths import BiaxialPath, LoadCycle
from .prepared import PreparedBiaxial
from .test import BiaxialSection, BiaxialTest, TablesSection


@dataclass(frozen=True)
class CandidatePaths:
    """Load paths that a plan proposes."""

    further_ratios: tuple[str, ...] = ("1:5", "5:1")  # beside the five of designers' constants
    loads: int = 20  # number of loads of a path
    independent_values: int = 5  # number in a curve if no test says: extensometers drift
    prestress: float = 0.05  # first load of a path, as a share of its last


CANDIDATES = CandidatePaths()


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return a candidate test for each load ratio, loaded up to the strains of the law's range."""
    prepared = [test for test in planning.present if isinstance(test, PreparedBiaxial)]
    noise_is = planning.noise_is(prepared[0] if prepared else None)
    return [
        Candidate(f"biaxial {ratio}", partial(_computed, ratio, prepared, planning), noise_is)
        for ratio in (*RATIOS, *CANDIDATES.further_ratios)
    ]


def _computed(
    ratio: str, present: Sequence[PreparedBiaxial], planning: Planning
) -> PreparedBiaxial:
    """Return a test of one ratio, with the strains that the current law predicts."""
    thickness = planning.place.fabric.thickness
    highest = largest_load(planning.law, thickness, [shares(ratio)], planning.ends[:2])
    if not highest > 0:
        raise SolverFailure(f"the law carries no load of ratio {ratio}", "membrane")
    count = CANDIDATES.loads
    levels = highest * np.linspace(CANDIDATES.prestress, 1.0, count)
    loads = np.outer(levels, shares(ratio))
    strain = biaxial_response(planning.law, loads, thickness).elongation
    table = BiaxialTable(
        Path("computed"),
        loads,
        strain,
        None,
        np.arange(count),
        FrameSource("computed"),
        name="computed",
    )
    cycle = LoadCycle(
        ratio=ratio,
        phase=1,
        number=1,
        number_in_file=1,
        first=0,
        last=count - 1,
    )
    path = BiaxialPath(table, cycle, 1, loads, strain)
    section = BiaxialSection(data=TablesSection(files=["computed"]))
    test = BiaxialTest(
        name=f"biaxial {ratio}",
        place=planning.place,
        weight=1.0,
        section=section,
        tables=[table],
        paths=[path],
        noise=_noise(present, planning) / PERCENT,
    )
    return PreparedBiaxial(test)


def _noise(present: Sequence[PreparedBiaxial], planning: Planning) -> float:
    """Return the noise (%) that each strain of a path has if all its errors are independent."""
    if planning.noise is not None:
        return planning.noise
    precisions = [
        planning.precision[prepared.part(path.ratio)]
        for prepared in present
        for path in prepared.test.paths
    ]
    if not precisions:
        precisions = [Precision(PERCENT * USUAL_NOISE, 1.0, CANDIDATES.independent_values)]
    return max(precision.for_values(CANDIDATES.loads - 1) for precision in precisions)
