"""Propose torsion of an inflated tube as a candidate of a test plan."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ...materials.law import HypoelasticLaw
from ...meshes.strip_models import TubeModel
from ..measured import PERCENT, USUAL_NOISE
from ..planning import Candidate, Planning, Precision
from .prepared import PreparedTube
from .test import TubeTest


@dataclass(frozen=True)
class CandidateTube:
    """A tube that a plan proposes."""

    radius: float = 100.0  # mm, if the project has no tube
    hoop_share: float = 0.3  # hoop strain of the inflated tube over the law's range
    steps: int = 15  # number of steps of torsion
    independent_values: int = 5  # how many values of a strain count as independent


CANDIDATE = CandidateTube()


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return the candidate test: torsion of an inflated tube up to the shear of the law's range."""
    tubes = [test for test in planning.present if isinstance(test, PreparedTube)]
    make = partial(_twisted, tubes, planning)
    return [Candidate("torsion of a tube", make, planning.noise_is())]


def _twisted(tubes: Sequence[PreparedTube], planning: Planning) -> PreparedTube:
    """Return a tube test, inflated and then twisted, with the strains that the law predicts."""
    radius = tubes[0].test.radius if tubes else CANDIDATE.radius
    law = planning.law
    thickness = planning.place.fabric.thickness
    ends = planning.ends
    pressure = _integral(law, "E2", CANDIDATE.hoop_share * ends[1]) * thickness / radius
    largest_torque = 2 * np.pi * radius**2 * thickness * _integral(law, "G12", ends[2])
    steps = CANDIDATE.steps
    torque = np.linspace(0.0, largest_torque, steps)
    loads = np.column_stack([np.full(steps, pressure), np.zeros(steps), torque])
    model = TubeModel(loads, radius, thickness)
    strain = model.strains(planning.make_solver("membrane").run(model, law).displacement)
    noise = planning.noise
    if not noise:
        usual = Precision(PERCENT * USUAL_NOISE, 1.0, CANDIDATE.independent_values)
        noise = usual.for_values(steps)
    test = TubeTest(
        name="torsion of a tube",
        place=planning.place,
        weight=1.0,
        radius=radius,
        loads=loads,
        strain=strain,
        noise=noise / PERCENT,
    )
    return PreparedTube(test)


def _integral(law: HypoelasticLaw, name: str, end: ArrayLike) -> float:
    """Return the stress (MPa) at strain `end`: the integral of the modulus `name` over strain."""
    strain = np.linspace(0.0, float(np.asarray(end)), 50)
    return float(np.trapezoid(law.modulus(name, strain), strain))
